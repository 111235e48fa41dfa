"""`python -m tests.bench.warp`: its figures of the warp stage, its file, and its words of what is amiss."""

import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from stereo_reproject.errors import BadInputError
from stereo_reproject.warp import composite
from stereo_reproject.warp.warper import NUMPY, Warper, warp_view
from tests.bench.warp import __main__ as program
from tests.bench.warp import measure, profile, scenes, settings
from tests.bench.warp.settings import BenchSettings, format_bench

ROOT = Path(__file__).resolve().parents[2]
SECONDS = 60.0
SMALL = "96x64"

FIGURES = {
    "seconds",
    "carry_seconds",
    "map_seconds",
    "reasons_seconds",
    "lookup_seconds",
    "lookup_ratio",
    "peak_bytes_per_pixel",
}
FACTS = {
    "size",
    "runs",
    "warp",
    "device",
    "machine",
    "versions",
    "scene",
    "holes",
    "grid",
    "subdivided",
    "agreement",
    "profile",
}

GPU = Warper(warp_view, "Grand 9000")

LEFT_UNTOLD = 0.25
"""Share of the stage's time that may be in none of its steps: a tenth at most sizes."""

LEAST_BYTES, MOST_BYTES = 12, 86
"""A pixel's place (x, y) and nearness alone are as many as the least."""


def measure_warp(*options, folder=ROOT, path=()):
    """Exit status, standard output and standard error, as a user has them."""
    command = [sys.executable, "-m", "tests.bench.warp", *map(str, options)]
    environment = {
        **os.environ,
        "PYTHONPATH": os.pathsep.join(map(str, (*path, ROOT))),
        "PYTHONWARNINGS": "error",
    }
    done = subprocess.run(
        command, env=environment, cwd=folder, capture_output=True, text=True, timeout=SECONDS, check=False
    )
    return done.returncode, done.stdout, done.stderr


def without(folder, *modules):
    """A folder that hides these modules from a Python that has it on its path."""
    folder.mkdir()
    for name in modules:
        (folder / f"{name}.py").write_text(f"raise ImportError('no {name} here')\n", encoding="utf-8")
    return folder


def no_gpu():
    return None, "no usable GPU (none was asked for)"


def measured(**changes):
    asked = BenchSettings(**{"size": (96, 64), **changes})
    return measure.measure(asked, 1.0, core=None, find_gpu=no_gpu)


@pytest.mark.parametrize("scene", settings.SCENES)
def test_it_measures_without_blender_and_replaces_the_file(tmp_path, scene):
    file = tmp_path / "warp.json"
    file.write_text("what was there", encoding="utf-8")
    hidden = without(tmp_path / "hidden", "bpy", "OpenEXR", "matplotlib")
    status, out, err = measure_warp("--size", SMALL, "--scene", scene, "--json", file, path=(hidden,))
    assert (status, err) == (0, "")
    report = json.loads(file.read_text(encoding="utf-8"))
    assert set(report) >= FIGURES | FACTS
    assert (report["size"], report["runs"], report["warp"]) == ([96, 64], 5, "numpy")
    assert all(report[name] > 0.0 for name in FIGURES)
    assert report["peak_bytes_per_pixel"] > LEAST_BYTES
    assert report["scene"]["name"] == scene
    assert report["versions"]["scipy"]
    assert report["agreement"]["holes"] is None
    assert "no usable GPU" in report["agreement"]["why_none"]
    assert f"{report['lookup_ratio']:.2f}" in out
    assert list(tmp_path.glob(".*")) == []


def test_the_medians_and_the_ratio_are_those_of_all_turns(monkeypatch):
    turns = iter([measure.Turn(1.0, 1.0, 1.0, 0.5), *(measure.Turn(0.2, 0.1 * k, 0.1, 0.05) for k in (1, 4, 3, 2))])
    monkeypatch.setattr(measure, "_turn", lambda *_: next(turns))
    report = measured()
    assert report["all_seconds"] == pytest.approx([2.0, 0.3, 0.6, 0.5, 0.4])
    assert report["seconds"] == pytest.approx(0.5)
    assert report["carry_seconds"] == pytest.approx(0.2)
    assert report["reasons_seconds"] == pytest.approx(0.3)
    assert report["map_seconds"] == pytest.approx(0.05)
    assert report["lookup_ratio"] == pytest.approx(4.0), "the ratios are 2, 3, 6, 5, 4"
    assert "ratio" in report["lookup_ratio_is"]


@pytest.mark.parametrize("mode", settings.MODES)
def test_the_profile_finds_every_step_and_nearly_all_of_the_time(mode):
    stage = measure.Stage(BenchSettings(size=(480, 270), mode=mode), 1.0)
    seconds = profile.profiled(lambda: stage.whole(NUMPY))
    assert tuple(seconds) == profile.STEPS
    assert all(value > 0.0 for value in seconds.values())
    assert seconds[profile.REST] < LEFT_UNTOLD * sum(seconds.values())


