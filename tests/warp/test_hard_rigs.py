"""Eyes and lenses at their worst, scenes of 8 cm and of 10 000 km: every pixel is flagged, or where it should be."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stereo_reproject.settings.accuracy import SETTINGS
from stereo_reproject.views.camera import OrthographicCamera, disparity_per_nearness
from stereo_reproject.warp.scanline import row_disparity_of
from stereo_reproject.warp.tuning import TUNING as WARP_TUNING
from tests.warp.analytic import Plane, Sphere, World, pixel_centres, pose
from tests.warp.bounds import THIRD_DIFFERENCES, px_per_slope
from tests.warp.exact import Rig, examples, passes_of, reprojected
from tests.warp.judging import judged

SIZE = (150, 90)
MODES = ["off-axis", "parallel", "toe-in"]

SAME_EVERYWHERE = 1e-4
"""Pixels, and shares of a value: what scaling a scene may change, by the other roundings of a float32."""


def room(scale=1.0, view=1.0):
    """A slanted wall, a ball and a card; all of it scaled, or brought so near to the middle that a lens sees it."""

    def at(x, y, z):
        return (scale * view * x, scale * view * y, scale * z)

    return World(
        (
            Plane(at(0.0, 0.0, -8.0), (0.1, 0.05, 1.0)),
            Sphere(at(0.3, 0.1, -3.0), 0.6 * scale * view),
            Plane(at(-0.4, 0.05, -2.0), half=0.2537 * scale * view),
        )
    )


TOLD = 0.3
"""Share of a picture that is right and not flagged, at least, unless a case says why there is less of it."""


def keeps_it(world, rig, *, told=TOLD):
    """From either eye to the other: no pixel is wrong, few are excused, and so many are told."""
    for source, target in (rig.eyes, rig.eyes[::-1]):
        result = judged(world, source, target)
        assert not result.wrong.any(), (rig, result.worst)
        assert not result.vague, (rig, result.excused)
        assert np.mean(result.told) >= told, rig
    return result


def all_are_holes(world, rig):
    """From either eye to the other: they have nothing in common."""
    for source, target in (rig.eyes, rig.eyes[::-1]):
        depth, _ = world.hit(source, *pixel_centres(source))
        result = reprojected(passes_of(depth), source, target)
        assert (result.reasons != 0).all()


# Interocular distance and convergence


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("scale", [None, 4.0])
@pytest.mark.parametrize("ipd", [1e-9, 1e-3, 0.065, 1.0])
@pytest.mark.parametrize("sign", [1, -1])
def test_interocular_distances(mode, scale, ipd, sign):
    """Up to an eighth of the depth; below zero the eyes are swapped."""
    result = keeps_it(room(), Rig(size=SIZE, mode=mode, scale=scale, ipd=sign * ipd, convergence=3.0))
    if ipd <= 1e-3:
        assert result.flagged.mean() < 0.1


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("orthographic", [False, True])
@pytest.mark.parametrize("ipd", [20.0, 1e6])
@pytest.mark.parametrize("sign", [1, -1])
def test_eyes_further_apart_than_the_scene_is_deep(mode, orthographic, ipd, sign):
    """2.5 times, converging on a wall or seeing enough of it: both see the same part, and the ball from two sides."""
    unit = ipd / 20.0
    world = World((Plane((0.0, 0.0, -8.0 * unit)), Sphere((0.3 * unit, 0.1 * unit, -7.5 * unit), 0.3 * unit)))
    lens, scale = (8.0 if mode == "parallel" else 50.0), (2.0 * ipd if orthographic else None)
    keeps_it(world, Rig(size=SIZE, mode=mode, lens=lens, scale=scale, ipd=sign * ipd, convergence=8.0 * unit))


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("scale", [None, 4.0])
@pytest.mark.parametrize("ipd", [20.0, 1e6])
def test_eyes_that_see_nothing_in_common(mode, scale, ipd):
    all_are_holes(World((Plane((0.0, 0.0, -8.0)),)), Rig(size=SIZE, mode=mode, scale=scale, ipd=ipd, convergence=ipd))


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("scale", [None, 4.0])
def test_without_an_interocular_distance_all_is_as_it_was(mode, scale):
    source, target = Rig(size=SIZE, mode=mode, scale=scale, ipd=0.0).eyes
    depth, _ = room().hit(source, *pixel_centres(source))
    for accuracy in SETTINGS.values():
        result = reprojected(passes_of(depth), source, target, accuracy=accuracy)
        assert not result.reasons.any()
        np.testing.assert_allclose(result.warp.x, pixel_centres(source)[0], rtol=0, atol=np.spacing(np.float32(150)))


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("convergence", [0.1, 2.0, 1e9, np.inf, -2.0, -0.1])
def test_convergences(mode, convergence):
    """In front of the scene, within it, at infinity and behind the camera."""
    # Within a tenth of a unit their frames, or they, are turned apart by nine tenths of a picture's width.
    told = TOLD if mode == "parallel" else {0.1: 0.1, -0.1: 0.05}.get(convergence, TOLD)
    keeps_it(room(), Rig(size=SIZE, mode=mode, convergence=convergence), told=told)
    keeps_it(room(), Rig(size=SIZE, mode=mode, convergence=convergence, lens=8.0, ipd=0.01))


@pytest.mark.parametrize("mode", MODES)
def test_convergence_at_the_near_plane(mode):
    """A micron away: eyes that are as near to each other see a room of some of them, others nothing in common."""
    keeps_it(room(0.5e-6), Rig(size=SIZE, mode=mode, convergence=1e-6, ipd=2e-8))
    if mode != "parallel":
        all_are_holes(room(), Rig(size=SIZE, mode=mode, convergence=1e-6))
        all_are_holes(room(), Rig(size=SIZE, mode=mode, convergence=1e-6, lens=8.0, ipd=0.01))


TURNED_TOLD = 0.2
"""The share of a picture that is told at least of eyes that are toed in: of each there is less in the other's."""

