"""A pair, end to end within this process: as good as rendering both eyes, and whole for scenes of every kind."""

import math
from pathlib import Path

import bpy
import numpy as np
import OpenEXR
import pytest

from stereo_reproject.blender.commands.frame import render_files
from stereo_reproject.blender.output.pictures import COLOURS, read_png
from stereo_reproject.images.exr import write_table
from stereo_reproject.images.masks import dilate
from stereo_reproject.images.passes import COLOUR_PASS, DEPTH_PASS
from stereo_reproject.images.reasons import Reason
from stereo_reproject.jobs.work_folder import CUTOUTS, pair_files, with_cutouts
from stereo_reproject.settings.frame import ACCURACIES, SceneOverrides, StereoSettings
from tests.blender.toolbox import (
    Material,
    add_camera,
    add_cube,
    add_plane,
    add_sphere,
    add_sun,
    diffuse,
    emission,
    empty_scene,
    render_plain,
    rms,
    save_image,
    set_background,
    set_border,
)
from tests.render.hard_scenes import smoke

WIDTH, HEIGHT, SAMPLES = 128, 72, 32

AS_GOOD = 1.2
"""rms(ours - a) / rms(b - a). All noise is that of some hundred pixels on edges: two seeds give up to 1.1, and drafts
leave some edges warped."""

SOFTENED = 2.0
"""The same where a lookup between pixels softens edges that are no silhouettes and that no light's noise hides: between
the floor and the wall where rows don't match, and everywhere in an orthographic pair that has no parallax at all."""

DEPTH = 2e-3
"""Relative. A depth is interpolated between source pixels: exact on planes, on the ball the height of an arc."""

RIGHT_DEPTH = 0.97
"""Share of target pixels whose depth is that: the others lie on edges, where a centre falls on either side."""


SINGLE_PRECISION = 1e-5
"""What is left of an identity after some steps of single precision, for values around 1 and depths around 10."""


def waves(folder, name, phase):
    """A picture of slow waves of colour: what bilinear interpolation changes in it is less than the noise."""
    y, x = np.mgrid[0:64, 0:64] / 64
    values = np.ones((64, 64, 4), np.float32)
    for c in range(3):
        values[..., c] = 0.5 + 0.4 * np.sin(2 * np.pi * (x * (1 + (c + phase) % 2) + y * ((c + phase) % 3)) + c + phase)
    return save_image(folder / f"{name}.png", values)


@pytest.fixture
def scene(tmp_path):
    return build(tmp_path)


def build(tmp_path):
    """Shining by itself: a floor, a wall, a box and a ball."""
    scene = empty_scene(WIDTH, HEIGHT, samples=SAMPLES)
    scene.cycles.sampling_pattern = "TABULATED_SOBOL"
    floor = add_plane(scene, emission(image=waves(tmp_path, "floor", 0)), size=(14, 14), location=(0, -1.2, -6))
    floor.rotation_euler.x = -math.pi / 2
    add_plane(scene, emission(image=waves(tmp_path, "wall", 1)), size=(24, 14), location=(0, 2, -10)).name = "Wall"
    add_cube(scene, emission(colour=(0.2, 0.6, 0.3)), size=1.2, location=(-1.0, -0.3, -5))
    add_sphere(scene, emission(colour=(0.9, 0.5, 0.3)), radius=0.6, location=(1.1, 0.0, -4.5)).name = "Ball"
    add_camera(scene)
    return scene


def render_pair(scene, folder, /, **settings):
    """The report and both eyes as they stand in the files: channels by name."""
    work = folder / "work"
    work.mkdir()
    report, files = render_files(scene, StereoSettings(**settings), work)
    names = pair_files(compare=settings.get("compare", False))
    expected = set(with_cutouts(names, cutouts=scene.camera.data.type == "PANO" and CUTOUTS in files))
    assert set(files) == expected
    assert {path.name for path in (work / "out").iterdir()} == expected
    return report, {view: channels_of(work / "out" / f"{view}.exr") for view in ("left", "right")}


def channels_of(path: Path):
    with OpenEXR.File(str(path), separate_channels=True) as file:
        return {name: np.array(channel.pixels) for name, channel in file.channels().items()}


def rgb(channels):
    return np.stack([channels[letter] for letter in "RGB"], axis=-1)


# Quality


def pivot_right(scene):
    scene.camera.data.stereo.pivot = "RIGHT"


def toe_in(scene):
    scene.camera.data.stereo.convergence_mode = "TOE"