def test_time_that_a_step_takes_longer_is_told_of_that_step_alone(monkeypatch):
    stage = measure.Stage(BenchSettings(size=(96, 64)), 1.0)
    slept = 0.2

    def slow(step):
        def called(*arguments, **options):
            time.sleep(slept)
            return step(*arguments, **options)

        return called

    # What the step calls, that the profiler still knows the step.
    monkeypatch.setattr(composite, "passes_seen", slow(composite.passes_seen))
    seconds = profile.profiled(lambda: stage.whole(NUMPY))
    assert seconds["lookup"] >= slept > sum(seconds.values()) - seconds["lookup"]


def test_a_gpu_has_no_profile():
    grand = Warper(lambda *passes, **options: replace(warp_view(*passes, **options), by="gpu"), "Grand 9000")
    asked = BenchSettings(size=(96, 64), warp="gpu")
    report = measure.measure(asked, 1.0, core=None, find_gpu=lambda: (grand, ""))
    assert report["profile"] is None
    assert ". grid" not in format_bench(report)
    assert ". grid" in format_bench(measured())


def test_the_peak_is_that_of_the_stage_over_its_input():
    def call():
        kept = np.zeros(1 << 20, np.uint8)
        return kept.sum()

    before = np.zeros(1 << 22, np.uint8)
    assert (1 << 20) <= measure._peak_bytes(call) < (1 << 21)
    assert before.size == 1 << 22


def test_the_agreement_counts_holes_and_takes_the_largest_colour_difference_where_both_have_one(monkeypatch):
    size = (4, 5)
    ours, theirs = np.zeros(size, np.uint16), np.zeros(size, np.uint16)
    ours[0, 0] = theirs[1, 1] = theirs[0, 0] = 2
    colour = np.zeros((*size, 4), np.float32)
    other = colour.copy()
    other[3, 3, 1], other[0, 0], other[1, 1] = -0.25, 9.0, 9.0

    class WarpedView:
        def __init__(self, image):
            self.passes = {"Combined": image}

    class Stage:
        def whole(self, warp):
            return (WarpedView(colour), ours) if warp is NUMPY else (WarpedView(other), theirs)

    agreement = measure._agreement(Stage(), lambda: (GPU, ""))
    assert agreement == {"holes": 1 / 20, "colour": 0.25, "why_none": None}
    assert "5.0000% of the pixels, colours by 0.25" in settings._agreement_line(agreement)


def test_a_gpu_that_is_not_there_is_an_error_where_it_is_asked_for():
    with pytest.raises(BadInputError, match=r"--warp gpu: no usable GPU .*; --warp numpy needs none"):
        measured(warp="gpu")


def test_numpy_is_never_measured_as_a_gpu():
    """A GPU leaves what it cannot hold to numpy."""
    small = Warper(warp_view, "A small GPU")
    left = "A small GPU has left a picture of this size to numpy"
    for warp in settings.CARRIERS:
        asked = BenchSettings(size=(96, 64), warp=warp)
        options = {"core": None, "find_gpu": lambda: (small, "")}
        if warp == "gpu":
            with pytest.raises(BadInputError, match=f"--warp gpu: {left}; take a smaller --size"):
                measure.measure(asked, 1.0, **options)
        else:
            found = measure.measure(asked, 1.0, **options)["agreement"]
            assert found == {"holes": None, "colour": None, "why_none": left}


@pytest.mark.parametrize("mode", settings.MODES)
def test_it_holds_no_more_than_is_promised(mode):
    """Next to nothing of it is chance."""
    assert measured(size=(960, 540), mode=mode)["peak_bytes_per_pixel"] <= MOST_BYTES


@pytest.mark.parametrize(("found", "why"), [(GPU, ""), (None, "no usable GPU (Blender finds none)")])
def test_a_gpu_is_found_or_there_is_a_reason(monkeypatch, found, why):
    module = type(sys)("gpu_warp")
    module.gpu_warper = lambda: found
    monkeypatch.setattr(program.importlib, "import_module", lambda *_: module)
    assert program.find_gpu() == (found, why)


def test_without_blender_there_is_no_gpu(monkeypatch):
    def no_blender(*_):
        raise ImportError("No module named 'bpy'")

    monkeypatch.setattr(program.importlib, "import_module", no_blender)
    assert program.find_gpu() == (None, "no usable GPU (No module named 'bpy')")


def test_the_summary_is_plain(capsys):
    text = format_bench(measured())
    assert text.isascii()
    assert max(map(len, text.splitlines())) < 100


def test_the_scenes_have_what_they_are_for():
    assert tuple(scenes.SCENES) == settings.SCENES
    hard = measured(size=(480, 270))
    smooth = measured(size=(480, 270), scene="smooth")
    assert hard["subdivided"] > 0.5
    assert smooth["subdivided"] < 0.1
    assert smooth["holes"] < hard["holes"] < 0.5