STILL_TOLD = {(80.0, 20.0): 0.07, (80.0, 8.0): 0.01, **{(angle, 8.0): 0.08 for angle in (30.0, 44.0, 45.0, 46.0, 53.0)}}
"""By degrees and lens: of what is that far aside in one eye's picture the other sees less, or 2.5 times as much."""


@pytest.mark.parametrize("degrees", [1.0, 10.0, 30.0, 44.0, 45.0, 46.0, 53.0, 80.0])
@pytest.mark.parametrize("lens", [8.0, 20.0])
def test_toe_in(degrees, lens):
    """Each eye turned so far, around what stands in the middle; from 45 degrees on one looks past the other."""
    rig = Rig(size=SIZE, mode="toe-in", lens=lens, ipd=2.0 * 3.0 * np.tan(np.radians(degrees)), convergence=3.0)
    world = World((Plane((0.0, 0.0, -8.0)), Sphere((0.1, 0.1, -3.0), 0.6), Plane((-0.4, -0.5, -2.5), half=0.3)))
    keeps_it(world, rig, told=STILL_TOLD.get((degrees, lens), TURNED_TOLD))


@pytest.mark.parametrize("degrees", [0.1, 10.0, 45.0])
def test_perspective_bends_no_coarse_cell(degrees):
    """A sky has one depth: without its perspective all of it would be coarse, and off by pixels."""
    rig = Rig(size=SIZE, mode="toe-in", lens=8.0, ipd=6.0 * np.tan(np.radians(degrees)), convergence=3.0)
    source, target = rig.eyes
    result = judged(World(), source, target)
    told = ~result.flagged & ~result.unknown
    assert result.off[told].max() <= THIRD_DIFFERENCES * WARP_TUNING.bend_share * WARP_TUNING.tear_pixels
    subdivided = reprojected(passes_of(np.full(SIZE[::-1], np.inf)), source, target).grid.subdivided
    assert subdivided.any() == (degrees > 0.1)


