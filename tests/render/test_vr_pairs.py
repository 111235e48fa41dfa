"""VR180 and 360° pairs of a scene whose camera is a perspective one, by the command line."""

import json
import subprocess
import sys

import numpy as np
import OpenEXR
import pytest

from stereo_reproject.blender.scene.working import open_blend
from tests.render.test_command_line import DEMO, SECONDS, environment, render, save

OPTIONS = ("--samples", "1", "--no-denoise", "--interocular", "0.2")


def eye(path):
    with OpenEXR.File(str(path)) as file:
        channels = file.channels()
        return channels["RGBA"].pixels if "RGBA" in channels else channels["RGB"].pixels


@pytest.mark.parametrize(
    ("option", "panorama", "size"), [("--vr180=64", "vr180", [64, 64]), ("--vr360=128", "vr360", [128, 64])]
)
def test_a_pair_of_the_cornell_box(tmp_path, option, panorama, size):
    """The box stands in the middle of the picture, and around it there is nothing."""
    run = render(DEMO, tmp_path / "out", option, *OPTIONS)
    assert (run.status, run.err) == (0, "")
    report = run.report
    assert (report["panorama"], report["size"]) == (panorama, size)
    assert report["fill"]["method"] in ("packed", "full")
    assert report["warnings"] == []
    width, height = size
    for view in ("left", "right"):
        picture = eye(run.folder / f"{view}.exr")
        assert picture.shape[:2] == (height, width)
        y, x = np.nonzero(picture[..., :3].max(axis=-1))
        assert (x.mean(), y.mean()) == pytest.approx((0.5 * width, 0.5 * height), abs=1.5)
        assert x.max() - x.min() < 0.25 * width


def test_a_report_warns_of_lost_depth_of_field_and_others_name_no_panorama(tmp_path):
    scene = open_blend(DEMO)
    scene.camera.data.dof.use_dof = True
    blend = save(scene, tmp_path / "box.blend")
    run = render(blend, tmp_path / "sharp", "--vr180=32", *OPTIONS)
    (warning,) = run.report["warnings"]
    assert warning.startswith("depth of field is switched off")
    assert warning in run.err
    plain = render(blend, tmp_path / "plain", "--size", "32x18", *OPTIONS)
    assert "panorama" not in plain.report


def test_frames_of_an_animation(tmp_path):
    """A camera that turns away loses sight of the box, however it nods."""
    scene = open_blend(DEMO)
    camera, (pitch, _, turn) = scene.camera, scene.camera.rotation_euler
    for frame, rotation in ((1, (pitch + 0.4, 0.0, turn)), (2, (pitch, 0.3, turn + 0.7))):
        camera.rotation_euler = rotation
        camera.keyframe_insert("rotation_euler", frame=frame)
    blend = save(scene, tmp_path / "box.blend")
    folder = tmp_path / "frames"
    command = [sys.executable, "-m", "stereo_reproject", "animate", str(blend)]
    command += ["--layout", "individual", "--format", "OPEN_EXR"]
    run = subprocess.run(
        [*command, "--output", str(folder), "--frames", "1-2", "--vr180", "64", *OPTIONS],
        env=environment(),
        capture_output=True,
        text=True,
        timeout=SECONDS,
        check=False,
    )
    assert (run.returncode, run.stderr) == (0, "")
    report = json.loads(next(folder.rglob("*animation.json")).read_text())
    assert [row["size"] for row in report["frames"]] == [[64, 64], [64, 64]]
    middles = []
    for path in sorted(folder.glob("*_L.exr")):
        y, x = np.nonzero(eye(path)[..., :3].max(axis=-1))
        middles.append((x.mean(), y.mean()))
    # A pixel is 180° / 64; to turn left moves the box to the right.
    expected = [(32.0, 32.0), (32.0 + 64.0 * 0.7 / np.pi, 32.0)]
    np.testing.assert_allclose(middles, expected, atol=1.5)


def test_what_cannot_be_one_is_refused_in_a_line(tmp_path):
    scene = open_blend(DEMO)
    scene.camera.data.type = "ORTHO"
    run = render(save(scene, tmp_path / "box.blend"), tmp_path / "out", "--vr180=64", *OPTIONS)
    assert (run.status, run.out, run.err.count("\n")) == (2, "", 1)
    assert "is orthographic: a VR180 panorama needs a perspective or an equirectangular one" in run.err
    assert not run.folder.exists()
