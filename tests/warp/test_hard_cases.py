"""Depths, colours, sizes and patterns at their worst: no exception, no warning, no number that is none, no wrong pixel
that is not flagged."""

from __future__ import annotations

from dataclasses import replace

import mpmath
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stereo_reproject.images.reasons import Reason
from stereo_reproject.settings.accuracy import SETTINGS
from stereo_reproject.views.camera import target_px_from_source_px
from stereo_reproject.views.parallax import parallax_angle, parallax_difference
from stereo_reproject.warp.composite import replace_non_finite
from stereo_reproject.warp.scanline import row_disparity_of
from tests.warp.analytic import Plane, Sphere, World, pixel_centres
from tests.warp.bounds import ROUNDINGS
from tests.warp.exact import STRICT, Rig, examples, nothing_said, passes_of, reprojected, where_they_go
from tests.warp.judging import judged, misses

SIZE = (93, 62)
MODES = ["off-axis", "parallel", "toe-in"]
DEPTHS = [1e-6, 1e-3, 1.0, 1.0000001, 4.0, 1e4, 1e9, np.inf]
BROKEN = [0.0, -0.0, -1.0, -1e9, 1e-45, -1e-45, 1e-39, np.nan, -np.inf]

WITHIN_ONE = 0.1
"""Pixels: the perspective within a single one, of eyes that are toed in by a degree."""

STRAIGHT = 2e-3
"""Pixels: the same between two pixel centres of neighbours; twice what is reached, in a picture of one pixel."""

SAME_PLACE = 1e-3
"""Pixels: so far beside a step's end a position may be for a tolerance, and still be on it."""

ROUNDING = ROUNDINGS * np.finfo(np.float32).eps
"""Of a float32 position, in parts of the largest number that it is made of."""


def whole(result, source):
    """Nothing in it is a number that is none, and what is shown lies in the source."""
    covered = result.warp.covered
    for name, image in result.passes.items():
        assert not np.isnan(image).any(), name
        assert name == "Depth" or np.isfinite(image).all(), name
    np.testing.assert_array_equal(np.isnan(result.warp.x), ~covered)
    np.testing.assert_array_equal(np.isnan(result.warp.y), ~covered)
    assert not np.isnan(result.warp.nearness).any()
    assert (result.reasons[~covered] != 0).all(), "what nothing landed on is flagged"
    for place, size in ((result.warp.x, source.width), (result.warp.y, source.height)):
        assert np.all((place[covered] >= -0.51) & (place[covered] <= size + 0.51))
    assert (result.passes["Depth"][covered & (result.reasons == 0)] > 0.0).all()


def flagged_by_place(accuracy):
    """The setting, but for looks: an edge that nobody sees is not flagged, and what is beside it may be off."""
    return replace(SETTINGS[accuracy], colour_tolerance=0.0)


def beside(x, width):
    """The columns of the pixels that a position lies between, and how far along it does."""
    left = np.clip(np.floor(x - 0.5).astype(int), 0, width - 1)
    return left, np.minimum(left + 1, width - 1), np.clip(x - 0.5 - left, 0.0, 1.0)


def lands(depth, result, source, target):
    """Pixels that are not flagged show what is between the depths of the pixels that they lie between: projected, it
    lands on them."""
    off, allowed, perspective = misses(depth, result, source, target)
    assert np.all(off <= allowed)
    assert perspective.max(initial=0.0) <= STRAIGHT