def parallel(scene):
    scene.camera.data.stereo.convergence_mode = "PARALLEL"


def pivot_in_the_centre(scene):
    scene.camera.data.stereo.pivot = "CENTER"


def as_it_is(scene):
    pass


def lens_shift(scene):
    scene.camera.data.shift_x, scene.camera.data.shift_y = 0.1, 0.05


def border(scene):
    set_border(scene, (0.2, 0.85, 0.1, 0.95))
    scene.render.use_crop_to_border = True


def wide_pixels(scene):
    scene.render.pixel_aspect_x = 1.5


def orthographic(scene):
    scene.camera.data.type, scene.camera.data.ortho_scale = "ORTHO", 5.0


def orthographic_toe_in(scene):
    orthographic(scene)
    toe_in(scene)


VARIANTS = [
    (as_it_is, {"fill": "packed"}),
    (as_it_is, {"fill": "packed", "packed_by": "portal"}),
    (as_it_is, {"fill": "card"}),
    (as_it_is, {"fill": "full"}),
    (as_it_is, {"fill": "packed", "interpolation": "cubic"}),
    (as_it_is, {"fill": "packed", "grid_threshold": 0.0}),
    (as_it_is, {"fill": "packed", "source": "right"}),
    (pivot_right, {"fill": "card", "source": "right"}),
    (toe_in, {"fill": "packed"}),
    (parallel, {"fill": "packed"}),
    (pivot_in_the_centre, {"fill": "packed"}),
    (lens_shift, {"fill": "packed"}),
    (border, {"fill": "packed"}),
    (wide_pixels, {"fill": "card"}),
    (orthographic, {"fill": "card"}),
    (orthographic, {"fill": "packed"}),
    (orthographic_toe_in, {"fill": "card"}),
    *((as_it_is, {"fill": "packed", "accuracy": accuracy}) for accuracy in ACCURACIES if accuracy != "balanced"),
]


def label(value):
    return value.__name__ if callable(value) else "-".join(map(str, value.values()))


@pytest.fixture(scope="module", params=VARIANTS, ids=lambda variant: f"{label(variant[0])}-{label(variant[1])}")
def case(request, tmp_path_factory):
    """A variant's name and settings, its report and eyes, and two plain renders of it."""
    change, settings = request.param
    folder = tmp_path_factory.mktemp("case")
    scene = build(folder)
    change(scene)
    report, eyes = render_pair(scene, folder, **settings)
    a, b = (render_plain(scene, folder, seed=seed) for seed in (101, 102))
    return change, settings, report, eyes, a, b


def eyes_of(settings):
    source = settings.get("source", "left")
    return source, "right" if source == "left" else "left"


def test_a_pair_is_as_good_as_two_renders(case):
    change, settings, report, eyes, a, b = case
    _, target = eyes_of(settings)
    assert report["fill"]["method"] == settings["fill"]
    assert (report["fractions"]["rerendered"] == 1.0) == (settings["fill"] == "full")
    a, b = (passes[target][COLOUR_PASS][..., :3] for passes in (a, b))
    limit = SOFTENED if change in (toe_in, orthographic) else AS_GOOD
    assert rms(rgb(eyes[target]) - a) < limit * rms(b - a)


def test_depth_is_the_depth_of_each_eye(case):
    _, settings, _, eyes, a, _ = case
    source, target = eyes_of(settings)
    np.testing.assert_array_equal(eyes[source]["Depth.Z"], a[source][DEPTH_PASS][..., 0])
    true = a[target][DEPTH_PASS][..., 0]
    assert np.mean(np.abs(eyes[target]["Depth.Z"] - true) <= DEPTH * true) > RIGHT_DEPTH


@pytest.mark.parametrize("mode", ["off-axis", "parallel", "toe-in"])
@pytest.mark.parametrize("fill", ["auto", "packed", "card"])
def test_no_distance_between_the_eyes(tmp_path, fill, mode):
    """Two equal eyes and no hole: nothing is looked up between pixels, nothing is traced."""
    scene = build(tmp_path)
    overrides = SceneOverrides(interocular_distance=0.0, convergence_mode=mode)
    report, eyes = render_pair(scene, tmp_path, fill=fill, scene=overrides)
    assert set(report["fractions"].values()) == {0.0}
    assert set(eyes["left"]) == set(eyes["right"])
    for name, values in eyes["left"].items():
        np.testing.assert_allclose(eyes["right"][name], values, rtol=SINGLE_PRECISION, atol=SINGLE_PRECISION)


