"""Quilts, contact sheets and sweeps: each view is in its place, in the scene's own colours, and the scene stays as it
was."""

import subprocess

import imageio_ffmpeg
import numpy as np
import pytest

from stereo_reproject.blender.output.delivery import deliver_side_by_side
from stereo_reproject.blender.output.pictures import read_png
from stereo_reproject.blender.output.quilt_files import (
    GAP_PX,
    display_pixels,
    write_contact_sheet,
    write_quilt,
    write_sweep,
)
from stereo_reproject.delivery.quilts import assemble_quilt
from stereo_reproject.images.exr import read_channels
from stereo_reproject.settings.views import view_names
from tests.blender.snapshot import everything
from tests.blender.toolbox import add_camera, add_compositor, empty_scene

WIDTH, HEIGHT = 120, 90

ROUNDING = 1.01 / 255.0
"""A PNG of 8 bits: a value may fall on either side of a step."""

HALF = 1e-3
"""Relative error of a half float, with room."""

CODEC = 0.06
"""A lossy codec's error in flat colours, in the mean over a picture; neighbouring views differ by more."""


@pytest.fixture
def scene():
    """Its colours are graded, and its exposure is another one at every frame. Dithering is off: it is random."""
    scene = empty_scene(WIDTH, HEIGHT)
    add_camera(scene)
    scene.render.dither_intensity = 0.0
    scene.view_settings.view_transform = "Standard"
    for frame, exposure in ((1, 1.0), (100, -3.0)):
        scene.view_settings.exposure = exposure
        scene.keyframe_insert("view_settings.exposure", frame=frame)
    scene.frame_set(1)
    return scene


