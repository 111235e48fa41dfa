"""What a frame measures of the costs of tracing is there for the next one, of this session or a later one."""

import json
import os
import subprocess
import sys
from pathlib import Path

import bpy
import numpy as np
import OpenEXR
import pytest

from stereo_reproject.blender.api import render_animation
from stereo_reproject.blender.commands.frame import render_pair
from stereo_reproject.blender.commands.inspection import inspect_scene
from stereo_reproject.blender.commands.known_costs import known_costs
from stereo_reproject.blender.commands.processes import program_of
from stereo_reproject.blender.scene import user_folder as own_folder
from stereo_reproject.blender.scene.devices import device_name
from stereo_reproject.blender.scene.user_folder import USER_FOLDER_VARIABLE, user_folder
from stereo_reproject.report.as_json import as_json
from stereo_reproject.settings.frame import StereoSettings
from stereo_reproject.trace.costs import MEASURED, TraceCosts
from stereo_reproject.trace.costs_file import COSTS_FILE, COSTS_SCHEMA
from tests.blender.toolbox import add_camera, add_cube, add_plane, add_sun, diffuse, empty_scene

ASSUMED_COSTS = TraceCosts()

PACKED = StereoSettings(accuracy="draft", fill="packed")


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.setenv(USER_FOLDER_VARIABLE, str(tmp_path / "own"))
    return tmp_path / "own"


@pytest.fixture
def scene():
    scene = empty_scene(64, 36)
    add_plane(scene, diffuse(), size=(30, 20), location=(0, 0, -9))
    add_cube(scene, diffuse("box", colour=(0.8, 0.2, 0.1)), size=1.5, location=(0, 0, -5))
    add_sun(scene)
    add_camera(scene)
    return scene


def costs_told(report):
    return as_json(report)["fill"]["costs"]


def numbers_kept(folder):
    content = json.loads((folder / COSTS_FILE).read_text())
    assert content["schema"] == COSTS_SCHEMA
    return content["costs"]


def test_a_frame_measures_and_the_next_one_reads(scene, folder, tmp_path):
    _, first = render_pair(scene, PACKED, tmp_path)
    assert costs_told(first) == {**ASSUMED_COSTS.numbers, "source": "assumed"}
    [(key, numbers)] = numbers_kept(folder).items()
    version = ".".join(map(str, bpy.app.version[:2]))
    assert key == f"{device_name(scene)} | Blender {version} | osl"
    assert key.startswith("CPU: ")
    # A frame this small takes a call, and hardly more.
    assert numbers["render_call_seconds"] != ASSUMED_COSTS.render_call_seconds
    assert numbers["packed_pixel_cost"] == pytest.approx(ASSUMED_COSTS.packed_pixel_cost, rel=0.1)

    _, second = render_pair(scene, PACKED, tmp_path)
    assert costs_told(second) == {**numbers, "source": "measured here"}
    told = inspect_scene(scene, PACKED, tmp_path)["predicted"]["fill"]["costs"]
    assert told == {**numbers_kept(folder)[key], "source": "measured here"}


@pytest.mark.parametrize("method", ["card", "full"])
def test_what_another_method_tells_is_kept_too(scene, folder, tmp_path, method):
    render_pair(scene, StereoSettings(accuracy="draft", fill=method), tmp_path)
    assert (folder / COSTS_FILE).exists() == (method == "card")


def test_what_was_measured_decides(scene, folder, tmp_path):
    """A fill as dear as can be against one that costs nearly nothing, of the same frame."""
    chosen = []
    for cost in (4.0, 0.25):
        numbers = TraceCosts(cost, 1.0, 0.01, 0.01).numbers
        render_pair(scene, PACKED, tmp_path)
        [key] = numbers_kept(folder)
        (folder / COSTS_FILE).write_text(json.dumps({"schema": COSTS_SCHEMA, "costs": {key: numbers}}))
        # So that the pixels are what costs.
        scene.cycles.samples = 256
        _, report = render_pair(scene, StereoSettings(accuracy="exact"), tmp_path)
        assert costs_told(report) == {**numbers, "source": "measured here"}
        chosen.append(report.fill.method)
    assert chosen == ["full", "packed"]


def test_without_a_folder_nothing_is_kept(scene, folder, tmp_path, monkeypatch):
    monkeypatch.setenv(USER_FOLDER_VARIABLE, "")
    for _ in range(2):
        _, report = render_pair(scene, PACKED, tmp_path)
        assert costs_told(report)["source"] == "assumed"
    assert not folder.exists()


def test_a_folder_that_cannot_be_used_stops_no_frame(scene, folder, tmp_path):
    folder.write_text("a file")
    for _ in range(2):
        _, report = render_pair(scene, PACKED, tmp_path)
        assert costs_told(report)["source"] == "assumed"


def test_all_frames_of_an_animation_are_chosen_by_the_same_costs(scene, folder, tmp_path):
    """Those that the first one began with, whatever is measured meanwhile, and by a run that goes on with it."""
    scene.frame_start, scene.frame_end = 1, 3
    scene.cycles.seed = 5
    render_pair(scene, PACKED, tmp_path)
    [before] = numbers_kept(folder).values()
    output = tmp_path / "frames"

    def render(*frames):
        report = render_animation(PACKED, frames=frames, scene=scene, output=output, existing="resume")
        return {entry["frame"]: entry["fill"]["costs"] for entry in report["frames"]}

    agreed = {**before, "source": "agreed"}
    assert render(1, 2) == {1: agreed, 2: agreed}
    [after] = numbers_kept(folder).values()
    assert after != before
    assert render(1, 2, 3) == {1: agreed, 2: agreed, 3: agreed}