def test_equal_eyes_stay_equal_with_smoke_before_the_sky(tmp_path):
    scene = build(tmp_path)
    bpy.data.objects.remove(scene.objects["Wall"])
    add_cube(scene, smoke(), size=1.5, location=(0.0, 1.0, -5.0))
    report, eyes = render_pair(scene, tmp_path, fill="packed", scene=SceneOverrides(interocular_distance=0.0))
    assert report["fractions"]["rerendered"] == 0.0
    np.testing.assert_array_equal(rgb(eyes["left"]), rgb(eyes["right"]))


COINCIDENCE = 0.8
"""What is far below 1 is not two pictures with noise of their own, but one noise that was seen twice."""


@pytest.mark.parametrize("source", ["left", "right"])
def test_the_peer_has_noise_of_its_own(tmp_path, source):
    """A lit wall at the distance of convergence shows both eyes the same: only noise differs."""
    scene = empty_scene(64, 36, samples=4)
    add_plane(scene, diffuse(), size=(30, 20), location=(0, 0, -6))
    add_cube(scene, diffuse(), size=3.0, location=(4.0, 0.0, -4.0))
    set_background(scene, 1.0)
    add_camera(scene, convergence=6.0)
    report, _ = render_pair(scene, tmp_path, source=source, compare=True, fill="packed")
    assert report["compare"]["noise_ratio"] > COINCIDENCE


# The pictures that explain a frame


def test_holes_are_shown_in_the_colours_of_their_reasons(scene, tmp_path):
    report, _ = render_pair(scene, tmp_path, fill="packed")
    picture = np.rint(read_png(tmp_path / "work" / "out" / "holes.png")[:HEIGHT, :WIDTH] * 255)
    shares = {reason: np.mean(np.all(picture == colour, axis=-1)) for reason, colour in COLOURS.items()}
    fractions = report["fractions"]
    # A pixel with several reasons shows the first of them.
    assert shares[Reason.DISOCCLUDED] == pytest.approx(fractions["disoccluded"])
    assert shares[Reason.OUTSIDE] == pytest.approx(fractions["outside"])
    assert sum(shares.values()) == pytest.approx(fractions["rerendered"])


def test_the_grid_is_drawn_over_the_source_with_a_legend_below(scene, tmp_path):
    render_pair(scene, tmp_path)
    height, width = read_png(tmp_path / "work" / "out" / "grid.png").shape[:2]
    scale, rest = divmod(width, WIDTH)
    assert (scale >= 1, rest) == (True, 0)
    assert scale * HEIGHT < height < scale * HEIGHT + 200


# Scenes of every kind


def black(scene):
    for item in scene.objects:
        if item.type == "MESH":
            item.data.materials[0] = diffuse("unlit").block


def sky_alone(scene):
    for item in list(scene.objects):
        if item.type == "MESH":
            bpy.data.objects.remove(item)
    set_background(scene, 1.0)


def nothing_on_transparent_film(scene):
    sky_alone(scene)
    scene.render.film_transparent = True


def eyes_too_far_apart(scene):
    """No target pixel shows what the source has seen."""
    scene.camera.data.stereo.convergence_mode = "PARALLEL"
    scene.camera.data.stereo.interocular_distance = 100.0


def nose_to_the_wall(scene):
    scene.objects["Wall"].location.z = -0.2


def everything_behind(scene):
    scene.camera.rotation_euler.y = math.pi


def in_fog(scene):
    fog = Material("fog")
    fog.link(fog.node("VolumeScatter", Density=0.3).outputs[0], fog.output.inputs["Volume"])
    add_cube(scene, fog, size=30.0, location=(0, 0, 0))
    add_sun(scene)


def defocused_and_moving(scene):
    scene.camera.data.dof.use_dof, scene.camera.data.dof.aperture_fstop = True, 0.1
    scene.camera.data.dof.focus_distance = 4.5
    scene.render.use_motion_blur = True


def clipped(scene):
    scene.camera.data.clip_start, scene.camera.data.clip_end = 4.8, 9.0


def denoised_with_passes(scene):
    layer = scene.view_layers[0]
    layer.cycles.use_denoising = scene.cycles.use_denoising = True
    layer.cycles.denoising_store_passes = True
    for name in ("normal", "vector", "uv", "mist", "position", "object_index", "diffuse_color", "emit", "shadow"):
        if hasattr(layer, f"use_pass_{name}"):
            setattr(layer, f"use_pass_{name}", True)
    layer.use_pass_cryptomatte_object = True


