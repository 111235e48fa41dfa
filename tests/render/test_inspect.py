"""`inspect` as a user types it, with Blender behind it: the plan, the prediction, refusals, and nothing left behind."""

import json
import os
import subprocess
import sys
from pathlib import Path

import bpy
import pytest

from stereo_reproject.blender.commands.inspection import inspect_scene
from stereo_reproject.blender.engines.renderer import BlenderRenderer
from stereo_reproject.blender.scene.working import open_blend, working_scene
from stereo_reproject.images.effects import Effect
from stereo_reproject.pipeline.frame import render_stereo_frame
from stereo_reproject.pipeline.stereo_frame import traced_fractions
from stereo_reproject.settings.frame import SceneOverrides, StereoSettings
from tests.blender.toolbox import empty_scene, mirror_before_wall

ROOT = Path(__file__).resolve().parents[2]
DEMO = ROOT / "demo" / "cornell-box" / "cornell-box.blend"
DEMO_OPTIONS = ["--interocular", "0.2", "--convergence", "6.9", "--size", "160x160", "--samples", "16"]

SECONDS = 120.0
"""Far more than any of these runs takes."""

FIELDS = {
    "schema",
    "scene",
    "frame",
    "size",
    "samples",
    "engine",
    "device",
    "blender",
    "accuracy",
    "effects",
    "passes",
    "predicted",
    "parallax",
    "warnings",
}

FRACTION = 0.03
"""How far a predicted share of holes may be off, of all pixels. In a sketch of 160 pixels the gaps between the legs of
chairs are lost: 0.034 for 0.055. From one of 480, as larger pictures have it, it is 0.061 for 0.058."""


def inspect(scene, *options, cwd):
    finished = subprocess.run(
        [sys.executable, "-m", "stereo_reproject", "inspect", str(scene), *map(str, options)],
        env={**os.environ, "PYTHONPATH": str(ROOT), "PYTHONWARNINGS": "error", "TMPDIR": str(cwd)},
        cwd=cwd,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=SECONDS,
        check=False,
    )
    assert list(cwd.iterdir()) == [], "something is left behind"
    return finished


@pytest.fixture
def empty_folder(tmp_path):
    folder = tmp_path / "empty"
    folder.mkdir()
    return folder


@pytest.fixture
def mirror_scene():
    """A mirror ball before a matte wall."""
    return mirror_before_wall(160, 90, samples=16)


def effect_of(inspection, effect):
    return next(row for row in inspection["effects"] if row["effect"] == effect.label)


# As JSON


def test_json_is_all_that_standard_output_has(empty_folder):
    finished = inspect(DEMO, "--json", *DEMO_OPTIONS, cwd=empty_folder)
    assert finished.returncode == 0, finished.stderr
    found = json.loads(finished.stdout)
    assert set(found) == FIELDS
    assert found["schema"] == 1
    assert found["size"] == [160, 160]
    assert found["passes"] == ["Combined", "Depth", "Denoising Data"]
    called_for = [row["effect"] for row in found["effects"] if row["called_for"]]
    assert called_for == [Effect.DENOISING.label]
    assert [set(row) for row in found["effects"]] == [{"effect", "called_for", "by", "handling"}] * len(Effect)
    assert found["warnings"] == []
    assert "warning" not in finished.stderr


def test_a_prediction_is_given_with_what_it_rests_on(empty_folder):
    found = json.loads(inspect(DEMO, "--json", *DEMO_OPTIONS, cwd=empty_folder).stdout)["predicted"]
    assert found["sketch"]["size"] == [80, 80]
    assert found["sketch"]["samples"] == [1, 2]
    assert "80x80" in found["rests_on"]
    # Nothing in it looks different from each eye: there is nothing that only probes could tell.
    assert found["total_seconds"]["low"] == found["total_seconds"]["high"] > found["source_seconds"] > 0.0
    assert found["gain"]["low"] == pytest.approx(found["multiview_seconds"] / found["total_seconds"]["low"])


