"""A flat mirror's image is a world of its own behind it: held against a ray caster that looks through the mirror."""

from dataclasses import replace

import numpy as np
import pytest

from stereo_reproject.holes.classifier import Optics
from stereo_reproject.holes.reprojection import reproject
from stereo_reproject.images.effects import Effect
from stereo_reproject.images.passes import (
    COLOUR_PASS,
    DEPTH_PASS,
    EFFECTS_PASS,
    LENGTH_PASS,
    MATERIAL_PASS,
    REFLECTANCE_PASS,
    ROUGHNESS_PASS,
    SOURCE_ONLY_PASSES,
    SURFACE_NORMAL_PASS,
)
from stereo_reproject.settings.accuracy import SETTINGS
from stereo_reproject.views.frustum import Lens
from stereo_reproject.views.view import View
from stereo_reproject.warp.mirrors import images_in_mirrors
from stereo_reproject.warp.options import WarpOptions
from stereo_reproject.warp.rendered_view import RenderedView
from stereo_reproject.warp.tuning import TUNING as WARP_TUNING
from tests.warp.analytic import Plane, Sphere, World, pixel_centres, stereo_rig, world_rays
from tests.warp.pairs import reproject_pair

SIZE = (160, 90)
CLIP = 0.1
MIRROR = 1
WALL, IMAGE = 3.0, 5.0
"""Depths of a wall with a mirror in it, and of what the mirror shows, as far behind it as that is before it."""

CUBIC_WITHIN = 0.1
"""Share of the variance by which cubic lookups of noise may be off: they are held within the range of their pixels."""

FRAME = World((Plane((0.0, 0.0, -WALL)),))
SHOWN = World((Plane((0.0, 0.0, -IMAGE)),), waves=np.random.default_rng(3).normal(size=(3, 3)))


def rig(**how):
    return stereo_rig(SIZE, **{"ipd": 0.15, "convergence": 3.5, **how})


def glass(eye):
    """(H, W): where the wall has its mirror."""
    x, y = pixel_centres(eye)
    plane = eye.plane
    place = WALL * (plane.left + (plane.right - plane.left) * x / eye.width) + eye.world_from_camera[0, 3]
    up = WALL * (plane.top + (plane.bottom - plane.top) * y / eye.height)
    return (np.abs(place) < 0.7) & (np.abs(up) < 0.4)


def slant(eye):
    x, y = pixel_centres(eye)
    _, ray = eye.ray_from_px(x, y)
    return np.sqrt(sum(np.square(part) for part in ray))


def seen(eye, *, reflectance=1.0, image=IMAGE):
    """What a renderer gives of the wall and its mirror."""
    wall, shown = FRAME.render(eye), SHOWN.render(eye)
    mirror = glass(eye)[..., None]
    with np.errstate(invalid="ignore"):
        farther = np.where(np.isfinite(image), reflectance * (image - WALL), 0.0) * mirror
    length = (WALL + farther) * slant(eye)[..., None] - CLIP * slant(eye)[..., None]
    return {
        SURFACE_NORMAL_PASS: np.broadcast_to(np.float32((0.0, 0.0, 1.0)), (*mirror.shape[:2], 3)).copy(),
        ROUGHNESS_PASS: np.zeros(mirror.shape, np.float32),
        EFFECTS_PASS: np.where(mirror, Effect.GLOSSY.value, 0).astype(np.float32),
        COLOUR_PASS: np.where(mirror, shown[COLOUR_PASS], wall[COLOUR_PASS]),
        DEPTH_PASS: wall[DEPTH_PASS],
        LENGTH_PASS: length.astype(np.float32),
        REFLECTANCE_PASS: np.where(mirror, reflectance, 0.04).repeat(3, axis=-1).astype(np.float32),
        MATERIAL_PASS: np.where(mirror, MIRROR, 0).astype(np.float32),
        "Index": np.where(mirror, 5.0, 7.0).astype(np.float32),
    }


def images(source, eye):
    return images_in_mirrors(source, eye, clip_start=CLIP)


def without(source, name):
    return {key: image for key, image in source.items() if key != name}


def carried(source, eyes, view="left", **how):
    other = {"left": "right", "right": "left"}[view]
    nothing = np.zeros(SIZE[::-1], bool)
    return reproject_pair(source, eyes[view], eyes[other], accuracy=SETTINGS["balanced"], invalid=nothing, **how)


@pytest.mark.parametrize("reflectance", [1.0, 0.4])
def test_the_image_stands_as_far_behind_as_its_rays_go_on(reflectance):
    eye = rig()["left"]
    found = images(seen(eye, reflectance=reflectance), eye)
    np.testing.assert_array_equal(found.mirrors, glass(eye))
    np.testing.assert_allclose(found.depth, np.where(glass(eye), IMAGE, WALL), rtol=1e-5)