def test_a_run_of_many_frames_measures_its_first(scene, folder, tmp_path, monkeypatch):
    """Later ones are of a scene that Cycles has kept, and its sync is no first one."""
    scene.frame_start, scene.frame_end = 1, 3
    written = []
    replace = Path.replace

    def noted(self, target):
        written.append(Path(target).name)
        return replace(self, target)

    monkeypatch.setattr(Path, "replace", noted)
    render_animation(PACKED, frames=(1, 2, 3), scene=scene, output=tmp_path / "frames")
    assert written.count(COSTS_FILE) == 1


def test_each_device_is_known_by_its_name(scene):
    assert device_name(scene) != "CPU: "
    # Without a device that is switched on, Cycles renders on the CPU.
    on_cpu = device_name(scene)
    scene.cycles.device = "GPU"
    assert device_name(scene) == on_cpu


def test_the_folder_is_the_extension_s_own(monkeypatch):
    monkeypatch.delenv(USER_FOLDER_VARIABLE)
    package = "bl_ext.user_default.stereo_reproject"
    monkeypatch.setattr(own_folder, "__name__", f"{package}.stereo_reproject.blender.scene.user_folder")
    assert user_folder() == Path(bpy.utils.extension_path_user(package))


@pytest.mark.parametrize(
    ("platform", "variables", "expected"),
    [
        ("linux", {"XDG_CACHE_HOME": "/caches"}, "/caches/stereo_reproject"),
        ("linux", {"XDG_CACHE_HOME": "relative"}, "/home/me/.cache/stereo_reproject"),
        ("linux", {"XDG_CACHE_HOME": ""}, "/home/me/.cache/stereo_reproject"),
        ("darwin", {"XDG_CACHE_HOME": "/caches"}, "/home/me/Library/Caches/stereo_reproject"),
        ("win32", {"LOCALAPPDATA": "/local"}, "/local/stereo_reproject"),
        ("win32", {}, "/home/me/AppData/Local/stereo_reproject"),
        ("linux", {USER_FOLDER_VARIABLE: "/own", "XDG_CACHE_HOME": "/caches"}, "/own"),
        ("linux", {USER_FOLDER_VARIABLE: ""}, None),
    ],
)
@pytest.mark.skipif(os.name != "posix", reason="paths as POSIX has them")
def test_without_an_extension_the_folder_is_the_platform_s(monkeypatch, platform, variables, expected):
    for name in (USER_FOLDER_VARIABLE, "XDG_CACHE_HOME", "LOCALAPPDATA"):
        monkeypatch.delenv(name, raising=False)
    for name, value in {**variables, "HOME": "/home/me"}.items():
        monkeypatch.setenv(name, value)
    monkeypatch.setattr(sys, "platform", platform)
    assert user_folder() == (None if expected is None else Path(expected))


@pytest.mark.parametrize("named", ['/it\'s "own" \\folder', ""])
def test_a_process_in_blender_is_given_the_folder(monkeypatch, named):
    """It has the package under another name, and would not find the extension's folder."""
    monkeypatch.setenv(USER_FOLDER_VARIABLE, named)
    begin, _, _ = program_of("programs.worker").partition("; from stereo_reproject")
    told = f"{begin}; print(os.environ[{USER_FOLDER_VARIABLE!r}])"
    ran = subprocess.run([sys.executable, "-c", told], env={}, capture_output=True, text=True, check=True)
    assert ran.stdout == f"{named}\n"


def test_the_source_of_costs_that_were_read(scene, folder, tmp_path):
    assert known_costs(scene, "osl") == ASSUMED_COSTS
    render_pair(scene, PACKED, tmp_path)
    assert known_costs(scene, "osl").source == MEASURED


def eye_in(path):
    with OpenEXR.File(str(path)) as file:
        return {name: channel.pixels for name, channel in file.channels().items()}


def test_the_first_frame_of_an_animation_measures_what_nobody_knows(scene, folder, tmp_path):
    """And is the same frame when it is rendered again, with nothing left to measure."""
    scene.frame_start, scene.frame_end = 1, 2
    output, settings = tmp_path / "frames", StereoSettings(accuracy="draft")
    # So that pixels are what costs, and are worth to be packed.
    scene.cycles.samples = 256

    def render():
        report = render_animation(
            settings, scene=scene, output=output, existing="resume", layout="individual", file_format="OPEN_EXR"
        )
        frames = {entry["frame"]: entry for entry in report["frames"]}
        return frames, {path.name: eye_in(path) for path in sorted(output.glob("*.exr"))}

    first, pictures = render()
    costs = [entry["fill"]["costs"] for entry in first.values()]
    assert costs[0] == costs[1]
    assert costs[0]["source"] == "agreed"
    assert costs[0]["render_call_seconds"] != ASSUMED_COSTS.render_call_seconds
    methods = [entry["fill"]["method"] for entry in first.values()]
    assert [entry["seconds"].get("pilot", 0.0) > 0.0 for entry in first.values()] == [True, False]
    for path in output.glob("*.exr"):
        path.unlink()

    again, same = render()
    assert [entry["fill"]["costs"] for entry in again.values()] == costs
    assert [entry["seconds"].get("pilot", 0.0) for entry in again.values()] == [0.0, 0.0]
    assert [entry["fill"]["method"] for entry in again.values()] == methods
    assert same.keys() == pictures.keys()
    for name, eye in pictures.items():
        for channel, pixels in eye.items():
            np.testing.assert_array_equal(same[name][channel], pixels)