# Depths


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("scale", [None, 5.0])
@pytest.mark.parametrize("swapped", [False, True])
@pytest.mark.parametrize("accuracy", ["balanced", "exact"])
@pytest.mark.parametrize("side", [1, 12])
def test_all_depths_in_one_picture(mode, scale, swapped, accuracy, side):
    """Pixel by pixel, and in blocks, of which something is told. The nearest of them are nearer than the eyes are to
    each other, and land outside."""
    source, target = Rig(size=SIZE, mode=mode, scale=scale).eyes[:: -1 if swapped else 1]
    count = [-(-length // side) for length in SIZE[::-1]]
    depth = np.random.default_rng(3).choice(np.float32(DEPTHS), count).repeat(side, axis=0).repeat(side, axis=1)
    depth = depth[: SIZE[1], : SIZE[0]]
    whole(reprojected(passes_of(depth), source, target, accuracy=SETTINGS[accuracy]), source)
    result = reprojected(passes_of(depth), source, target, accuracy=flagged_by_place(accuracy))
    whole(result, source)
    lands(depth, result, source, target)
    if side > 1:
        assert np.mean(result.reasons == 0) > 0.1
        assert len(np.unique(result.passes["Depth"][result.reasons == 0])) > 2


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("scale", [None, 5.0])
@pytest.mark.parametrize("cleaned", [False, True])
@pytest.mark.parametrize("share", [0.1, 1.0])
def test_a_broken_depth_pass(mode, scale, cleaned, share):
    """As the pipeline has it, which cleans it first, and handed to `reproject` as it is: the same comes of it."""
    source, target = Rig(size=SIZE, mode=mode, scale=scale).eyes
    rng = np.random.default_rng(4)
    depth = np.where(rng.random(SIZE[::-1]) < share, rng.choice(np.float32(BROKEN), SIZE[::-1]), np.float32(3.0))
    result = reprojected(passes_of(depth), source, target, cleaned=cleaned)
    whole(result, source)
    np.testing.assert_array_equal(
        result.reasons, reprojected(passes_of(np.where(depth > 1.0, depth, np.nan)), source, target).reasons
    )
    if share == 1.0:
        assert not result.warp.covered.any()
    lands(np.where(depth > 1.0, depth, np.nan), result, source, target)


@pytest.mark.parametrize("scale", [None, 5.0])
@pytest.mark.parametrize(("lens", "ipd"), [(50.0, 0.065), (5000.0, 0.065), (5000.0, 1e3)])
@pytest.mark.parametrize("mode", MODES)
def test_depths_at_the_ends_of_what_float32_holds(scale, lens, ipd, mode):
    """In blocks, of which with a common rig what is far is told, and with parallel rays what is near."""
    values = np.float32([1.2e-38, 1e-37, 1e-30, 1.0, 1e30, 3e38, np.inf])
    depth = np.random.default_rng(5).choice(values, (6, 8)).repeat(12, axis=0).repeat(12, axis=1)[: SIZE[1], : SIZE[0]]
    source, target = Rig(size=SIZE, mode=mode, scale=scale, ipd=ipd, lens=lens).eyes
    result = reprojected(passes_of(depth), source, target)
    whole(result, source)
    lands(depth, result, source, target)
    if ipd < 1.0 and lens < 100.0:
        told = np.unique(result.passes["Depth"][result.reasons == 0])
        assert told.size > 2
        assert np.mean(result.reasons == 0) > 0.1


def test_what_a_float32_holds_no_more_is_the_sky():
    """For the target some of it is deeper; and a mean of a nearness and of none may be too small to be divided by."""
    source, target = Rig(size=SIZE, mode="toe-in", lens=8.0).eyes
    result = reprojected(passes_of(np.full(SIZE[::-1], 3.3e38)), source, target)
    whole(result, source)
    depth = result.passes["Depth"][result.reasons == 0]
    assert np.isposinf(depth).any()
    assert np.isfinite(depth).any()
    with nothing_said():
        assert np.isposinf(source.depth_from_nearness(np.float32([1e-42, 0.0]))).all()


def test_parallel_rays_see_what_is_in_their_own_plane():
    source, target = Rig(size=SIZE, mode="toe-in", scale=5.0).eyes
    with nothing_said():
        at_zero, just_ahead = (target_px_from_source_px(source, target, 40.5, 30.5, np.array(z)) for z in (0.0, 1e-9))
    np.testing.assert_allclose(at_zero[:2], just_ahead[:2], rtol=0, atol=1e-6)


@pytest.mark.parametrize("column", [16, 40, 63])
@pytest.mark.parametrize("near", [1e-6, 0.1, 1.0])
def test_the_near_plane_beside_the_sky(near, column):
    """Half of the picture each; the eyes are so close that what is near moves by seven pixels."""
    source, target = Rig(size=SIZE, mode="parallel").eyes
    ipd = 7.3 * near / -row_disparity_of(source, target).per_nearness * 0.065
    source, target = Rig(size=SIZE, mode="parallel", ipd=ipd).eyes
    depth = np.full(SIZE[::-1], np.inf, np.float32)
    depth[:, :column] = near
    result = reprojected(passes_of(depth), source, target)
    whole(result, source)
    lands(depth, result, source, target)
    edge = column - 7.3
    shown = result.passes["Depth"][..., 0]
    x, _ = pixel_centres(target)
    told = (result.reasons == 0) & (np.abs(x - edge) > 1.0)
    np.testing.assert_array_equal(shown[told], np.where(x < edge, np.float32(near), np.inf)[told])
    uncovered = (x > edge + 1.0) & (x < column - 1.0)
    assert (result.reasons[uncovered] & Reason.DISOCCLUDED.bit).all()


@pytest.mark.parametrize("depth", [1e-6, 0.1, 3.0, 1e4, 1e9])
@pytest.mark.parametrize("pattern", ["equal", "ulps", "one ulp"])
@pytest.mark.parametrize("mode", MODES)
def test_depths_that_are_all_but_equal(depth, pattern, mode):
    """No edge, no tear and no hole is seen in them, however many places of a float32 they are from zero."""
    rng = np.random.default_rng(6)
    places = {"equal": 0 * rng.integers(0, 2, SIZE[::-1]), "ulps": rng.integers(-4, 5, SIZE[::-1])}
    places["one ulp"] = rng.integers(0, 2, SIZE[::-1])
    values = np.float32(depth) + places[pattern].astype(np.float32) * np.spacing(np.float32(depth))
    source, target = Rig(size=SIZE, mode=mode, convergence=1.2 * depth, ipd=0.05 * depth).eyes
    result = reprojected(passes_of(values), source, target)
    whole(result, source)
    lands(values, result, source, target)
    assert not (result.reasons & ~Reason.OUTSIDE.bit).any()
    assert np.mean(result.reasons == 0) > 0.9


@examples(60)
@given(
    st.lists(st.floats(-6, 9).map(lambda log: 10.0**log), min_size=2, max_size=6), st.integers(0, 2**16), st.booleans()
)
def test_depths_made_up(values, seed, blocks):
    """Pixel by pixel, or in blocks: what is not flagged lands where it is shown."""
    size = (40, 24)
    source, target = Rig(size=size, ipd=0.4 * min(values), convergence=2.0 * min(values)).eyes
    depth = np.random.default_rng(seed).choice(np.float32([*values, np.inf]), (3, 5) if blocks else size[::-1])
    depth = depth.repeat(8, axis=0).repeat(8, axis=1) if blocks else depth
    result = reprojected(passes_of(depth), source, target)
    whole(result, source)
    lands(depth, result, source, target)


# Theta-delta


def exact_difference(near, far, ipd):
    with mpmath.workdps(400):
        half = mpmath.mpf(ipd) / 2
        farther = mpmath.mpf(0) if np.isinf(far) else mpmath.atan(half / mpmath.mpf(far))
        return 2 * (mpmath.atan(half / mpmath.mpf(near)) - farther)


PARALLAX_TOLERANCE = 1e-6
"""Relative, over all depths; what is reached is a few roundings of a float64."""

NAIVE = [(1e9, 1e9 * (1 + 1e-12), 0.065), (1e-6, 1e-6 * (1 + 1e-14), 0.065), (10.0, np.nextafter(10.0, 11.0), 1e-9)]


@examples(300)
@given(st.floats(-160, 160), st.floats(-15, 15), st.floats(-20, 20))
def test_the_parallax_of_any_two_depths(log_near, log_gap, log_ipd):
    near, ipd = 10.0**log_near, 10.0**log_ipd
    far = near * (1.0 + 10.0**log_gap)
    with nothing_said():
        got = float(parallax_difference(np.array(near), np.array(far), ipd))
    wanted = exact_difference(near, far, ipd)
    assert abs(got - wanted) <= PARALLAX_TOLERANCE * abs(wanted)


@pytest.mark.parametrize(("near", "far", "ipd"), [*NAIVE, (1e-6, np.inf, 0.065), (1e9, np.inf, 1e-9), (1e-6, 1e9, 1e3)])
def test_the_parallax_at_the_ends(near, far, ipd):
    wanted = exact_difference(near, far, ipd)
    got = float(parallax_difference(np.array(near), np.array(far), ipd))
    assert abs(got - wanted) <= PARALLAX_TOLERANCE * abs(wanted)
    if (near, far, ipd) in NAIVE:
        plain = float(parallax_angle(np.array(near), ipd) - parallax_angle(np.array(far), ipd))
        assert abs(plain - wanted) > PARALLAX_TOLERANCE * abs(wanted), "the naive form would not do"


# Colours


@pytest.mark.parametrize("value", [1e30, -1e30, 3e38, 0.0, -1.0, 1e-45, np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("interpolation", ["linear", "cubic"])
@pytest.mark.parametrize("accuracy", ["balanced", "high", "exact"])
@pytest.mark.parametrize("mode", ["off-axis", "toe-in"])
def test_colours_of_any_size(value, interpolation, accuracy, mode):
    rng = np.random.default_rng(7)
    colour = rng.uniform(0, 1, (*SIZE[::-1], 4))
    chosen = rng.random(SIZE[::-1]) < 0.05
    colour[chosen] = value
    depth = np.where(pixel_centres(Rig(size=SIZE).eyes[0])[0] < 50, 1.5, 4.0)
    passes = passes_of(depth, colour, Emit=np.float32(colour[..., :3]))
    source, target = Rig(size=SIZE, mode=mode).eyes
    result = reprojected(passes, source, target, accuracy=SETTINGS[accuracy], interpolation=interpolation)
    whole(result, source)
    low, high = (
        extreme(passes["Combined"][np.isfinite(passes["Combined"])], initial=0.0) for extreme in (np.min, np.max)
    )
    assert result.passes["Combined"].min() >= low
    assert result.passes["Combined"].max() <= high
    invalid = (result.reasons & Reason.INVALID.bit) > 0
    if np.isfinite(value):
        assert not invalid.any()
        return
    # None of what is not flagged takes anything from a pixel that is no number.
    beside = [chosen[np.clip(y, 0, SIZE[1] - 1), np.clip(x, 0, SIZE[0] - 1)] for y, x in _looked_at(result)]
    assert not (np.any(beside, axis=0) & (result.reasons == 0)).any()
    assert invalid.any()


def _looked_at(result):
    """Row and column of the four pixels that a bilinear lookup takes from, less those of no weight."""
    x, y = (np.where(result.warp.covered, p, 0.5) for p in (result.warp.x, result.warp.y))
    for right in (-0.499, 0.499):
        for down in (-0.499, 0.499):
            yield np.floor(y + down).astype(int), np.floor(x + right).astype(int)


def test_contain_says_what_it_has_cleaned():
    passes = passes_of(np.resize(np.float32(BROKEN), (3, 3)))
    passes["Combined"][0, 0, 2], passes["Combined"][2, 1, 3] = np.nan, np.inf
    with nothing_said():
        clean, invalid = replace_non_finite(passes)
    assert np.isnan(clean["Depth"]).all()
    assert np.argwhere(invalid).tolist() == [[0, 0], [2, 1]]
    assert clean["Combined"][0, 0, 2] == clean["Combined"][2, 1, 3] == 0.0


# Sizes


SIZES = [(1, 1), (1, 7), (7, 1), (1, 40), (40, 1), (2, 2), (3, 5), (15, 2), (17, 33), (33, 17), (97, 31), (31, 16)]


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("mode", ["off-axis", "toe-in"])
@pytest.mark.parametrize("scale", [None, 5.0])
@pytest.mark.parametrize("interpolation", ["linear", "cubic"])
def test_pictures_of_any_size(size, mode, scale, interpolation):
    source, target = Rig(size=size, mode=mode, scale=scale).eyes
    rng = np.random.default_rng(8)
    for depth in (rng.uniform(1, 5, size[::-1]), np.full(size[::-1], 2.0), np.full(size[::-1], np.inf)):
        for accuracy in ("balanced", "exact"):
            whole(
                reprojected(passes_of(depth), source, target, accuracy=SETTINGS[accuracy], interpolation=interpolation),
                source,
            )
            by_place = flagged_by_place(accuracy)
            result = reprojected(passes_of(depth), source, target, accuracy=by_place, interpolation=interpolation)
            lands(depth, result, source, target)
    # Of fewer pixels the perspective within one is not known, by which eyes that are toed in may be off.
    if scale is None and (mode == "off-axis" or min(size) > 2):
        # Of a single row or column nobody knows how it slants.
        slants = [(0.0, 0.0, 1.0), (0.3, 0.2, 1.0)][: min(size)]
        for wall in (Plane((0.0, 0.0, -2.6), slant) for slant in slants):
            result = judged(World((wall,)), source, target)
            assert not result.wrong.any(), result.worst
    elif scale is None:
        result = judged(World((Plane((0.0, 0.0, -2.6)),)), source, target)
        told = ~result.flagged & ~result.unknown
        assert result.off[told].max(initial=0.0) < WITHIN_ONE


@pytest.mark.parametrize("mode", ["off-axis", "toe-in"])
def test_a_picture_16384_wide(mode):
    world = World((Plane((0.0, -1.5, 0.0), (0.0, 1.0, 0.0)), Sphere((0.1, 0.0, -3.0), 0.01)))
    source, target = Rig(size=(16384, 12), mode=mode, lens=35.0).eyes
    result = judged(world, source, target)
    assert not result.wrong.any(), result.worst
    assert result.flagged.mean() < 0.1


# Patterns


def comb(x, _):
    return np.where(x % 2 < 1, 1.5, 4.0)


def slats(x, _):
    return np.where(x % 7 < 1, 1.5, 4.0)


def chequers(x, y):
    return np.where((x + y) % 2 < 1, 1.5, 4.0)


def blocks(x, y):
    return np.where((x // 16 + y // 16) % 2 < 1, 1.5, 4.0)


def every_step(x, y):
    """A step in each row, of every height from some thousandths of a pixel to ten."""
    return 1.0 / (0.25 + np.where(x > 45, 1.0, 0.0) * 1.2 * 10.0 ** (-3.5 * (1.0 - y / SIZE[1])))


def rows(_, y):
    return np.where(y % 2 < 1, 1.5, 4.0)


@pytest.mark.parametrize("pattern", [comb, slats, chequers, blocks, every_step, rows])
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("swapped", [False, True])
def test_patterns(pattern, mode, swapped):
    source, target = Rig(size=SIZE, mode=mode).eyes[:: -1 if swapped else 1]
    x, y = np.meshgrid(np.arange(SIZE[0]), np.arange(SIZE[1]))
    depth = pattern(x, y).astype(np.float32)
    result = reprojected(passes_of(depth), source, target)
    whole(result, source)
    lands(depth, result, source, target)
    if pattern in (comb, chequers):
        assert (result.reasons != 0).all(), "nothing in them can be told from noise"
        assert result.grid.subdivided.all()


@pytest.mark.parametrize("pattern", [blocks, every_step, slats])
@pytest.mark.parametrize("mode", ["off-axis", "parallel"])
@pytest.mark.parametrize("swapped", [False, True])
def test_no_step_is_smeared_over(pattern, mode, swapped):
    """What is told of lies on one side or the other of every step that counts; lower ones are no edges."""
    source, target = Rig(size=SIZE, mode=mode).eyes[:: -1 if swapped else 1]
    depth = pattern(*np.meshgrid(np.arange(SIZE[0]), np.arange(SIZE[1])))
    result = reprojected(passes_of(depth), source, target)
    per_nearness, nearness = row_disparity_of(source, target).per_nearness, 1.0 / depth
    row, column = np.nonzero(result.reasons == 0)
    left, right, along = beside(result.warp.x[row, column], source.width)
    step = np.abs(per_nearness * (nearness[row, right] - nearness[row, left]))
    between = (along > SAME_PLACE) & (along < 1.0 - SAME_PLACE)
    assert step[between].max(initial=0.0) <= STRICT.silhouette_step
    if pattern is every_step:
        height = np.abs(per_nearness) * np.abs(nearness[:, 46] - nearness[:, 45])
        assert height.min() < 0.1 * STRICT.silhouette_step
        assert height.max() > 8.0
        flagged = ((result.reasons & ~Reason.OUTSIDE.bit) != 0).any(axis=1)
        # A band of some pixels around each edge is.
        first = int(np.argmax(height >= STRICT.silhouette_step)) - STRICT.silhouette_radius
        np.testing.assert_array_equal(flagged, np.arange(SIZE[1]) >= first)


@pytest.mark.parametrize("mode", MODES)
def test_slats_are_never_lost(mode):
    """One pixel wide, six apart: where each of them lands is flagged."""
    source, target = Rig(size=SIZE, mode=mode).eyes
    x, y = np.meshgrid(np.arange(SIZE[0]), np.arange(SIZE[1]))
    depth = slats(x, y)
    result = reprojected(passes_of(depth), source, target)
    at_x, at_y = (p[depth == 1.5] for p in where_they_go(source, target, np.full(depth.shape, 1.5)))
    inside = (at_x > 0) & (at_x < SIZE[0]) & (at_y > 0) & (at_y < SIZE[1])
    assert (result.reasons[at_y[inside].astype(int), at_x[inside].astype(int)] != 0).all()


def test_all_hole_and_no_hole():
    source, target = Rig(size=SIZE).eyes
    assert (reprojected(passes_of(np.full(SIZE[::-1], np.nan)), source, target).reasons == Reason.OUTSIDE.bit).all()
    depth = np.random.default_rng(9).uniform(0.5, 5.0, SIZE[::-1])
    same = reprojected(passes_of(np.where(depth < 1.0, np.inf, depth)), source, source)
    assert not same.reasons.any()
    x, y = pixel_centres(source)
    np.testing.assert_array_equal(same.warp.x, x)
    np.testing.assert_array_equal(same.warp.y, y)
