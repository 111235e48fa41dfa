"""How far off a warped pixel may be, as docs/numerics.md has it, and that it is no further: by property, not by eye.

A pixel is flagged, or what it shows is where it should be; but for what the source cannot know of.
"""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stereo_reproject.settings.accuracy import SETTINGS
from stereo_reproject.views.camera import OrthographicCamera, disparity_per_nearness
from stereo_reproject.views.parallax import ARC_MINUTE, parallax_difference
from stereo_reproject.warp.forward import forward_warp
from stereo_reproject.warp.grid import CELL_QUADS, build_grid
from stereo_reproject.warp.scanline import row_disparity_of
from stereo_reproject.warp.tuning import TUNING as WARP_TUNING
from tests.warp.analytic import Plane, Sphere, World, pixel_centres
from tests.warp.bounds import ROUNDINGS, most_in_a_cell, px_per_slope
from tests.warp.exact import Rig, examples, nothing_said, passes_of, reprojected, where_they_go
from tests.warp.judging import judged, misses

THRESHOLDS = st.sampled_from([0.0, 0.25, 1.0, 3.0, 30.0])
MODES = st.sampled_from(["off-axis", "parallel", "toe-in"])


def between(low, high):
    return st.floats(low, high, allow_nan=False, allow_infinity=False)


@st.composite
def worlds(draw):
    """A wall or the sky behind up to three balls and cards, each nearer than the last, and how far all that reaches."""
    far = 10.0 ** draw(between(-1, 3))
    surfaces = []
    if draw(st.booleans()):
        surfaces.append(Plane((0.0, 0.0, -far), (draw(between(-0.3, 0.3)), draw(between(-0.3, 0.3)), 1.0)))
    depth = 0.5 * far
    for _ in range(draw(st.integers(0, 3))):
        depth *= draw(between(0.4, 0.7))
        reach = depth * draw(between(0.05, 0.25))
        place = (draw(between(-0.3, 0.3)) * depth, draw(between(-0.2, 0.2)) * depth, -depth)
        if draw(st.booleans()):
            surfaces.append(Sphere(place, 0.4 * reach))
        else:
            slant = (draw(between(-1, 1)), draw(between(-1, 1)), 1.0)
            surfaces.append(Plane(place, slant, 0.5 * reach))
        depth -= reach
    return World(tuple(surfaces)), far


@st.composite
def pairs(draw, far):
    """Source and target, with lenses of 5 to 200 mm and eyes up to a tenth of all depth apart."""
    rig = Rig(
        size=(draw(st.integers(20, 110)), draw(st.integers(4, 60))),
        lens=10.0 ** draw(between(0.7, 2.3)),
        mode=draw(MODES),
        ipd=far * 10.0 ** draw(between(-4, -1)),
        convergence=far * 10.0 ** draw(between(-1, 0.5)),
        shift=(draw(between(-0.3, 0.3)), draw(between(-0.3, 0.3))),
        aspect=draw(st.sampled_from([0.5, 1.0, 2.0])),
        scale=far if draw(st.booleans()) else None,
    )
    return rig.eyes if draw(st.booleans()) else rig.eyes[::-1]


TOLD = 0.9
"""Of what both eyes see in all these pictures together, the least share that is not flagged."""

EXCUSED = 0.01
"""Of all their pixels together, the most that are hidden, or between the source's pixel centres."""


TIGHT = 0.8
"""Of a bound, what is reached: of eyes that are toed in it takes the frame's side, and the perspective."""


# Against tracing


def test_every_pixel_is_right_or_flagged():
    counts = []

    @examples(150)
    @given(st.data())
    def judge(data):
        world, far = data.draw(worlds())
        source, target = data.draw(pairs(far))
        result = judged(world, source, target, threshold=data.draw(THRESHOLDS))
        assert not result.wrong.any(), result.worst
        excused = sum(result.excused) * result.flagged.size
        counts.append((np.sum(result.told & result.seen), result.seen.sum(), excused, result.flagged.size))

    judge()
    told, seen, excused, pixels = np.sum(counts, axis=0)
    assert told >= TOLD * seen
    assert excused <= EXCUSED * pixels