def views(count):
    """Views as grey as their number says, red at the top and green at the right, transparent at the left."""
    made = []
    for k in range(count):
        view = np.full((HEIGHT, WIDTH, 4), 0.4 * k / max(count - 1, 1), np.float32)
        view[: HEIGHT // 4, :, 0] = 0.45
        view[:, -WIDTH // 4 :, 1] = 0.45
        view[..., 3] = 1.0
        view[:, : WIDTH // 6] *= 0.5
        made.append(view)
    return made


def opaque(pictures):
    return [np.concatenate([picture[..., :3], np.ones_like(picture[..., 3:])], axis=2) for picture in pictures]


def by_pairs(scene, pictures, folder):
    """The views as bytes' values from 0 to 1 as a pair's picture has them."""
    shown = []
    for picture in opaque(pictures):
        deliver_side_by_side(scene, {"left": picture, "right": picture}, folder / "pair.png")
        shown.append(np.split(read_png(folder / "pair.png"), 2, axis=1)[0])
    return shown


def test_a_quilt_looks_as_pairs_do(scene, tmp_path):
    pictures = views(5)
    before = everything()
    write_quilt(scene, pictures, 3, 2, tmp_path / "quilt.png", metadata={"Frame": "7"})
    assert everything() == before
    assert [path.name for path in tmp_path.iterdir()] == ["quilt.png"]
    assert b"Frame\0\0\0\0\x007" in (tmp_path / "quilt.png").read_bytes()
    expected = assemble_quilt(by_pairs(scene, pictures, tmp_path), 3, 2)
    assert expected.max() > 0.8, "its exposure counts"
    np.testing.assert_allclose(read_png(tmp_path / "quilt.png"), expected, atol=ROUNDING)


def test_a_quilt_has_the_colours_of_its_frame(scene, tmp_path):
    dark, bright = tmp_path / "dark.png", tmp_path / "bright.png"
    write_quilt(scene, views(2), 2, 1, bright)
    write_quilt(scene, views(2), 2, 1, dark, frame=100)
    assert read_png(dark).mean() < 0.5 * read_png(bright).mean()
    assert scene.frame_current == 1


def test_an_exr_quilt_is_scene_linear_and_keeps_alpha(scene, tmp_path):
    pictures = views(5)
    pictures[2][0, 0] = (1e9, np.nan, -0.25, 1.0)
    write_quilt(scene, pictures, 3, 2, tmp_path / "quilt.exr", metadata={"frame": "7"})
    stored = read_channels(tmp_path / "quilt.exr")
    quilt = np.stack([stored[letter] for letter in "RGBA"], axis=-1)
    pictures[2][0, 0] = (65504.0, 0.0, -0.25, 1.0)
    np.testing.assert_allclose(quilt, assemble_quilt(pictures, 3, 2), rtol=HALF, atol=1e-6)


def test_the_compositor_of_the_scene_is_left_alone(scene, tmp_path):
    tree, _, output = add_compositor(scene)
    value = tree.nodes.new("ShaderNodeValue")
    tree.links.new(value.outputs[0], output)
    before = everything()
    write_quilt(scene, views(2), 2, 1, tmp_path / "quilt.png")
    assert everything() == before
    expected = assemble_quilt(by_pairs(scene, views(2), tmp_path), 2, 1)
    np.testing.assert_allclose(read_png(tmp_path / "quilt.png"), expected, atol=ROUNDING)


def test_a_contact_sheet_has_the_views_in_their_order_from_the_top_left(scene, tmp_path):
    pictures = views(5)
    before = everything()
    write_contact_sheet(scene, pictures, view_names(5), tmp_path / "contact.png")
    assert everything() == before
    assert [path.name for path in tmp_path.iterdir()] == ["contact.png"]
    sheet = read_png(tmp_path / "contact.png")
    step_y = sheet.shape[0] // 2
    assert sheet.shape[1] == 3 * (WIDTH + GAP_PX) - GAP_PX
    for k, expected in enumerate(by_pairs(scene, pictures, tmp_path)):
        row, column = divmod(k, 3)
        bottom, x = (row + 1) * step_y - GAP_PX, column * (WIDTH + GAP_PX)
        np.testing.assert_allclose(sheet[bottom - HEIGHT : bottom, x : x + WIDTH], expected, atol=ROUNDING)
        name = sheet[row * step_y : bottom - HEIGHT, x : x + WIDTH]
        assert name.max() > 0.8, "its name is there"
    assert sheet[step_y:, -WIDTH:].max() < 0.15, "there is no sixth view"


def test_pixels_that_are_not_square_are_shown_as_wide_as_they_are(scene, tmp_path):
    for aspect, shape in ((2.0, (60, 120)), (0.5, (90, 45))):
        with display_pixels(scene, aspect, (WIDTH, HEIGHT)):
            write_contact_sheet(scene, views(2), view_names(2), tmp_path / "contact.png")
        sheet = read_png(tmp_path / "contact.png")
        assert sheet.shape[1] == 2 * (shape[1] + GAP_PX) - GAP_PX
        assert np.argmax(sheet[::-1, -shape[1] // 2].max(axis=-1) > 0.15) == GAP_PX
        top = sheet.shape[0] - GAP_PX - shape[0]
        red = sheet[top : top + shape[0], shape[1] // 2]
        assert np.mean(red[:, 0] > red[:, 1] + 0.1) == pytest.approx(0.25, abs=0.03)


@pytest.mark.parametrize(
    ("aspect", "size", "pixels"),
    [
        (None, (8, 4), (3.0, 1.0)),
        (2.0, (8, 4), (1.0, 1.0)),
        (4.0, (8, 4), (2.0, 1.0)),
        (1.0, (8, 4), (1.0, 2.0)),
        (1.0, None, (1.0, WIDTH / HEIGHT)),
    ],
)
def test_a_view_is_as_wide_as_its_display(scene, aspect, size, pixels):
    scene.render.pixel_aspect_x = 3.0
    before = everything()
    with display_pixels(scene, aspect, size):
        assert (scene.render.pixel_aspect_x, scene.render.pixel_aspect_y) == pytest.approx(pixels)
    assert everything() == before


def frames_of(movie, width, height):
    """The frames of a movie, (frames, height, width, 3) from 0 to 1, and its frames per second."""
    reader = imageio_ffmpeg.read_frames(str(movie))
    about = next(reader)
    reader.close()
    command = [
        imageio_ffmpeg.get_ffmpeg_exe(),
        "-v",
        "error",
        "-i",
        str(movie),
        "-f",
        "rawvideo",
        "-pix_fmt",
        "rgb24",
        "-",
    ]
    raw = subprocess.run(command, check=True, capture_output=True).stdout
    assert tuple(about["source_size"]) == (width, height)
    return np.frombuffer(raw, np.uint8).reshape(-1, height, width, 3) / 255.0, about["fps"]


@pytest.mark.parametrize("count", [2, 5])
def test_a_sweep_goes_to_the_right_and_back_without_a_step(scene, tmp_path, count):
    pictures = [np.ascontiguousarray(view[:-1]) for view in views(count)]
    before = everything()
    write_sweep(scene, pictures, tmp_path / "sweep.mp4")
    assert everything() == before
    assert [path.name for path in tmp_path.iterdir()] == ["sweep.mp4"]
    frames, rate = frames_of(tmp_path / "sweep.mp4", WIDTH, HEIGHT - 2)
    assert 9.0 < len(frames) / rate < 20.0
    shown = by_pairs(scene, views(count), tmp_path)
    greys = np.array([view[HEIGHT // 2, WIDTH // 2].mean() for view in shown])
    seen = frames[:, HEIGHT // 2 - 4 : HEIGHT // 2 + 4, WIDTH // 2 - 4 : WIDTH // 2 + 4].mean(axis=(1, 2, 3))
    which = np.abs(seen[:, None] - greys).argmin(axis=1)
    np.testing.assert_allclose(seen, greys[which], atol=CODEC)
    steps = which[np.r_[True, np.diff(which) != 0]]
    there = [*range(count), *range(count - 2, 0, -1)]
    assert list(steps) == (there * 9)[: len(steps)]
    assert len(steps) > len(there)