def test_a_part_of_a_mirror_that_shows_nothing_shows_the_sky():
    eye = rig()["left"]
    nothing = pixel_centres(eye)[0] < 70
    found = images(seen(eye, image=np.where(nothing, np.inf, IMAGE)[..., None]), eye)
    assert np.all(np.isposinf(found.depth[glass(eye) & nothing]))
    assert np.all(np.isfinite(found.depth[~nothing]))


def test_what_all_but_touches_a_mirror_stands_right_behind_it():
    """As its foot on a polished table does: it is not the sky."""
    eye = rig()["left"]
    near = pixel_centres(eye)[0] < 70
    found = images(seen(eye, image=np.where(near, 1.03 * WALL, IMAGE)[..., None]), eye)
    np.testing.assert_allclose(found.depth[glass(eye) & near], 1.03 * WALL, rtol=1e-4)


@pytest.mark.parametrize("missing", [LENGTH_PASS, REFLECTANCE_PASS, SURFACE_NORMAL_PASS, MATERIAL_PASS])
def test_without_one_of_the_passes_no_mirror_is_known(missing):
    eye = rig()["left"]
    assert images(without(seen(eye), missing), eye) is None


def test_a_matte_wall_a_dull_mirror_and_a_tiny_one_are_none():
    eye = rig()["left"]
    source = seen(eye)
    assert images({**source, LENGTH_PASS: seen(eye, image=WALL)[LENGTH_PASS]}, eye) is None
    assert images(seen(eye, reflectance=0.1), eye) is None
    assert images({**source, ROUGHNESS_PASS: 0.0 * source[ROUGHNESS_PASS] + 0.2}, eye) is None
    glassy = np.float32(Effect.GLOSSY.value | Effect.TRANSMISSION.value)
    assert images({**source, EFFECTS_PASS: 0.0 * source[EFFECTS_PASS] + glassy}, eye) is None
    behind_by_little = {**source, LENGTH_PASS: seen(eye, image=1.08 * WALL)[LENGTH_PASS]}
    assert images(behind_by_little, eye) is None
    assert images(without(source, ROUGHNESS_PASS), eye) is not None
    few = np.zeros(SIZE[::-1], bool)
    side = int(np.sqrt(WARP_TUNING.least_mirror_share * few.size)) - 1
    few[40 : 40 + side, 80 : 80 + side] = True
    assert images({**source, MATERIAL_PASS: few[..., None].astype(np.float32)}, eye) is None


def normals_of_a_ball(eye, radius):
    """(H, W, 3) of one before the wall's middle, and where it is seen."""
    centre = np.array([0.0, 0.0, -WALL - radius])
    x, y = pixel_centres(eye)
    origin, direction = world_rays(eye, x, y)
    along = Sphere(tuple(centre), radius).depth_along(origin, direction)[..., None]
    with np.errstate(invalid="ignore"):
        normal = (origin + along * direction - centre) / radius
    hit = np.isfinite(along)
    return np.where(hit, normal, (0.0, 0.0, 1.0)).astype(np.float32), hit & glass(eye)[..., None]


@pytest.mark.parametrize("shows", [IMAGE, np.inf])
@pytest.mark.parametrize("radius", [0.5, 5.0])
def test_a_ball_has_its_image_elsewhere(radius, shows):
    """Also where it shows the sky beside what tells that it is a mirror; by its normals, however flat its faces are."""
    eye = rig()["left"]
    above = pixel_centres(eye)[1] < SIZE[1] // 2
    source = seen(eye, image=np.where(above, shows, IMAGE)[..., None])
    normal, ball = normals_of_a_ball(eye, radius)
    assert ball.sum() > 2 * WARP_TUNING.least_mirror_share * ball.size
    source = {**source, SURFACE_NORMAL_PASS: normal, MATERIAL_PASS: (MIRROR * ball).astype(np.float32)}
    assert images(source, eye) is None


def test_a_bumpy_mirror_stays_with_its_surface():
    eye = rig()["left"]
    source = seen(eye)
    bumps = 0.01 * np.random.default_rng(1).normal(size=(*SIZE[::-1], 3)).astype(np.float32)
    assert images({**source, SURFACE_NORMAL_PASS: source[SURFACE_NORMAL_PASS] + bumps}, eye) is None