SCENES = {
    "wall": World((Plane((0.0, 0.0, -8.0)),)),
    "slanted wall": World((Plane((0.0, 0.0, -4.0), (0.5, 0.2, 1.0)),)),
    "floor to the horizon": World((Plane((0.0, -1.5, 0.0), (0.0, 1.0, 0.0)),)),
    "ball": World((Plane((0.0, 0.0, -8.0)), Sphere((0.3, 0.1, -3.0), 0.6))),
    "card": World((Plane((0.0, 0.0, -8.0)), Plane((-0.4, 0.1, -2.0), half=0.25))),
    "low step": World((Plane((0.0, 0.0, -8.0)), Plane((0.0, 0.0, -7.99), half=0.5))),
    "sky": World(),
}


@pytest.mark.parametrize("accuracy", ["draft", "balanced", "high", "exact"])
@pytest.mark.parametrize("mode", ["off-axis", "parallel", "toe-in"])
@pytest.mark.parametrize("scene", SCENES)
def test_the_settings_keep_it_too(scene, mode, accuracy):
    """Their bands are narrower and their edges higher; of one colour, no edge would be left out for its looks."""
    source, target = Rig(size=(190, 120), mode=mode).eyes
    setting = replace(SETTINGS[accuracy], colour_tolerance=0.0)
    result = judged(SCENES[scene], source, target, accuracy=setting)
    assert not result.wrong.any(), result.worst
    assert result.flagged.mean() < 0.25, "most of these pictures is not flagged"
    assert sum(result.excused) * result.flagged.size <= 2


# Coarse against native


@examples(60)
@given(st.data())
def test_coarse_cells_are_as_near_the_native_ones_as_the_threshold_says(data):
    """Of one depth map, rectified: what is looked up in a coarse cell, against the row drawn pixel by pixel."""
    size = (data.draw(st.integers(33, 150)), data.draw(st.integers(17, 60)))
    rig = Rig(size=size, lens=10.0 ** data.draw(between(0.7, 3.0)), mode="parallel", ipd=0.1)
    source, target = rig.eyes
    threshold = data.draw(st.sampled_from([0.5, 2.0, 10.0]))
    depth = waves(data, size, threshold)
    most = data.draw(st.sampled_from([WARP_TUNING.tear_pixels, np.inf]))
    with nothing_said():
        grid = build_grid(depth, source, target, threshold=threshold, most=most)
        cuts = {"cut_right": np.zeros((size[1], size[0] - 1), bool), "cut_down": np.zeros((size[1] - 1, size[0]), bool)}
        warp = forward_warp(depth, source, target, grid, **cuts)
    shift = row_disparity_of(source, target)
    # What is found, in the row of pixels joined by straight lines of nearness.
    x, _ = pixel_centres(target)
    centres = np.arange(size[0]) + 0.5
    nearness = 1.0 / depth.astype(np.float64)
    there = np.array([np.interp(row, centres, line) for row, line in zip(np.nan_to_num(warp.x), nearness, strict=True)])
    landed = warp.x + shift.offset + shift.per_nearness * there
    error = np.abs(landed - x)[warp.covered]
    allowed = most_in_a_cell(threshold, source, target, depth.min(), depth.min(), most=most)
    rounding = ROUNDINGS * np.finfo(np.float32).eps * (size[0] + abs(shift.per_nearness) / depth.min())
    assert error.max(initial=0.0) <= allowed + rounding
    if grid.subdivided.all():
        assert error.max(initial=0.0) <= rounding


def waves(data, size, threshold):
    """Depth (H, W) of a wall whose waves are a few thresholds of parallax high."""
    x, y = np.meshgrid(np.linspace(0, 1, size[0]), np.linspace(0, 1, size[1]))
    total = np.zeros(x.shape)
    for _ in range(3):
        per_x, per_y, phase = (data.draw(between(-20, 20)) for _ in range(3))
        total += np.sin(per_x * x + per_y * y + phase)
    height = threshold * ARC_MINUTE / 0.1 * data.draw(between(0.05, 1.0))
    return (1.0 / (1.0 / data.draw(between(0.5, 20.0)) + 4.0 * height + height * total)).astype(np.float32)