@pytest.mark.parametrize("mode", settings.MODES)
def test_both_eyes_look_at_where_they_converge(mode):
    """The source's centre at the convergence distance is the target's centre too; and toe-in is no shift of rows."""
    source, target = scenes.eyes(640, 360, mode)
    point = source.world_from_camera @ np.array([0.0, 0.0, -scenes.CONVERGENCE, 1.0])
    x, y, z, _ = np.linalg.inv(target.world_from_camera) @ point
    plane = target.plane
    assert x / -z == pytest.approx(0.5 * (plane.left + plane.right))
    assert y == pytest.approx(0.0)
    assert np.array_equal(target.world_from_camera[:3, :3], np.eye(3)) == (mode == "off-axis")


def test_a_pair_that_is_toed_in_is_measured_too():
    report = measured(mode="toe-in")
    assert report["scene"]["mode"] == "toe-in"
    assert report["holes"] < 0.6


@pytest.mark.parametrize("scene", settings.SCENES)
def test_a_threshold_of_nothing_subdivides_every_cell(scene):
    asked = BenchSettings(size=(96, 64), scene=scene)
    assert measure.measure(asked, 0.0, core=None, find_gpu=no_gpu)["subdivided"] == 1.0


@pytest.mark.parametrize(
    ("options", "told"),
    [
        (["--size", "wide"], "--size: must be of the form WIDTHxHEIGHT"),
        (["--size", "0x4"], "--size: the width must be from 4"),
        (["--runs", "4"], "--runs: runs must be from 5"),
        (["--scene", "garden"], "--scene: invalid choice: 'garden'"),
        (["--mode", "parallel"], "--mode: invalid choice: 'parallel'"),
        (["--grid-threshold", "-1"], "--grid-threshold: the grid threshold must be at least 0"),
        (["--json", "nowhere/warp.json"], "nowhere does not exist; make it"),
        (["--json", "."], "is a folder; name a file in it"),
        (["--json", ""], "the file has no name; give it one"),
        (["--json", "/dev/null"], "/dev/null is not a regular file"),
        (["--json", f"{'a' * 300}.json"], "cannot be written (File name too long)"),
    ],
)
def test_what_cannot_be_done_is_told_in_a_line(tmp_path, monkeypatch, capsys, options, told):
    monkeypatch.chdir(tmp_path)
    assert program.main(options) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.count("\n") == 1
    assert told in printed.err
    assert list(tmp_path.iterdir()) == []


def test_without_scipy_it_says_what_to_install(tmp_path):
    hidden = without(tmp_path / "hidden", "scipy")
    file = tmp_path / "warp.json"
    status, out, err = measure_warp("--size", SMALL, "--json", file, path=(hidden,))
    assert (status, out) == (2, "")
    assert err.count("\n") == 1
    assert "SciPy is missing (no scipy here); run `pip install scipy`" in err
    assert not file.exists()


@pytest.mark.skipif(len(getattr(os, "sched_getaffinity", lambda _: ())(0)) < 2, reason="takes two cores, and Linux")
def test_an_interrupted_measurement_leaves_nothing(tmp_path):
    (tmp_path / "tmp").mkdir()
    command = [sys.executable, "-m", "tests.bench.warp", "--size", "1024x1024", "--runs", "1000"]
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "TMPDIR": str(tmp_path / "tmp")}
    with subprocess.Popen(
        [*command, "--json", str(tmp_path / "warp.json")],
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    ) as process:
        deadline = time.monotonic() + SECONDS
        # It keeps to one core once it has understood what it is to do.
        while len(os.sched_getaffinity(process.pid)) > 1 and time.monotonic() < deadline:
            time.sleep(0.01)
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=SECONDS)
    assert (process.returncode, out) == (130, b"")
    assert err.startswith(b"tests.bench.warp: interrupted")
    assert err.count(b"\n") == 1
    assert [path.name for path in tmp_path.rglob("*")] == ["tmp"]


@pytest.mark.skipif(os.name != "posix", reason="links as POSIX has them")
def test_the_file_that_a_link_names_is_written_and_the_link_stays(tmp_path):
    file, link = tmp_path / "old.json", tmp_path / "link.json"
    file.write_text("old")
    link.symlink_to(file.name)
    status, _, err = measure_warp("--size", SMALL, "--json", link)
    assert (status, err) == (0, "")
    assert link.is_symlink()
    assert json.loads(file.read_text())["size"]


@pytest.mark.skipif(os.name != "posix", reason="links as POSIX has them")
def test_links_in_a_circle_stay(tmp_path):
    link = tmp_path / "link.json"
    link.symlink_to(link.name)
    status, out, err = measure_warp("--size", SMALL, "--json", link)
    assert (status, out) == (2, "")
    assert "cannot be written" in err
    assert link.is_symlink()


@pytest.mark.skipif(os.name != "posix", reason="a FIFO")
def test_what_is_no_file_is_not_replaced_by_one(tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    status, out, err = measure_warp("--size", SMALL, "--json", pipe)
    assert (status, out) == (2, "")
    assert "is not a regular file" in err
    assert pipe.is_fifo()