def layer_with_an_awkward_name(scene):
    scene.view_layers[0].name = "Räume.left.R v1"


def two_layers(scene):
    scene.view_layers.new("Other")


def a_camera_that_is_hidden(scene):
    scene.camera.hide_render = scene.camera.hide_viewport = True


def stereo_off(scene):
    scene.render.use_multiview = False


def custom_views(scene):
    scene.render.views_format = "MULTIVIEW"
    scene.render.views.new("middle")
    scene.render.views["left"].file_suffix = "_links"


SCENES = [
    black,
    sky_alone,
    nothing_on_transparent_film,
    eyes_too_far_apart,
    nose_to_the_wall,
    everything_behind,
    in_fog,
    defocused_and_moving,
    clipped,
    denoised_with_passes,
    layer_with_an_awkward_name,
    two_layers,
    a_camera_that_is_hidden,
    stereo_off,
    custom_views,
]


@pytest.mark.parametrize("change", SCENES)
def test_a_scene_of_another_kind(scene, tmp_path, change):
    scene.cycles.samples = 2
    change(scene)
    _, eyes = render_pair(scene, tmp_path, compare=True, scene=SceneOverrides(size=(64, 36)))
    assert set(eyes["left"]) >= set(eyes["right"]) >= {"R", "G", "B", "A", "Depth.Z"}
    for channels in eyes.values():
        assert all(np.isfinite(values).all() for name, values in channels.items() if name != "Depth.Z")
        assert not np.isnan(channels["Depth.Z"]).any()


def test_what_the_source_has_not_seen_is_outside(scene, tmp_path):
    eyes_too_far_apart(scene)
    report, _ = render_pair(scene, tmp_path, scene=SceneOverrides(size=(32, 18), samples=1))
    assert (report["fractions"]["outside"], report["fractions"]["disoccluded"]) == (1.0, 0.0)


@pytest.mark.parametrize("size", [(4, 4), (5, 7), (16, 17), (17, 16), (64, 4), (4, 64)])
def test_a_picture_of_any_size(scene, tmp_path, size):
    report, eyes = render_pair(scene, tmp_path, compare=True, scene=SceneOverrides(size=size, samples=1))
    assert report["size"] == list(size)
    assert {channels["R"].shape for channels in eyes.values()} == {size[::-1]}


ORDINARY = 2.0
"""Twice the colour of anything in the scene that has a number for one."""


def beyond_all_numbers(scene, folder):
    """The wall shines so brightly, in its middle, that the sum over the samples is infinite."""
    values = np.full((32, 32, 4), 0.5, np.float32)
    values[12:16, 12:20, :3] = 1e38
    write_table(folder / "bright.exr", values)
    image = bpy.data.images.load(str(folder / "bright.exr"))
    image.colorspace_settings.name = "Non-Color"
    scene.objects["Wall"].data.materials[0] = emission("bright", image=image).block


def test_the_comparison_stands_infinities(scene, tmp_path):
    """A measurement that one pixel can spoil measures nothing."""
    beyond_all_numbers(scene, tmp_path)
    report, _ = render_pair(scene, tmp_path, compare=True)
    assert all(math.isfinite(value) for value in report["compare"].values())


@pytest.mark.parametrize("fill", ["packed", "card"])
def test_infinities_are_contained(scene, tmp_path, fill):
    beyond_all_numbers(scene, tmp_path)
    a, b = (render_plain(scene, tmp_path, seed=seed) for seed in (101, 102))
    infinite = ~np.isfinite(a["right"][COLOUR_PASS]).all(axis=-1)
    assert 0.001 < infinite.mean() < 0.2
    report, eyes = render_pair(scene, tmp_path, fill=fill)
    assert report["fractions"]["invalid"] > 0.0
    assert any("no numbers" in warning for warning in report["warnings"])
    for channels in eyes.values():
        assert all(np.isfinite(values).all() for values in channels.values())
    a, b = (passes["right"][COLOUR_PASS][..., :3] for passes in (a, b))
    # Beside the infinite there are finite numbers of any size, which a lookup between pixels mixes in.
    sane = ~dilate(~(np.maximum(a, b).max(axis=-1) < ORDINARY), 2)
    assert sane.mean() > 0.7
    assert rms(rgb(eyes["right"])[sane] - a[sane]) < AS_GOOD * rms(b[sane] - a[sane])
