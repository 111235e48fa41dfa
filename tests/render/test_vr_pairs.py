"""VR180 and 360° pairs of a scene whose camera is a perspective one, by the command line."""

import json
import re
import struct
import subprocess
import sys

import numpy as np
import OpenEXR
import pytest

from stereo_reproject.blender.output.cutout_sheet import GAP_PX, SIZES_PX
from stereo_reproject.blender.output.pictures import COLOURS, read_png
from stereo_reproject.blender.scene.working import open_blend
from stereo_reproject.images.reasons import Reason
from tests.blender.toolbox import set_border
from tests.delivery.movies import described, sphere, stereo
from tests.delivery.test_projection import content_of
from tests.render.test_command_line import DEMO, FILES, SECONDS, environment, render, save

LEAST, _ = SIZES_PX
"""Width of a cut-out in the sheet of a small panorama."""

OPTIONS = ("--samples", "1", "--no-denoise", "--interocular", "0.2", "--mode", "parallel")


DEGREES = {"vr180": 180.0, "vr360": 360.0}
BOX_DEGREES = 2.0 * np.degrees(np.arctan(1.0 / 5.8))
"""Width and height of the Cornell box's opening: 2 units wide, 5.8 before its camera."""


def eye(path):
    with OpenEXR.File(str(path)) as file:
        channels = file.channels()
        return channels["RGBA"].pixels if "RGBA" in channels else channels["RGB"].pixels


@pytest.mark.parametrize(
    ("option", "panorama", "size"),
    [
        ("--vr180=64", "vr180", [64, 64]),
        ("--vr360=128", "vr360", [128, 64]),
        ("--vr180=128x64", "vr180", [128, 64]),
        ("--vr360=64x64", "vr360", [64, 64]),
    ],
)
def test_a_pair_of_the_cornell_box(tmp_path, option, panorama, size):
    """The box stands in the middle of the picture, and around it there is nothing. Whatever the picture's shape, it is
    as many degrees wide, and high."""
    run = render(DEMO, tmp_path / "out", option, *OPTIONS)
    assert (run.status, run.err) == (0, "")
    report = run.report
    assert (report["panorama"], report["size"]) == (panorama, size)
    assert report["fill"]["method"] in ("packed", "full")
    assert report["warnings"] == []
    assert "cutouts.png" in run.files
    assert "cutouts.png" in run.out
    width, height = size
    for view in ("left", "right"):
        picture = eye(run.folder / f"{view}.exr")
        assert picture.shape[:2] == (height, width)
        y, x = np.nonzero(picture[..., :3].max(axis=-1))
        assert (x.mean(), y.mean()) == pytest.approx((0.5 * width, 0.5 * height), abs=1.5)
        # It begins and ends within pixels, and the filter reaches beyond.
        for at, degrees in ((x, DEGREES[panorama] / width), (y, 180.0 / height)):
            assert (np.ptp(at) + 1) * degrees == pytest.approx(BOX_DEGREES, abs=2.0 * degrees)


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


# Movies

PIXELS = re.compile(r", (\d+)x(\d+) \[SAR (\d+:\d+)")
"""Width, height and shape of a movie's pixels, as FFmpeg prints them."""


@pytest.fixture(scope="module")
def wide_box(tmp_path_factory):
    """The Cornell box, in a file whose pixels are twice as wide as they are high."""
    scene = open_blend(DEMO)
    scene.render.pixel_aspect_x = 2.0
    scene.frame_end = 2
    return save(scene, tmp_path_factory.mktemp("wide") / "box.blend")


def animate(blend, folder, *options):
    command = [sys.executable, "-m", "stereo_reproject", "animate", str(blend), "--output", str(folder)]
    return subprocess.run(
        [*command, "--frames", "1-2", *OPTIONS, *options],
        env=environment(),
        capture_output=True,
        text=True,
        timeout=SECONDS,
        check=False,
    )


