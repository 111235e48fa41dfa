"""The forward warp: where each target pixel comes from, held against closed forms and against the scene itself.

Most scenes here are reliefs: a depth for every position (x, y) of the source picture, between pixels as well, so that
whatever the warp says about a pixel can be projected again and must land on it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

from stereo_reproject.views.camera import OrthographicCamera, target_px_from_source_px
from stereo_reproject.views.parallax import ARC_MINUTE
from stereo_reproject.warp.forward import forward_warp
from stereo_reproject.warp.grid import build_grid
from tests.warp.analytic import FOCAL, camera, focal_px, pixel_centres, pose, stereo_rig

SIZE = (93, 70)

NATIVE_TOLERANCE = 4e-3
"""Pixels: float32 positions up to some hundreds (3e-5), the thousandth of a quad by which triangles overlap, and the
perspective within one pixel."""

COARSE_PERSPECTIVE = 0.06
"""Pixels: where the image planes do not coincide, a line's points are not spread evenly, and over 16 of
them it shows."""

BENT_TOLERANCE = 0.03
"""Pixels: on a surface that bends, a native quad is a pair of triangles: 1/8 of the second difference of disparity."""

CRACKS = 2e-4
"""Share of pixels lost where a coarse edge, straight, meets a fine one that follows the surface to within the
threshold: none at the threshold 0."""

ANY_POSE = pose((0.07, -0.05, 0.06), yaw=0.03, pitch=-0.02, roll=0.08)


def pair(kind, size=SIZE, target_size=None):
    """Source and target camera by name."""
    target_size = target_size or size
    if kind == "general":
        return camera(size), camera(target_size, ANY_POSE)
    if kind == "orthographic general":
        return camera(size, orthographic=True), camera(target_size, ANY_POSE, orthographic=True)
    if kind == "from orthographic":
        return camera(size, orthographic=True), camera(target_size, pose((0.0, 0.0, 2.0)))
    if kind == "to orthographic":
        return camera(size), camera(target_size, pose((0.05, 0.0, 0.0), yaw=0.02), orthographic=True)
    orthographic = kind.startswith("orthographic ")
    rig = stereo_rig(
        size, mode=kind.removeprefix("orthographic "), ipd=0.12, convergence=3.5, orthographic=orthographic
    )
    return rig["left"], rig["right"]


PERSPECTIVE = ["off-axis", "parallel", "toe-in", "general"]
ORTHOGRAPHIC = ["orthographic parallel", "orthographic toe-in", "orthographic general"]
MIXED = ["from orthographic", "to orthographic"]


def warp_of(depth, source, target, *, threshold=0.0, torn=None):
    """The warp of a depth map; torn: indices (H, W) of surfaces, the map is cut between different ones.

    threshold: of the grid, in arc minutes; None draws every pixel.
    """
    torn = np.zeros(depth.shape, int) if torn is None else torn
    depth = depth.astype(np.float32)
    grid = build_grid(depth, source, target, threshold=threshold or 0.0)
    if threshold is None:
        grid = replace(grid, subdivided=np.ones_like(grid.subdivided))
    cuts = {"cut_right": np.diff(torn, axis=1) != 0, "cut_down": np.diff(torn, axis=0) != 0}
    return forward_warp(depth, source, target, grid, **cuts)


@dataclass(frozen=True)
class Relief:
    """Surfaces over the source picture, each linear in its camera's nearness plus some waves; the last one wins.

    slopes: (K, 3) nearness at the middle, and its change per picture width and height. discs: (K, 3) middle and
    radius in picture widths of where a surface is; the first is everywhere.
    """

    source: object
    slopes: np.ndarray
    discs: np.ndarray
    waves: np.ndarray  # (M, 4) amplitude, radians per picture width right and down, phase

    def index(self, x, y):
        u, v = x / self.source.width, y / self.source.width
        result = np.zeros(np.shape(x), int)
        for k, (middle_u, middle_v, radius) in enumerate(self.discs[1:], start=1):
            result[np.hypot(u - middle_u, v - middle_v) < radius] = k
        return result

    def nearness(self, x, y, index):
        u, v = x / self.source.width, y / self.source.width
        base, along_u, along_v = np.moveaxis(self.slopes[index], -1, 0)
        total = base + along_u * (u - 0.5) + along_v * (v - 0.35)
        for amplitude, per_u, per_v, phase in self.waves:
            total = total + amplitude * np.sin(per_u * u + per_v * v + phase)
        return total

    def depth(self, x, y, index=None):
        index = self.index(x, y) if index is None else index
        return self.source.depth_from_nearness(self.nearness(x, y, index))


def random_relief(source, seed, *, surfaces=1, waves=0):
    """Depths of about 3 to 8; an orthographic camera's nearness is minus the depth."""
    rng = np.random.default_rng(seed)
    orthographic = isinstance(source, OrthographicCamera)
    middle = rng.uniform(-7.0, -4.0, surfaces) if orthographic else 1.0 / rng.uniform(4.0, 7.0, surfaces)
    scale = 1.0 if orthographic else 0.05
    slopes = np.column_stack([middle, *rng.uniform(-scale, scale, (2, surfaces))])
    discs = np.column_stack(
        [rng.uniform(0, 1, surfaces), rng.uniform(0, 0.75, surfaces), rng.uniform(0.05, 0.25, surfaces)]
    )
    amplitude = rng.uniform(0.2, 1.0, waves) * (0.1 if orthographic else 0.005)
    bends = np.column_stack([amplitude, *rng.uniform(-14, 14, (2, waves)), rng.uniform(0, 6, waves)])
    return Relief(source, slopes, discs, bends)