def test_a_bevelled_edge_is_no_part_of_the_mirror():
    eye = rig()["left"]
    source = seen(eye)
    rows, columns = np.nonzero(glass(eye))
    inner = np.zeros(SIZE[::-1], bool)
    inner[rows.min() + 3 : rows.max() - 2, columns.min() + 3 : columns.max() - 2] = True
    bevel = glass(eye) & ~inner
    beside = bevel & (np.abs(pixel_centres(eye)[0] - columns.mean()) > inner.any(axis=0).sum() / 2)
    normal = np.where(bevel[..., None], (0.0, 0.6, 0.8), source[SURFACE_NORMAL_PASS])
    normal = np.where(beside[..., None], (0.6, 0.0, 0.8), normal).astype(np.float32)
    found = images({**source, SURFACE_NORMAL_PASS: normal}, eye)
    assert found.mirrors[inner].all()
    assert found.mirrors[bevel].mean() < 0.05


def test_two_mirrors_that_meet_do_not_show_each_other_s_image():
    """A folding one: what the one shows far away would be carried over into the other."""
    eyes = rig()
    other = pixel_centres(eyes["left"])[0] > 85
    source = seen(eyes["left"], image=np.where(other, 2.0 * IMAGE, IMAGE)[..., None])
    normal = np.where(other[..., None], (0.3, 0.0, 0.954), source[SURFACE_NORMAL_PASS]).astype(np.float32)
    colour = np.where(other[..., None], 0.1, 0.9) + 0.0 * source[COLOUR_PASS]
    source = {**source, SURFACE_NORMAL_PASS: normal, COLOUR_PASS: colour.astype(np.float32)}
    result = carried(source, eyes)
    kept = result.views[0].mirrors.shown & (result.reasons == 0)
    # Which of the two it is, its own normal tells, carried with the surface.
    index = carried({**source, "Index": other[..., None].astype(np.float32)}, eyes).passes["Index"][..., 0]
    shown = result.passes[COLOUR_PASS][..., 0]
    assert kept.sum() > 0.4 * glass(eyes["right"]).sum()
    np.testing.assert_allclose(shown[kept], np.where(index > 0.5, 0.1, 0.9)[kept], atol=0.05)


def test_beside_a_mirror_s_rim_all_is_traced():
    """There an image's depth is mixed with the frame's: alike as they may look, it is not known which is seen."""
    eyes = rig()
    source = seen(eyes["left"])
    alike = {**source, COLOUR_PASS: np.full_like(source[COLOUR_PASS], 0.5)}
    result = carried(alike, eyes)
    shown = result.views[0].mirrors.shown
    rim = shown & ~np.pad(shown, 1)[1:-1, :-2] | shown & ~np.pad(shown, 1)[1:-1, 2:]
    assert (result.reasons[rim] > 0).all()


@pytest.mark.parametrize("view", ["left", "right"])
@pytest.mark.parametrize("convergence", [3.5, 1e6])
def test_what_a_mirror_shows_is_carried_by_its_image(view, convergence):
    eyes = rig(convergence=convergence)
    other = {"left": "right", "right": "left"}[view]
    source = seen(eyes[view])
    by_image = carried(source, eyes, view)
    by_surface = carried({k: v for k, v in source.items() if k != LENGTH_PASS}, eyes, view)
    truth = seen(eyes[other])
    kept = by_image.views[0].mirrors.shown & (by_image.reasons == 0)
    assert kept.sum() > 0.6 * glass(eyes[other]).sum()
    errors = [np.abs(one.passes[COLOUR_PASS] - truth[COLOUR_PASS])[kept].mean() for one in (by_image, by_surface)]
    assert errors[0] < 0.1 * errors[1]


@pytest.mark.parametrize("view", ["left", "right"])
def test_a_single_sample_in_a_mirror_is_of_its_image(view):
    """It is of one source pixel, within half a pixel of what was looked up; by the surface, it is some pixels off."""
    eyes = rig()
    source = seen(eyes[view])
    result = carried(source, eyes, view)
    place = np.nonzero(result.views[0].mirrors.shown & (result.reasons == 0))
    sampled, looked_up = result.answered().sampled(place), result.passes[COLOUR_PASS][place]
    row = {tuple(colour) for colour in source[COLOUR_PASS].reshape(-1, sampled.shape[-1])}
    assert all(tuple(colour) in row for colour in sampled)
    at_surface = replace(result, views=(replace(result.views[0], mirrors=None),)).answered().sampled(place)
    errors = [np.abs(colours - looked_up)[..., :3].mean() for colours in (sampled, at_surface)]
    assert errors[0] < 0.3 * errors[1]


def test_a_mirror_keeps_its_own_depth_and_index():
    eyes = rig()
    result = carried(seen(eyes["left"]), eyes)
    kept = result.views[0].mirrors.shown & (result.reasons == 0)
    np.testing.assert_allclose(result.passes[DEPTH_PASS][kept], WALL, rtol=1e-5)
    np.testing.assert_array_equal(result.passes["Index"][kept], 5.0)
    assert not set(SOURCE_ONLY_PASSES) & set(result.passes)