@pytest.mark.parametrize(
    ("option", "layout", "tag", "size", "mode"),
    [
        ("--vr180=64", "side-by-side", "_180_LR", (128, 64), "side by side"),
        ("--vr180=64", "side-by-side-half", "_180_HSBS", (64, 64), "side by side"),
        ("--vr180=64", "top-bottom", "_180_TB", (64, 128), "top and bottom"),
        ("--vr180=64", "top-bottom-half", "_180_HTB", (64, 64), "top and bottom"),
        ("--vr360=64", "top-bottom", "_360_TB", (64, 64), "top and bottom"),
    ],
)
def test_a_movie_says_what_it_shows(wide_box, tmp_path, option, layout, tag, size, mode):
    """To FFmpeg, and to a parser of boxes; its pixels are square, though the scene's are not."""
    folder = tmp_path / "out"
    run = animate(wide_box, folder, option, "--layout", layout, "--movie")
    assert (run.returncode, run.stderr) == (0, "")
    (movie,) = folder.glob("*.mp4")
    assert movie.stem.endswith(tag)
    assert stereo(movie) == mode
    cut = round(0.25 * 0xFFFFFFFF - 0.5) if "180" in option else 0
    assert content_of(movie, b"equi") == [struct.pack(">5I", 0, 0, 0, cut, cut)]
    assert sphere(movie).startswith("tiled equirectangular" if cut else "equirectangular")
    found = PIXELS.search(described(movie))
    assert found is not None, described(movie)
    assert (int(found[1]), int(found[2]), found[3]) == (*size, "1:1")


def test_a_movie_of_h265_is_half_equirectangular_and_side_by_side(wide_box, tmp_path):
    """By Apple's boxes, which FFmpeg reads too."""
    scene = open_blend(wide_box)
    scene.render.ffmpeg.codec = "H265"
    folder = tmp_path / "out"
    run = animate(save(scene, tmp_path / "box.blend"), folder, "--vr180=64", "--layout=side-by-side", "--movie")
    assert (run.returncode, run.stderr) == (0, "")
    movie = folder / "box_180_LR.mp4"
    assert (sphere(movie), stereo(movie)) == ("half equirectangular", "side by side")
    assert content_of(movie, b"vexu", b"proj", b"prji") == [bytes(4) + b"hequ"]
    assert content_of(movie, b"hfov") == [struct.pack(">I", 180_000)]


@pytest.mark.parametrize(("kind", "lines"), [("FISHEYE_EQUIDISTANT", 1), ("EQUIRECTANGULAR", 0)])
def test_a_movie_of_a_fisheye_is_one_warning(wide_box, tmp_path, kind, lines):
    scene = open_blend(wide_box)
    scene.camera.data.type, scene.camera.data.panorama_type = "PANO", kind
    folder = tmp_path / "out"
    options = ("--size=32x32", "--layout=side-by-side", "--movie")
    run = animate(save(scene, tmp_path / "box.blend"), folder, *options)
    assert (run.returncode, run.stderr.count("\n")) == (0, lines)
    assert ("movies have no mark for such a panorama" in run.stderr) == bool(lines)
    (movie,) = folder.glob("*.mp4")
    assert bool(content_of(movie, b"equi")) == (not lines)


def test_pictures_of_the_cutouts_come_with_those_of_the_holes(wide_box, tmp_path):
    folder = tmp_path / "out"
    run = animate(wide_box, folder, "--vr180=64", "--holes")
    assert (run.returncode, run.stderr) == (0, "")
    sheets = sorted((folder / "cutouts").iterdir())
    assert [path.name for path in sheets] == [path.name for path in sorted((folder / "holes").iterdir())]
    first, second = (read_png(path) for path in sheets)
    assert first.shape == second.shape
    assert first.shape[1] == 5 * LEAST + 4 * GAP_PX
    again = animate(wide_box, folder, "--vr180=64", "--holes", "--resume")
    assert (again.returncode, again.stderr) == (0, "")
    assert "2 of 2 frames are there already" in again.stdout