def test_without_a_sketch_nothing_is_rendered(empty_folder):
    found = json.loads(inspect(DEMO, "--json", "--no-sketch", *DEMO_OPTIONS, cwd=empty_folder).stdout)
    assert found["predicted"] is None
    assert found["size"] == [160, 160]


# As a table


def test_the_table(empty_folder):
    finished = inspect(DEMO, *DEMO_OPTIONS, "--accuracy", "draft", cwd=empty_folder)
    assert finished.returncode == 0, finished.stderr
    first, *_, last = finished.stdout.splitlines()
    assert first == "cornell-box, frame 1, 160x160, 16 samples, draft, CYCLES on CPU"
    assert "x over Blender's multiview" in last
    assert "denoising" in finished.stdout


# What stands between the eyes


@pytest.mark.parametrize(("interocular", "lines"), [(0.05, 0), (9.0, 1)])
def test_what_stands_between_the_eyes_of_a_panorama_is_told_by_the_sketch(mirror_scene, tmp_path, interocular, lines):
    asked = SceneOverrides(panorama="vr180", size=(32, 32), samples=1, interocular_distance=interocular)
    found = inspect_scene(mirror_scene, StereoSettings(scene=asked), tmp_path)
    assert len(found["warnings"]) == lines
    assert all("what is nearer to the camera than its interocular distance" in line for line in found["warnings"])
    unseen = inspect_scene(mirror_scene, StereoSettings(scene=asked), tmp_path, sketch=False)
    assert unseen["warnings"] == []


# Bad input


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--size", "0x5"], "the width must be from 4"),
        (["--accuracy", "best"], "best"),
        (["--compare"], "--compare"),
        (["--output", "out"], "--output"),
    ],
)
def test_what_it_refuses(empty_folder, options, said):
    finished = inspect(DEMO, *options, cwd=empty_folder)
    assert (finished.returncode, finished.stdout) == (2, "")
    assert finished.stderr.count("\n") == 1
    assert said in finished.stderr


def test_a_scene_without_a_camera_is_refused(tmp_path, empty_folder):
    empty_scene()
    path = tmp_path / "blind.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    finished = inspect(path, cwd=empty_folder)
    assert (finished.returncode, finished.stdout) == (2, "")
    assert "the scene has no camera" in finished.stderr


def test_a_missing_file_is_refused(empty_folder):
    finished = inspect("nowhere.blend", cwd=empty_folder)
    assert (finished.returncode, finished.stdout) == (2, "")
    assert "does not exist" in finished.stderr


# In Blender


def test_what_is_called_for_makes_the_prediction_a_range(mirror_scene, tmp_path):
    # Asked for: a scene so small may by chance seem cheaper to render whole, and has no probes then.
    found = inspect_scene(mirror_scene, StereoSettings(fill="packed"), tmp_path)
    row = effect_of(found, Effect.GLOSSY)
    assert row["by"] == ["material 'mirror' on 'Sphere'"]
    assert 0.05 < row["share"] < 0.5
    assert row["seconds_at_most"] > 0.0
    assert found["passes"] == ["Combined", "Depth", "CryptoMaterial"]
    predicted = found["predicted"]
    assert predicted["fractions"]["probes"] > 0.0
    assert predicted["total_seconds"]["low"] < predicted["total_seconds"]["high"]
    assert predicted["gain"]["low"] < predicted["gain"]["high"]


def test_the_scene_is_left_as_it_was(mirror_scene, tmp_path):
    def state():
        layer = mirror_scene.view_layers[0]
        return [
            *(sorted(block.name for block in getattr(bpy.data, kind)) for kind in ("scenes", "objects", "cameras")),
            mirror_scene.render.resolution_x,
            mirror_scene.cycles.samples,
            layer.use_pass_cryptomatte_material,
            layer.pass_cryptomatte_depth,
        ]

    before = state()
    inspect_scene(mirror_scene, StereoSettings(), tmp_path)
    assert state() == before