KINDS = {
    "parallel": Rig(size=(191, 95), mode="parallel", ipd=0.1, convergence=4.0),
    "off-axis": Rig(size=(191, 95), mode="off-axis", ipd=0.1, convergence=4.0),
    "toe-in": Rig(size=(191, 95), mode="toe-in", ipd=0.1, convergence=4.0),
    "orthographic toe-in": Rig(size=(191, 95), mode="toe-in", ipd=0.1, convergence=4.0, scale=3.0),
}


@pytest.mark.parametrize("share", [0.5, 0.98, 1.02, 1.5, 3.0])
@pytest.mark.parametrize("threshold", [1.0, 3.0])
@pytest.mark.parametrize("kind", KINDS)
def test_a_cell_is_coarse_up_to_the_threshold_and_no_further(kind, threshold, share):
    """Each has a plateau of that share of it, which its corners do not know of: it is off by that, or not at all."""
    source, target = KINDS[kind].eyes
    far = 3.0
    near = _nearer(source, target, far, share * threshold * ARC_MINUTE)
    on_it = [(np.arange(1, n + 1) % CELL_QUADS >= 4) & (np.arange(1, n + 1) % CELL_QUADS <= 12) for n in (95, 191)]
    depth = np.where(on_it[0][:, None] & on_it[1], near, far).astype(np.float32)
    cuts = {"cut_right": np.zeros((95, 190), bool), "cut_down": np.zeros((94, 191), bool)}
    with nothing_said():
        grid = build_grid(depth, source, target, threshold=threshold, most=WARP_TUNING.tear_pixels)
        warp = forward_warp(depth, source, target, grid, **cuts)
    result = SimpleNamespace(warp=warp, grid=grid, reasons=np.zeros(warp.x.shape, np.uint16))
    off, allowed, _ = misses(depth, result, source, target, threshold=threshold)
    assert np.all(off <= allowed)
    assert grid.subdivided.all() == (share > 1.0)
    assert grid.subdivided.any() == (share > 1.0)
    if share < 1.0:
        assert off.max() > TIGHT * share * allowed.max(), "no bound is much tighter"


def _nearer(source, target, far, angle):
    """The depth that is by so much parallax nearer than `far`."""
    if isinstance(source, OrthographicCamera):
        moved = [where_they_go(source, target, np.full((95, 191), z))[0][0, 0] for z in (far, far - 1.0)]
        return far - angle * source.width / WARP_TUNING.orthographic_width_radians / abs(moved[1] - moved[0])
    ipd = np.linalg.norm(source.world_from_camera[:3, 3] - target.world_from_camera[:3, 3])
    return 0.5 * ipd / np.tan(np.arctan(0.5 * ipd / far) + 0.5 * angle)


@examples(200)
@given(between(-3, 3), between(0, 4), between(-3, 2), st.sampled_from([0.1, 1.0, 10.0, 60.0]))
def test_the_formula_bounds_every_cell_that_the_grid_leaves_coarse(log_near, log_ratio, log_ipd, threshold):
    """All depths whose angle is no more than the threshold shift by no more than the formula says, and some by that."""
    near, ipd = 10.0**log_near, 10.0**log_ipd
    half = np.arctan(0.5 * ipd / near) - 0.5 * threshold * ARC_MINUTE
    far = 0.5 * ipd / np.tan(half) if half > 0.0 else np.inf
    far = min(far, near * 10.0**log_ratio)
    source, target = Rig(ipd=ipd).eyes
    shift = px_per_slope(target) * ipd * (1.0 / near - 1.0 / far)
    allowed = most_in_a_cell(threshold, source, target, near, far, most=np.inf)
    assert parallax_difference(np.array(near), np.array(far), ipd) <= threshold * ARC_MINUTE * (1.0 + 1e-9)
    assert shift <= allowed * (1.0 + 1e-6)
    if half > 0.0 and far < near * 10.0**log_ratio:
        assert shift == pytest.approx(allowed, rel=1e-6), "no bound is tighter"


def test_a_minute_in_pixels():
    """As docs/numerics.md has it: full HD, 50 mm on 36, eyes 65 mm apart, from two metres on."""
    source, target = Rig(size=(1920, 1080), ipd=0.065).eyes
    assert most_in_a_cell(1.0, source, target, 2.0, np.inf, most=np.inf) == pytest.approx(0.776, abs=5e-4)
    source, target = Rig(size=(3840, 2160), ipd=0.065).eyes
    assert most_in_a_cell(1.0, source, target, 2.0, np.inf, most=np.inf) == pytest.approx(1.551, abs=5e-4)
    assert most_in_a_cell(1.0, source, target, 2.0, np.inf, most=WARP_TUNING.tear_pixels) == WARP_TUNING.tear_pixels