def known(warp, source, margin=0.5):
    """(H, W): covered, and by default not from the rim beyond the source's outermost pixel centres.

    There the border's depth stands in for the real one.
    """
    with np.errstate(invalid="ignore"):
        across = (warp.x >= margin) & (warp.x <= source.width - margin)
        return warp.covered & across & (warp.y >= margin) & (warp.y <= source.height - margin)


def landing_error(warp, relief, target, index, margin=0.5):
    """Pixels, of the `known` ones: from the centre to where what the warp shows there really appears."""
    chosen = known(warp, relief.source, margin)
    x, y = warp.x[chosen].astype(np.float64), warp.y[chosen].astype(np.float64)
    depth = relief.depth(x, y, index(x, y))
    target_x, target_y, _ = target_px_from_source_px(relief.source, target, x, y, depth)
    centre_x, centre_y = pixel_centres(target)
    return np.hypot(target_x - centre_x[chosen], target_y - centre_y[chosen])


def nearest_pixel_s(relief):
    """Index of the surface that the pixel under a position shows: its centre decides, not the position."""
    return lambda x, y: relief.index(np.floor(x) + 0.5, np.floor(y) + 0.5)


# Without a baseline


@pytest.mark.parametrize("mode", ["off-axis", "parallel", "toe-in"])
@pytest.mark.parametrize("orthographic", [False, True])
@pytest.mark.parametrize("size", [(64, 48), (63, 47), (17, 33), (5, 3)])
@pytest.mark.parametrize("torn", [False, True])
def test_without_a_baseline_the_warp_is_the_identity_to_float32_rounding(mode, orthographic, size, torn):
    """Whatever the depths are, sky included, and drawn coarse as well as fine: a NaN far off makes cells fine."""
    rig = stereo_rig(size, mode=mode, ipd=0.0, orthographic=orthographic)
    depth = np.random.default_rng(4).uniform(0.5, 80.0, size[::-1])
    depth[: size[1] // 3] = np.inf
    if torn:
        depth[-1, -1] = np.nan
    warp = warp_of(depth, rig["left"], rig["right"])
    x, y = pixel_centres(rig["left"])
    covered = warp.covered
    lost = np.argwhere(~covered)
    assert torn == (len(lost) > 0)
    assert np.all(lost >= np.array(depth.shape) - 2), "no further from the unknown corner than one quad"
    rounding = np.spacing(np.float32(max(size)))
    np.testing.assert_allclose(warp.x[covered], x[covered], rtol=0, atol=rounding)
    np.testing.assert_allclose(warp.y[covered], y[covered], rtol=0, atol=rounding)


# Planes


@pytest.mark.parametrize("threshold", [0.0, 1.0])
@pytest.mark.parametrize("kind", ["off-axis", "parallel", "orthographic parallel"])
def test_a_frontal_plane_moves_as_a_whole(kind, threshold):
    source, target = pair(kind)
    warp = warp_of(np.full(SIZE[::-1], 2.5), source, target, threshold=threshold)
    x, y = pixel_centres(target)
    shift = {
        "off-axis": focal_px(SIZE) * 0.12 * (1 / 2.5 - 1 / 3.5),
        "parallel": focal_px(SIZE) * 0.12 / 2.5,
        "orthographic parallel": 0.12 * SIZE[0] / 5.0,
    }[kind]
    inside = x + shift < SIZE[0]
    assert warp.covered[inside].all()
    covered = warp.covered
    np.testing.assert_allclose(warp.x[covered], (x + shift)[covered], rtol=0, atol=NATIVE_TOLERANCE)
    np.testing.assert_allclose(warp.y[covered], y[covered], rtol=0, atol=NATIVE_TOLERANCE)
    nearness = target.nearness_from_depth(np.float64(2.5))
    np.testing.assert_allclose(warp.nearness[covered], nearness, rtol=1e-6)


@pytest.mark.parametrize("kind", [*PERSPECTIVE, *ORTHOGRAPHIC, *MIXED])
@pytest.mark.parametrize("seed", [1, 2])
def test_a_slanted_plane_follows_its_homography(kind, seed):
    source, target = pair(kind)
    relief = random_relief(source, seed)
    warp = warp_of(relief.depth(*pixel_centres(source)), source, target, threshold=None)
    assert landing_error(warp, relief, target, nearest_pixel_s(relief)).max() < NATIVE_TOLERANCE
    assert warp.covered.mean() > 0.5


@pytest.mark.parametrize("kind", [*PERSPECTIVE, *ORTHOGRAPHIC])
@pytest.mark.parametrize("seed", [1, 2])
def test_coarse_cells_hold_a_slanted_plane(kind, seed):
    """On a plane two triangles are as good as 512, but for the perspective within them: drawn here by main force."""
    source, target = pair(kind)
    relief = random_relief(source, seed)
    warp = warp_of(relief.depth(*pixel_centres(source)), source, target, threshold=1e6)
    # The frame's outermost cells have the border's repeated depth in a corner.
    error = landing_error(warp, relief, target, nearest_pixel_s(relief), margin=17)
    assert error.max() < (COARSE_PERSPECTIVE if kind in ("toe-in", "general") else NATIVE_TOLERANCE)
    assert error.size > 1000


# Surfaces that bend


@pytest.mark.parametrize("kind", [*PERSPECTIVE, *ORTHOGRAPHIC])
@pytest.mark.parametrize("seed", [3, 4])
def test_a_bent_surface_lands_on_its_pixels(kind, seed):
    source, target = pair(kind)
    relief = random_relief(source, seed, waves=4)
    warp = warp_of(relief.depth(*pixel_centres(source)), source, target)
    assert landing_error(warp, relief, target, nearest_pixel_s(relief)).max() < BENT_TOLERANCE


@pytest.mark.parametrize("threshold", [0.5, 1.0, 3.0])
@pytest.mark.parametrize("kind", ["off-axis", "parallel"])
@pytest.mark.parametrize("seed", [3, 4, 5])
def test_coarse_cells_stay_within_what_the_threshold_promises(kind, threshold, seed):
    """A cell is coarse when its depths' disparities differ by no more than the threshold: then so do its pixels."""
    size = (200, 120)
    source, target = pair(kind, size)
    relief = random_relief(source, seed, waves=3)
    depth = relief.depth(*pixel_centres(source))
    promised = threshold * ARC_MINUTE * focal_px(size) * 1.001  # the angle and its tangent
    coarse = ~build_grid(depth, source, target, threshold=threshold).subdivided
    warp = warp_of(depth, source, target, threshold=threshold)
    error = landing_error(warp, relief, target, nearest_pixel_s(relief))
    assert error.max() < promised + BENT_TOLERANCE
    if threshold == 3.0:
        assert coarse.any(), "the test is about coarse cells"


@pytest.mark.parametrize("kind", [*PERSPECTIVE, *ORTHOGRAPHIC])
@pytest.mark.parametrize("threshold", [0.0, 1.0])
@pytest.mark.parametrize("seed", [6, 7, 8])
def test_smooth_surfaces_are_watertight(kind, threshold, seed):
    """Every target pixel that sees the surface, whatever its depth there, well inside the source's frame, is drawn."""
    size = (190, 130)
    source, target = pair(kind, size)
    relief = random_relief(source, seed, waves=4)
    depth = relief.depth(*pixel_centres(source))
    warp = warp_of(depth, source, target, threshold=threshold)
    x, y = pixel_centres(target)
    inside = np.ones(x.shape, bool)
    for z in np.linspace(0.95 * depth.min(), 1.05 * depth.max(), 15):
        source_x, source_y, _ = target_px_from_source_px(target, source, x, y, z)
        inside &= (source_x > 0) & (source_x < size[0]) & (source_y > 0) & (source_y < size[1])
    assert inside.mean() > 0.5
    assert np.mean(~warp.covered[inside]) <= (CRACKS if threshold > 0 else 0.0)


# The frame


@pytest.mark.parametrize("part", np.linspace(-0.9, 0.9, 7))
@pytest.mark.parametrize("sign", [-1, 1])
def test_the_frame_s_outer_half_pixels_are_covered(part, sign):
    """A target pixel that sees the source's frame up to its very edge, beyond the last pixel's centre, is covered."""
    ipd = abs(3 + part) * 2.0 / focal_px(SIZE)
    rig = stereo_rig(SIZE, mode="parallel", ipd=ipd)
    source, target = (rig["left"], rig["right"]) if sign > 0 else (rig["right"], rig["left"])
    warp = warp_of(np.full(SIZE[::-1], 2.0), source, target)
    x, _ = pixel_centres(target)
    seen = x + sign * (3 + part)
    assert warp.covered[(seen > 0) & (seen < SIZE[0])].all()
    beyond = (seen < -0.5 - NATIVE_TOLERANCE) | (seen > SIZE[0] + 0.5 + NATIVE_TOLERANCE)
    assert not warp.covered[beyond].any()


@pytest.mark.parametrize("target_size", [(140, 110), (50, 30), (93, 30), (140, 40)])
@pytest.mark.parametrize("threshold", [0.0, 1.0])
def test_the_target_s_frame_may_be_larger_or_smaller(target_size, threshold):
    source = camera(SIZE)
    whole = camera(target_size, ANY_POSE)
    # The same pixels per radian as the source has.
    scale = target_size[0] / SIZE[0]
    plane = type(whole.plane)(*(scale * edge for edge in vars(whole.plane).values()))
    target = type(whole)(*target_size, ANY_POSE, plane)
    relief = random_relief(source, 9)
    warp = warp_of(relief.depth(*pixel_centres(source)), source, target, threshold=threshold)
    assert warp.x.shape == target_size[::-1]
    assert (
        landing_error(warp, relief, target, nearest_pixel_s(relief)).max()
        < NATIVE_TOLERANCE + COARSE_PERSPECTIVE * threshold
    )
    x, y = pixel_centres(target)
    # The plane itself, from the target: nearness is linear over its picture too, so three pixels give it.
    fit = np.linalg.lstsq(
        np.column_stack([x[warp.covered], y[warp.covered], np.ones(warp.covered.sum())]),
        warp.nearness[warp.covered].astype(np.float64),
        rcond=None,
    )[0]
    source_x, source_y, _ = target_px_from_source_px(target, source, x, y, 1.0 / (fit[0] * x + fit[1] * y + fit[2]))
    margin = 0.05
    inside = (source_x > margin) & (source_x < SIZE[0] - margin) & (source_y > margin) & (source_y < SIZE[1] - margin)
    assert warp.covered[inside].all()


@pytest.mark.parametrize("resolution", [0.5, 1.4])
def test_the_target_s_pixels_may_be_larger_or_smaller(resolution):
    source = camera(SIZE)
    target = camera((int(SIZE[0] * resolution), int(SIZE[1] * resolution)), ANY_POSE)
    relief = random_relief(source, 9)
    warp = warp_of(relief.depth(*pixel_centres(source)), source, target)
    assert landing_error(warp, relief, target, nearest_pixel_s(relief)).max() < NATIVE_TOLERANCE
    assert warp.covered.mean() > 0.8


# Sky and unknown depths


@pytest.mark.parametrize("mode", ["off-axis", "parallel", "toe-in"])
@pytest.mark.parametrize("threshold", [0.0, 1.0])
def test_the_sky_is_a_surface_at_infinity(mode, threshold):
    source, target = pair(mode)
    warp = warp_of(np.full(SIZE[::-1], np.inf), source, target, threshold=threshold)
    x, y = pixel_centres(target)
    sky_x, sky_y, _ = target_px_from_source_px(target, source, x, y, np.inf)
    inside = (sky_x > 0) & (sky_x < SIZE[0]) & (sky_y > 0) & (sky_y < SIZE[1])
    assert warp.covered[inside].all()
    covered = warp.covered
    np.testing.assert_allclose(warp.x[covered], sky_x[covered], rtol=0, atol=COARSE_PERSPECTIVE)
    assert np.all(np.isposinf(target.depth_from_nearness(warp.nearness[covered])))


@pytest.mark.parametrize("orthographic", [False, True])
def test_the_sky_is_behind_everything(orthographic):
    rig = stereo_rig(SIZE, mode="parallel", ipd=0.3, orthographic=orthographic)
    source, target = rig["left"], rig["right"]
    x, _ = pixel_centres(source)
    for near in (2.0, 1e5):
        ball = np.abs(x - 50) < 12
        warp = warp_of(np.where(ball, near, np.inf), source, target, torn=ball.astype(int), threshold=None)
        depth = target.depth_from_nearness(warp.nearness.astype(np.float64))
        shown = np.isfinite(depth) & warp.covered
        assert 22 * SIZE[1] <= shown.sum() <= 24 * SIZE[1], "the sky hides none of it"
        np.testing.assert_allclose(depth[shown], near, rtol=1e-6)


@pytest.mark.parametrize("place", [(30, 40), (0, 40), (30, 92), (69, 0)])
@pytest.mark.parametrize("kind", ["off-axis", "general", "orthographic parallel"])
def test_an_unknown_depth_stays_a_hole_and_spreads_no_further_than_its_quads(kind, place):
    source, target = pair(kind)
    depth = np.full(SIZE[::-1], 3.0)
    whole = warp_of(depth, source, target, threshold=None)
    depth[place] = np.nan
    warp = warp_of(depth, source, target, threshold=None)
    away = np.maximum(np.abs(whole.x - (place[1] + 0.5)), np.abs(whole.y - (place[0] + 0.5)))
    assert not warp.covered[away < 1.0 - 2 * NATIVE_TOLERANCE].any()
    beyond = whole.covered & (away > 1.0 + 2 * NATIVE_TOLERANCE)
    on_border = place[0] in (0, 69) or place[1] in (0, 92)
    if on_border:  # there the ring outside the frame repeats it
        beyond &= (whole.x > 0) & (whole.x < SIZE[0]) & (whole.y > 0) & (whole.y < SIZE[1])
    assert warp.covered[beyond].all()
    np.testing.assert_array_equal(warp.x[beyond], whole.x[beyond])
    np.testing.assert_array_equal(warp.y[beyond], whole.y[beyond])


def test_nothing_known_leaves_nothing():
    for kind in ("off-axis", "orthographic toe-in"):
        warp = warp_of(np.full(SIZE[::-1], np.nan), *pair(kind))
        assert not warp.covered.any()
        assert np.isnan(warp.x).all()
        assert np.isnan(warp.y).all()


# Tears and the depth test


def post(nearness_behind, nearness_post, left, right):
    """A frontal post over a frontal wall, by source column; depth (H, W) and index."""
    x = np.arange(SIZE[0]) + 0.5
    index = np.broadcast_to(((x > left) & (x < right)).astype(int), SIZE[::-1])
    return 1.0 / np.where(index, nearness_post, nearness_behind), index


@pytest.mark.parametrize("step", [1.3, 2.5, 4.75, 9.1])
@pytest.mark.parametrize("to_the_right", [True, False])
def test_a_tear_uncovers_a_strip_as_wide_as_the_step_in_disparity(step, to_the_right):
    """The target sees behind the post on its own side: there a strip of the wall was hidden from the source."""
    rig = stereo_rig(SIZE, mode="parallel", ipd=0.1)
    source, target = (rig["left"], rig["right"]) if to_the_right else (rig["right"], rig["left"])
    per_nearness = focal_px(SIZE) * 0.1
    behind = 3.2 / per_nearness
    in_front = behind + step / per_nearness
    depth, index = post(behind, in_front, 40, 60)
    warp = warp_of(depth, source, target, torn=index)
    x, _ = pixel_centres(target)
    inside = (x > 15) & (x < SIZE[0] - 15)
    holes = ~warp.covered & inside
    # The torn quad itself is one pixel wide; a strip of any width has a whole number of pixel centres.
    count = holes.sum(axis=1)
    assert np.all(np.abs(count - (step + 1.0)) < 1.0)
    edge = 60 - (3.2 + step) if to_the_right else 40 + (3.2 + step)
    strip = x[holes]
    assert np.all((strip > edge - 1) if to_the_right else (strip < edge + 1)), "on the side that the target sees"


@pytest.mark.parametrize("kind", ["off-axis", "toe-in", "general"])
def test_nothing_is_smeared_across_a_tear(kind):
    """No pixel shows a depth between the post's and the wall's, nor a place between their pixels."""
    source, target = pair(kind)
    depth, index = post(0.15, 0.5, 40, 60)
    warp = warp_of(depth, source, target, torn=index, threshold=None)
    covered = warp.covered
    x, y = warp.x[covered].astype(np.float64), warp.y[covered].astype(np.float64)
    for left in (40, 60):
        assert not np.any((x > left - 0.5 + NATIVE_TOLERANCE) & (x < left + 0.5 - NATIVE_TOLERANCE))
    shown = 1.0 / np.where((x > 40) & (x < 60), 0.5, 0.15)
    target_x, target_y, _ = target_px_from_source_px(source, target, x, y, shown)
    centre_x, centre_y = pixel_centres(target)
    assert np.hypot(target_x - centre_x[covered], target_y - centre_y[covered]).max() < NATIVE_TOLERANCE


ROWS = 0.37
"""Pixels by which rows are moved in the brute-force test, so that no centre lies on the edge of a quad."""


def expected_nearness(index, nearness, disparity, width):
    """By brute force, for frontal surfaces and image planes that coincide: the nearest that each target pixel shows.

    index (H, W) of the surfaces; nearness, disparity (K,). A surface shows at a target pixel when all four corners of
    the source quad there are on it.
    """
    height = index.shape[0]
    ring = np.pad(index, 1, mode="edge")
    result = np.full((height, width), -np.inf)
    for i in range(height):
        for j in range(width):
            for k, shift in enumerate(disparity):
                # A ring's vertex m is at position m - 0.5.
                row, column = int(np.floor(i + 0.5 + ROWS + 0.5)), int(np.floor(j + 0.5 + shift + 0.5))
                if 0 <= column < ring.shape[1] - 1 and np.all(ring[row : row + 2, column : column + 2] == k):
                    result[i, j] = max(result[i, j], nearness[k])
    return result


@pytest.mark.parametrize("seed", range(4))
def test_the_nearest_surface_wins_by_brute_force(seed):
    rng = np.random.default_rng(seed)
    size = (48, 32)
    rig = stereo_rig(size, mode="off-axis", ipd=0.2, convergence=4.0)
    plane = rig["right"].plane
    lower = ROWS / focal_px(size)
    target = replace(rig["right"], plane=replace(plane, top=plane.top - lower, bottom=plane.bottom - lower))
    x, y = pixel_centres(rig["left"])
    nearness = np.float32(1.0 / rng.uniform(1.0, 8.0, 7)).astype(np.float64)
    index = np.zeros(x.shape, int)
    for k in range(1, nearness.size):
        u, v, radius = rng.uniform(0, 48), rng.uniform(0, 32), rng.uniform(2, 9)
        index[np.maximum(np.abs(x - u), np.abs(y - v)) < radius] = k
    disparity = focal_px(size) * 0.2 * (nearness - 1.0 / 4.0)
    warp = warp_of(1.0 / nearness[index], rig["left"], target, torn=index)
    expected = expected_nearness(index, nearness, disparity, size[0])
    np.testing.assert_array_equal(warp.covered, np.isfinite(expected))
    np.testing.assert_allclose(warp.nearness, expected, rtol=1e-5)


@pytest.mark.parametrize("kind", [*PERSPECTIVE, *ORTHOGRAPHIC, *MIXED])
@pytest.mark.parametrize("seed", range(10, 16))
def test_random_scenes_every_covered_pixel_lands_on_itself(kind, seed):
    """Slanted discs over a slanted wall, cut along their edges: position, surface and depth belong together."""
    source, target = pair(kind)
    relief = random_relief(source, seed, surfaces=7)
    x, y = pixel_centres(source)
    index = relief.index(x, y)
    warp = warp_of(relief.depth(x, y, index), source, target, torn=index, threshold=None)
    assert landing_error(warp, relief, target, nearest_pixel_s(relief)).max() < NATIVE_TOLERANCE
    covered = known(warp, source)
    shown_x, shown_y = warp.x[covered].astype(np.float64), warp.y[covered].astype(np.float64)
    depth = relief.depth(shown_x, shown_y, nearest_pixel_s(relief)(shown_x, shown_y))
    _, _, target_depth = target_px_from_source_px(source, target, shown_x, shown_y, depth)
    shown = target.depth_from_nearness(warp.nearness[covered].astype(np.float64))
    # Depth changes by about 3 % over a pixel of the steepest of these surfaces; positions are good to 2e-3 of one.
    np.testing.assert_allclose(shown, target_depth, rtol=1e-3)
    assert covered.mean() > 0.4


@pytest.mark.parametrize("seed", range(20, 24))
def test_random_scenes_with_coarse_cells_stay_within_the_threshold(seed):
    """Surfaces that differ by less than the threshold may share a coarse cell; then a pixel is off by that much."""
    size = (200, 130)
    source, target = pair("off-axis", size)
    relief = random_relief(source, seed, surfaces=5, waves=1)
    relief.slopes[1:, 0] = relief.slopes[0, 0] + np.array([0.0, 0.01, 0.0, 0.1])
    relief.slopes[1:, 1:] = relief.slopes[0, 1:]
    x, y = pixel_centres(source)
    index = relief.index(x, y)
    warp = warp_of(relief.depth(x, y, index), source, target, torn=index, threshold=1.0)
    promised = ARC_MINUTE * FOCAL * size[0] * 1.001
    assert landing_error(warp, relief, target, nearest_pixel_s(relief)).max() < promised + BENT_TOLERANCE


@pytest.mark.parametrize("near_is_coarse", [True, False])
def test_what_is_near_stays_in_front_whether_it_is_drawn_coarse_or_fine(near_is_coarse):
    """Coarse cells are drawn before fine ones: neither may win by that."""
    size = (208, 128)
    rig = stereo_rig(size, mode="parallel", ipd=1.0)
    x, y = pixel_centres(rig["left"])
    block = (x > 100) & (x < 190) & (y > 16) & (y < 112)
    steep, level = 0.01 * (x - 150), 0.0 * x
    disparity = np.where(block, 70 + (level if near_is_coarse else steep), 2 + (steep if near_is_coarse else level))
    depth = focal_px(size) / disparity
    coarse = ~build_grid(depth.astype(np.float32), rig["left"], rig["right"], threshold=1.0).subdivided
    assert coarse[3:6, 8:10].all() == near_is_coarse
    assert coarse[3:6, 2:5].all() != near_is_coarse
    warp = warp_of(depth, rig["left"], rig["right"], torn=block.astype(int), threshold=1.0)
    covered_by_the_block = (x > 32) & (x < 117) & (y > 18) & (y < 110)
    shown = warp.nearness * focal_px(size)
    assert shown[covered_by_the_block].min() > 60


def test_a_cut_tears_the_quads_on_both_of_its_sides():
    """Given by itself, one cut between two pixels leaves out the two quads that share it, and no other."""
    rig = stereo_rig(SIZE, mode="parallel", ipd=0.1)
    target = rig["right"]
    plane = target.plane
    lower = ROWS / focal_px(SIZE)
    target = replace(target, plane=replace(plane, top=plane.top - lower, bottom=plane.bottom - lower))
    depth = np.full(SIZE[::-1], 2.5, np.float32)
    grid = build_grid(depth, rig["left"], target, threshold=1.0)
    grid = replace(grid, subdivided=np.ones_like(grid.subdivided))
    right, down = np.zeros((70, 92), bool), np.zeros((69, 93), bool)
    whole = forward_warp(depth, rig["left"], target, grid, cut_right=right, cut_down=down)
    for cut, left, top, wide, high in ((right, 40.5, 29.5, 1, 2), (down, 39.5, 30.5, 2, 1)):
        cut[30, 40] = True
        torn = forward_warp(depth, rig["left"], target, grid, cut_right=right, cut_down=down)
        cut[30, 40] = False
        lost = whole.covered & ~torn.covered
        expected = (whole.x > left) & (whole.x < left + wide) & (whole.y > top) & (whole.y < top + high)
        np.testing.assert_array_equal(lost, expected)
        assert lost.sum() == 2


@pytest.mark.parametrize("order", [1, -1])
def test_the_depth_test_does_not_depend_on_the_order_of_drawing(order):
    """Two posts that cross in the target, the nearer one drawn first or last."""
    rig = stereo_rig(SIZE, mode="parallel", ipd=0.6)
    x, _ = pixel_centres(rig["left"])
    x = x if order > 0 else SIZE[0] - x
    # In the target both stand around column 30: disparities 7 and 27 px.
    index = np.where(np.abs(x - 37) < 5, 1, np.where(np.abs(x - 57) < 5, 2, 0))
    source, target = (rig["left"], rig["right"]) if order > 0 else (rig["right"], rig["left"])
    per_nearness = focal_px(SIZE) * 0.6
    depth = per_nearness / np.array([2.0, 7.0, 27.0])[index]
    warp = warp_of(depth, source, target, torn=index)
    target_x, _ = pixel_centres(target)
    target_x = target_x if order > 0 else SIZE[0] - target_x
    there = np.abs(target_x - 30) < 4
    np.testing.assert_allclose(warp.nearness[there] * per_nearness, 27.0, rtol=1e-5)


@pytest.mark.parametrize("threshold", [None, 1.0])
def test_a_horizontal_edge_uncovers_nothing_where_rows_do_not_move(threshold):
    rig = stereo_rig(SIZE, mode="parallel", ipd=0.1)
    _, y = pixel_centres(rig["left"])
    block = ((y > 20) & (y < 50)).astype(int)
    warp = warp_of(np.where(block, 2.0, 6.0), rig["left"], rig["right"], torn=block, threshold=threshold)
    assert warp.covered[:, 15:-15].all()