def test_where_the_other_eye_looks_farther_around_a_mirror_s_edge_is_a_hole():
    """The image moves against its frame: on one side it comes out from behind it, where the source has nothing."""
    eyes = rig()
    result = carried(seen(eyes["left"]), eyes)
    mirror = glass(eyes["right"])
    row, columns = SIZE[1] // 2, np.nonzero(mirror[SIZE[1] // 2])[0]
    shift = round(0.15 * (1.0 / WALL - 1.0 / IMAGE) / (eyes["left"].plane.right - eyes["left"].plane.left) * SIZE[0])
    assert shift >= 3
    holes = result.reasons[row] > 0
    ends = holes[columns[1 : shift - 1]].all(), holes[columns[-shift + 1 : -1]].all()
    assert sorted(ends) == [False, True]
    assert not holes[columns[shift + 3 : -shift - 3]].any()


def test_another_accuracy_has_its_holes_in_mirrors_too():
    eyes = rig()
    result = carried(seen(eyes["left"]), eyes)
    wide, narrow = (result.reasons_at(SETTINGS[setting]) > 0 for setting in ("exact", "draft"))
    assert wide[result.views[0].mirrors.shown].sum() > narrow[result.views[0].mirrors.shown].sum()


def test_where_the_paper_s_method_is_asked_for_all_is_carried_by_surfaces():
    eyes = rig()
    alone = SETTINGS["draft"].__class__(silhouette_step=1.0, silhouette_radius=0, colour_tolerance=0.0)
    nothing = np.zeros(SIZE[::-1], bool)
    result = reproject_pair(seen(eyes["left"]), eyes["left"], eyes["right"], accuracy=alone, invalid=nothing)
    assert result.views[0].mirrors is None


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_each_of_several_sources_has_its_own_mirrors(order):
    eyes = rig()
    cameras = [(eyes["left"], rig(ipd=0.05)["left"])[number] for number in order]
    sources = [RenderedView(View(f"source {number}", eye), seen(eye)) for number, eye in enumerate(cameras)]
    both = reproject(sources, View("right", eyes["right"]), SETTINGS["balanced"])
    index = both.warp.source
    assert set(np.unique(index)) == {0, 1}
    in_mirrors = 0
    for number, view in enumerate(both.views):
        own = (index == number) & both.warp.covered
        in_mirrors += (view.mirrors.shown & own).sum()
        for name in both.passes:
            np.testing.assert_array_equal(both.passes[name][own], view.warped.passes[name][own])
        assert (view.reasons[own] & ~both.reasons[own] == 0).all()
    assert in_mirrors > 1000


@pytest.mark.parametrize("interpolation", ["linear", "cubic"])
@pytest.mark.parametrize("count", [1, 2])
def test_the_share_of_a_pixel_s_variance_is_that_of_the_map_it_was_looked_up_by(interpolation, count):
    """Of noise alone, as much is left as is told: in mirrors, beside them, and in each of several sources."""
    eyes, rng = rig(ipd=0.13), np.random.default_rng(2)
    cameras = [eyes["left"], rig(ipd=0.045)["left"]][:count]
    sources = [RenderedView(View(f"source {number}", eye), seen(eye)) for number, eye in enumerate(cameras)]
    for source in sources:
        source.passes[COLOUR_PASS] = rng.normal(0.0, 1.0, (*SIZE[::-1], 200)).astype(np.float32)
    options = WarpOptions(interpolation="nearest", colour_interpolation=interpolation)
    result = reproject(sources, View("right", eyes["right"]), SETTINGS["balanced"], options=options)
    known = result.reasons == 0
    found, told = np.mean(result.passes[COLOUR_PASS] ** 2, axis=-1), result.variance_share
    mirror = np.any([view.mirrors.shown & (result.warp.source == k) for k, view in enumerate(result.views)], axis=0)
    assert told.dtype == np.float32
    assert abs(told[mirror & known].mean() - told[~mirror & known].mean()) > 0.02, "or the maps are not told apart"
    for where in (mirror, ~mirror):
        assert found[where & known].mean() == pytest.approx(told[where & known].mean(), rel=CUBIC_WITHIN)
        assert np.median(np.abs(found - told)[where & known]) < 0.1
    assert (told[~result.warp.covered] == 1.0).all()


def test_out_of_focus_and_among_volumes_no_length_is_one():
    eyes = rig()
    assert carried(seen(eyes["left"]), eyes, optics=Optics(Lens(aperture=0.1))).views[0].mirrors is None
    everywhere = [np.full((8, 3), np.inf)]
    assert carried(seen(eyes["left"]), eyes, optics=Optics(volumes=everywhere)).views[0].mirrors is None