def test_without_a_distance_between_the_eyes_nothing_is_seen_differently(mirror_scene, tmp_path):
    overrides = SceneOverrides(interocular_distance=0.0)
    predicted = inspect_scene(mirror_scene, StereoSettings(scene=overrides), tmp_path)["predicted"]
    assert predicted["fractions"]["probes"] == 0.0
    assert predicted["refine_seconds"] == {"low": 0.0, "high": 0.0}


def test_of_eevee_it_is_said_how_it_is_done(mirror_scene, tmp_path):
    mirror_scene.render.engine = "BLENDER_EEVEE_NEXT" if bpy.app.version < (5, 0) else "BLENDER_EEVEE"
    found = inspect_scene(mirror_scene, StereoSettings(), tmp_path)
    assert found["predicted"]["fill"]["method"] == "packed"
    assert "unless a second EEVEE render" in found["predicted"]["fill"]["reason"]
    assert found["predicted"]["gain"] == {"low": 1.0, "high": 2.0}
    assert found["passes"] == ["Combined", "Depth"]


def test_passes_that_the_user_wants_are_listed(mirror_scene, tmp_path):
    mirror_scene.view_layers[0].use_pass_normal = True
    passes = inspect_scene(mirror_scene, StereoSettings(), tmp_path, sketch=False)["passes"]
    assert passes == ["Combined", "Depth", "Normal", "CryptoMaterial"]


def test_a_border_is_sketched_too(mirror_scene, tmp_path):
    render = mirror_scene.render
    render.use_border, render.border_min_x, render.border_max_x = True, 0.25, 0.75
    render.border_min_y, render.border_max_y = 0.0, 1.0
    found = inspect_scene(mirror_scene, StereoSettings(), tmp_path)
    assert found["size"] == [80, 90]
    assert found["predicted"]["sketch"]["size"] == [40, 45]


# Scenes that others made


@pytest.mark.parametrize(
    ("name", "effect"),
    [
        ("bathroom", Effect.GLOSSY),
        ("volumetric-caustic", Effect.VOLUME),
        ("fur-ball", Effect.HAIR),
        ("bmw27", Effect.DEPTH_OF_FIELD),
        ("meadow", Effect.ALPHA),
    ],
)
def test_what_a_real_scene_calls_for(shared_scenes, empty_folder, name, effect):
    finished = inspect(shared_scenes / name / f"{name}.blend", "--json", "--no-sketch", cwd=empty_folder)
    assert finished.returncode == 0, finished.stderr
    found = json.loads(finished.stdout)
    assert effect_of(found, effect)["called_for"]
    assert "CryptoMaterial" in found["passes"]


@pytest.mark.parametrize(
    ("name", "interocular", "convergence", "effect"),
    [("bathroom", 0.065, 2.5, Effect.GLOSSY), ("classroom", 0.065, 6.5, Effect.GLOSSY)],
)
def test_predicted_holes_are_those_of_the_picture(shared_scenes, tmp_path, name, interocular, convergence, effect):
    scene = open_blend(shared_scenes / name / f"{name}.blend")
    overrides = SceneOverrides(
        size=(320, 180), samples=4, interocular_distance=interocular, convergence_distance=convergence
    )
    assert effect_of(inspect_scene(scene, StereoSettings(scene=overrides), tmp_path, sketch=False), effect)["by"]
    draft = StereoSettings(scene=overrides, accuracy="draft", fill="packed")
    with working_scene(scene, overrides) as working:
        frame = render_stereo_frame(BlenderRenderer(working, tmp_path), draft)
    found = inspect_scene(scene, draft, tmp_path)
    measured, predicted = traced_fractions(frame), found["predicted"]["fractions"]
    for reason in ("disoccluded", "outside"):
        assert predicted[reason] == pytest.approx(measured[reason], abs=FRACTION), reason