@pytest.mark.parametrize("degrees", [1.0, 44.0, 45.0, 46.0, 53.0])
def test_steps_in_depth_stay_measured_in_pixels(degrees):
    source, target = Rig(mode="toe-in", ipd=6.0 * np.tan(np.radians(degrees)), convergence=3.0).eyes
    baseline = np.linalg.norm(source.world_from_camera[:3, 3] - target.world_from_camera[:3, 3])
    flat = px_per_slope(source) * baseline
    assert 0.99 * flat <= disparity_per_nearness(source, target) <= 2.0 * flat * (1.0 + 1e-9)


@pytest.mark.parametrize("ipd", [1e-9, 1e-3, 0.1])
def test_parallel_rays_that_are_toed_in_by_next_to_nothing(ipd):
    source, target = Rig(mode="toe-in", scale=5.0, ipd=ipd).eyes
    turned = 2.0 * np.arctan(0.5 * ipd / 2.0)
    assert disparity_per_nearness(source, target) == pytest.approx(np.sin(turned) * 96 / 5.0, rel=1e-6)


# Lenses


@pytest.mark.parametrize("lens", [1.0, 8.0, 50.0, 500.0, 5000.0])
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("shift", [(0.0, 0.0), (1.5, -0.7)])
def test_lenses(lens, mode, shift):
    rig, world = seen_by(lens, mode, shift)
    result = keeps_it(world, rig)
    assert mode == "toe-in" or result.flagged.mean() < 0.6


def seen_by(lens, mode, shift):
    """Eyes, and the room as the lens sees it, the shift's part of it included."""
    view = 50.0 / lens
    depth = 1.0 if lens < 500.0 else lens / 50.0
    ipd = 0.02 * view * depth
    if mode == "toe-in":
        # Turned, the side of so wide a frame moves by more than what is in it.
        ipd /= 1.0 + ((0.5 + abs(shift[0])) * 36.0 / lens) ** 2
    rig = Rig(size=SIZE, lens=lens, mode=mode, shift=shift, ipd=ipd, convergence=3.0 * depth)
    world = room(depth, view)
    moved = (_aside(surface, np.multiply(shift, 36.0 / lens)) for surface in world.surfaces)
    return rig, replace(world, surfaces=tuple(moved))


def _aside(surface, slope):
    """The surface, so far aside for each unit of its depth."""
    name = "centre" if isinstance(surface, Sphere) else "point"
    x, y, z = getattr(surface, name)
    return replace(surface, **{name: (x - slope[0] * z, y - slope[1] * z, z)})


@pytest.mark.parametrize("aspect", [0.1, 0.5, 2.0, 10.0])
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("scale", [None, 4.0])
def test_pixels_that_are_not_square(aspect, mode, scale):
    keeps_it(room(), Rig(size=(120, 80), aspect=aspect, mode=mode, scale=scale))


@pytest.mark.parametrize("scale", 10.0 ** np.arange(-6, 7, 2))
@pytest.mark.parametrize("mode", MODES)
def test_orthographic_scales(scale, mode):
    """From a micron to a thousand kilometres wide; the depth is what it is, unless turned eyes would see behind it."""
    deep = max(scale, 1.0) if mode == "toe-in" else 1.0
    wall = Plane((0.0, 0.0, -8.0 * deep), (0.1, 0.05, 1.0))
    world = World((wall, Plane((0.1 * scale, 0.0, -4.0 * deep), half=0.2 * scale)))
    keeps_it(world, Rig(size=SIZE, mode=mode, scale=scale, ipd=0.02 * scale, convergence=max(3.0, scale)))


@pytest.mark.parametrize("depth", [1e-6, 1.0, 1e6, 4.9e8, 5.1e8, 9.9e8])
def test_orthographic_depths_come_back_as_they_were(depth):
    source, target = Rig(size=(40, 30), scale=5.0, ipd=0.3, mode="parallel").eyes
    assert isinstance(source, OrthographicCamera)
    result = reprojected(passes_of(np.full((30, 40), depth)), source, target)
    told = result.reasons == 0
    assert told.mean() > 0.8
    np.testing.assert_allclose(result.passes["Depth"][told], depth, rtol=SAME_EVERYWHERE)