def test_a_picture_in_the_place_of_a_cutout_is_not_replaced_unasked(wide_box, tmp_path):
    own = tmp_path / "out" / "cutouts" / "0001.png"
    own.parent.mkdir(parents=True)
    own.write_bytes(b"somebody's own")
    run = animate(wide_box, own.parents[1], "--vr180=64", "--holes")
    assert run.returncode == 2
    assert "1 of 2 frames are there already (1)" in run.stderr
    assert own.read_bytes() == b"somebody's own"


def test_a_panorama_without_cutouts_is_not_rendered_again(tmp_path):
    """Too little of the sphere is seen for one."""
    scene = open_blend(DEMO)
    scene.frame_end = 2
    data = scene.camera.data
    data.type, data.panorama_type = "PANO", "EQUIRECTANGULAR"
    data.longitude_min, data.longitude_max, data.latitude_min, data.latitude_max = -0.3, 0.3, -0.3, 0.3
    blend, folder = save(scene, tmp_path / "narrow.blend"), tmp_path / "out"
    options = ("--size", "64x64", "--holes")
    assert animate(blend, folder, *options).returncode == 0
    assert not (folder / "cutouts").exists()
    again = animate(blend, folder, *options, "--resume")
    assert (again.returncode, again.stderr) == (0, "")
    assert "2 of 2 frames are there already" in again.stdout


# Cut-outs

MOST_NOISE = 1.3
"""Ratios of cut-outs with 61 x 61 pixels, of which 9000 in the whole picture have their promise of 1.1."""

COMPARED = ("--vr180=96", "--samples", "16", "--no-denoise", "--interocular", "0.05", "--seed", "3", "--compare")


@pytest.fixture(scope="module")
def compared(tmp_path_factory):
    """The Cornell box from within."""
    folder = tmp_path_factory.mktemp("compared")
    scene = open_blend(DEMO)
    scene.camera.location = (0.0, -0.5, 1.2)
    return render(save(scene, folder / "box.blend"), folder / "out", *COMPARED)


def test_a_comparison_has_figures_for_each_cutout(compared):
    rows = compared.report["compare"]["cutouts"]
    turned = {row["name"]: (row["left_degrees"], row["up_degrees"]) for row in rows}
    assert turned == {"front": (0, 0), "left": (45, 0), "right": (-45, 0), "up": (0, 45), "down": (0, -45)}
    # A pixel is 180° / 96, and the middle of 90° in perspective has two radians of that.
    assert {row["size"] for row in rows} == {round(2.0 * 96 / np.pi)}
    for row in rows:
        assert row["noise_ratio"] < MOST_NOISE
        assert row["honest_ratio"] < MOST_NOISE
        assert row["flip_ratio"] == pytest.approx(row["flip"] / row["noise_flip"])
        said = (f"{row[key]:.3f}" for key in ("honest_ratio", "noise_ratio", "flip_ratio"))
        title = f"{row['name']} 45" if row["name"] != "front" else "front"
        assert re.search(rf"^ +{title} +{' +'.join(said)}$", compared.out, re.MULTILINE), compared.out


def test_the_sheet_shows_both_eyes_and_the_holes(compared):
    """The box stands in front, where the eyes differ; five pictures lie beside each other."""
    sheet = np.rint(255.0 * read_png(compared.folder / "cutouts.png"))
    assert sheet.shape[1] == 5 * LEAST + 4 * GAP_PX
    holes = (sheet == COLOURS[Reason.DISOCCLUDED]).all(axis=-1) | (sheet == COLOURS[Reason.SILHOUETTE]).all(axis=-1)
    y, x = np.nonzero(holes)
    pictures = y < y.max() - LEAST // 4
    assert pictures.any()
    # Ahead: in the middle of the first, and at the edges of those that are turned.
    assert ((x[pictures] > 0.25 * LEAST) & (x[pictures] < 0.75 * LEAST)).any()