# What made them necessary


def far_card(lens):
    """A card ten metres before a wall, far away, and a rig of which they fill the view."""
    world = World((Plane((0.0, 0.0, -110.0)), Plane((0.05, 0.02, -100.0), half=750.0 / lens)))
    return world, Rig(size=(480, 320), lens=lens, convergence=105.0)


@pytest.mark.parametrize("lens", [50.0, 500.0, 5000.0])
def test_a_long_lens_makes_no_tear_of_less_than_a_minute(lens):
    world, rig = far_card(lens)
    source, target = rig.eyes
    result = judged(world, source, target)
    assert not result.wrong.any(), result.worst
    assert result.off[~result.flagged].max() < WARP_TUNING.tear_pixels
    step = disparity_per_nearness(source, target) * (1.0 / 100.0 - 1.0 / 110.0)
    assert (step > WARP_TUNING.tear_pixels) == (lens == 5000.0)
    assert float(parallax_difference(np.array(100.0), np.array(110.0), 0.065)) < ARC_MINUTE


@pytest.mark.parametrize("most", [WARP_TUNING.tear_pixels, np.inf])
def test_what_is_nearer_than_the_eyes_are_apart_makes_no_tear_either(most):
    """There the angle saturates: a tenth of a unit between depths of 0.02 and 0.03 is many pixels and few minutes."""
    source, target = Rig(size=(160, 96), ipd=10.0, mode="parallel", lens=30.0).eyes
    depth = np.full((96, 160), 0.0300, np.float32)
    depth[:, 60:] = 0.0299
    assert float(parallax_difference(np.array(0.0299), np.array(0.03), 10.0)) < ARC_MINUTE * 2.0
    coarse = ~build_grid(depth, source, target, threshold=2.0, most=most).subdivided
    assert coarse[:, 3].any() == (most == np.inf)


SLANTED = [(-1.5, 85.0, 0.5), (-1.2, 87.0, 0.6), (-1.2, -87.0, 0.6), (-2.0, 70.0, 0.5)]


@pytest.mark.parametrize("mode", ["off-axis", "toe-in"])
@pytest.mark.parametrize("swapped", [False, True])
@pytest.mark.parametrize(("depth", "degrees", "half"), SLANTED)
def test_what_is_too_slanted_to_be_drawn_hides_the_wall(depth, degrees, half, mode, swapped):
    """The target sees many times as much of it as the source, or its other side: it is traced, not seen through."""
    angle = np.radians(degrees)
    card = Plane((-0.1, 0.03, depth), (np.sin(angle), 0.0, np.cos(angle)), half)
    source, target = Rig(size=(320, 64), ipd=0.2, convergence=4.0, mode=mode).eyes[:: -1 if swapped else 1]
    result = judged(World((Plane((0.0, 0.0, -8.0)), card)), source, target)
    assert not result.wrong.any(), result.worst
    assert 0.05 < result.flagged.mean() < 0.6


@pytest.mark.parametrize("slope", np.linspace(-0.6, 0.6, 13))
@pytest.mark.parametrize("width", [1, 2])
@pytest.mark.parametrize("part", [0.0, 0.3, 0.55, 0.8])
def test_what_is_a_pixel_or_two_wide_is_never_lost(width, slope, part):
    """Drawn between two of the target's pixel centres it is not there: then it is flagged where it would be."""
    source, target = Rig(size=(96, 40), mode="parallel", ipd=0.1).eyes
    shift = row_disparity_of(source, target)
    disparity = np.full((40, 96), 2.0)
    disparity[:, 50 : 50 + width] = 9.0 + part + slope * np.arange(width)
    depth = (-shift.per_nearness / disparity).astype(np.float32)
    result = reprojected(passes_of(depth), source, target)
    landed = np.arange(50, 50 + width) + 0.5 - disparity[20, 50 : 50 + width]
    for place in landed:
        assert (result.reasons[:, int(place)] != 0).all()


def test_a_cell_is_what_the_formulas_take_it_for():
    assert CELL_QUADS == 16