@pytest.mark.parametrize("place", [0.0, 1e3, 1e5, 1e7])
@pytest.mark.parametrize("turned", [False, True])
def test_far_from_the_world_s_origin(place, turned):
    """The eyes' difference loses digits there, and is a rectified pair's for all that."""
    angles = {"yaw": 0.3, "pitch": -0.4, "roll": 0.7} if turned else {}
    near, far = (Rig(world=pose((p, -p / 3.0, p / 7.0), **angles)).eyes for p in (0.0, place))
    one, other = (row_disparity_of(*eyes) for eyes in (near, far))
    assert one.per_nearness == pytest.approx(other.per_nearness, rel=1e-6)
    depth, _ = room().hit(Rig().eyes[0], *pixel_centres(near[0]))
    results = [reprojected(passes_of(depth), *eyes) for eyes in (near, far)]
    np.testing.assert_array_equal(results[0].reasons, results[1].reasons)
    told = results[0].reasons == 0
    np.testing.assert_allclose(results[0].warp.x[told], results[1].warp.x[told], rtol=0, atol=SAME_EVERYWHERE)


# Scale


def scaled(rig, factor):
    """The rig in a scene that is so many times as large."""
    scale = None if rig.scale is None else factor * rig.scale
    return replace(rig, ipd=factor * rig.ipd, convergence=factor * rig.convergence, scale=scale)


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("orthographic", [False, True])
@pytest.mark.parametrize("accuracy", ["balanced", "exact"])
@pytest.mark.parametrize("factor", [0.01, 0.1, 10.0, 1e3, 1e6, 1.25e6])
def test_a_scene_looks_the_same_at_any_size(mode, orthographic, accuracy, factor):
    """8 m deep as it stands; of 8 cm, of 8 000 km and of 10 000 km."""
    rig = Rig(size=SIZE, mode=mode, scale=4.0 if orthographic else None, convergence=2.9)
    results = []
    for size in (1.0, factor):
        source, target = scaled(rig, size).eyes
        depth, index = room(size).hit(source, *pixel_centres(source))
        colour = World(contrast=0.3, frequency=2.0).colour(rig.eyes[0], *pixel_centres(source))
        passes = passes_of(depth, colour, IndexOB=np.float32(index)[..., None])
        results.append(reprojected(passes, source, target, accuracy=SETTINGS[accuracy]))
    one, other = results
    np.testing.assert_array_equal(one.reasons, other.reasons)
    told = one.reasons == 0
    for name in ("x", "y"):
        places = (getattr(result.warp, name)[told] for result in results)
        np.testing.assert_allclose(*places, rtol=0, atol=SAME_EVERYWHERE)
    np.testing.assert_allclose(one.passes["Combined"][told], other.passes["Combined"][told], atol=SAME_EVERYWHERE)
    np.testing.assert_array_equal(one.passes["IndexOB"][told], other.passes["IndexOB"][told])
    np.testing.assert_allclose(factor * one.passes["Depth"][told], other.passes["Depth"][told], rtol=SAME_EVERYWHERE)


@examples(40)
@given(st.floats(-2, 6), st.floats(-3, -1), st.floats(0.7, 3), st.sampled_from(MODES))
def test_any_scene_of_any_size(log_size, log_ipd, log_lens, mode):
    size, lens = 10.0**log_size, 10.0**log_lens
    rig = Rig(size=(90, 60), mode=mode, ipd=size * 10.0**log_ipd, convergence=3.0 * size, lens=lens)
    # With long lenses and wide rigs much of the wall is seen only behind what the ball and the card hide.
    keeps_it(room(size, min(50.0 / lens, 3.0)), rig, told=0.25)