def test_a_plain_pair_has_no_cutouts_and_removes_those_of_an_earlier_one(tmp_path):
    folder = tmp_path / "out"
    assert "cutouts.png" in render(DEMO, folder, "--vr180=32", *OPTIONS).files
    run = render(DEMO, folder, "--size", "32x18", "--compare", *OPTIONS)
    assert (run.status, run.files) == (0, sorted([*FILES, "difference.png"]))
    assert "cutouts.png" not in run.out
    assert "cutouts" not in run.report["compare"]


# Bad input


def within(**lens):
    """The Cornell box from within, by a camera whose lens and stereo settings have these values."""
    scene = open_blend(DEMO)
    scene.camera.location = (0.0, -0.5, 1.2)
    data = scene.camera.data
    for name, value in lens.items():
        setattr(data.stereo if hasattr(data.stereo, name) else data, name, value)
    return scene


@pytest.mark.parametrize("options", [("--size", "64x64"), ("--vr180=64",), ("--vr360=64", "--strict")])
def test_limits_of_a_pole_merge_that_cross_are_one_line(tmp_path, options):
    """By whichever option: of a pair that is not rendered nothing else is said."""
    merge = {"pole_merge_angle_from": 1.2, "pole_merge_angle_to": 0.9}
    lens = {"type": "PANO", "panorama_type": "EQUIRECTANGULAR"}
    scene = within(**lens, use_spherical_stereo=True, use_pole_merge=True, **merge)
    options = (*OPTIONS, "--mode", "off-axis", *options)
    run = render(save(scene, tmp_path / "box.blend"), tmp_path / "out", *options)
    assert (run.status, run.out, run.err.count("\n")) == (2, "", 1)
    assert "the pole merge of the camera starts at 68.8° and ends at 51.6°: set its end above its start" in run.err
    assert not run.folder.exists()


def test_limits_that_cross_are_no_matter_where_the_lens_is_ours(tmp_path):
    scene = within(pole_merge_angle_from=1.2, pole_merge_angle_to=0.9, use_pole_merge=True)
    run = render(save(scene, tmp_path / "box.blend"), tmp_path / "out", "--vr180=32", *OPTIONS)
    assert (run.status, run.err) == (0, "")


def test_eyes_wider_apart_than_the_nearest_thing_are_one_warning(tmp_path):
    blend = save(within(), tmp_path / "box.blend")
    run = render(blend, tmp_path / "out", "--vr180=32", *OPTIONS, "--interocular", "1.2")
    assert (run.status, run.err.count("\n")) == (0, 1)
    (warning,) = run.report["warnings"]
    assert "of the picture shows what is nearer to the camera than its interocular distance" in warning
    assert warning in run.err


def test_a_crop_of_a_fisheye_is_as_good_as_rendered_and_one_warning(tmp_path):
    scene = within(type="PANO", panorama_type="FISHEYE_EQUIDISTANT", fisheye_fov=np.pi)
    set_border(scene, (0.25, 0.75, 0.125, 1.0))
    scene.render.use_crop_to_border = True
    options = ("--size=96x96", "--samples=16", "--no-denoise", "--interocular=0.05", "--seed=3", "--compare")
    run = render(save(scene, tmp_path / "box.blend"), tmp_path / "out", *options)
    assert (run.status, run.err, run.report["size"]) == (0, "", [48, 84])
    assert run.report["compare"]["honest_ratio"] < MOST_NOISE
    scene.render.use_crop_to_border = False
    run = render(save(scene, tmp_path / "box.blend"), tmp_path / "whole", "--size=32x32", *OPTIONS)
    assert (run.status, run.err.count("\n")) == (0, 1)
    assert "frames are cropped to the Render Region" in run.err
