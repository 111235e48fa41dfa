"""Silhouettes: pixels whose own colour is mixed of two sides are traced, and edges of the target alone where their
sides differ."""

from __future__ import annotations

import numpy as np
import pytest

from stereo_reproject.holes.silhouettes import differing, edge_band, mixed_and_contrasting
from stereo_reproject.images.lookup import lookup, touches
from stereo_reproject.images.masks import dilate
from stereo_reproject.images.metrics import tone
from stereo_reproject.images.passes import COLOUR_PASS, DEPTH_PASS
from stereo_reproject.images.reasons import Reason
from stereo_reproject.settings.accuracy import SETTINGS
from stereo_reproject.warp.discontinuities import disparity_steps
from tests.estimate.colours import opaque
from tests.warp.analytic import stereo_rig
from tests.warp.pairs import reproject_pair

SIZE = (80, 120)
EDGE = 60
NOISE = 0.1
TOLERANCE = 2.0
"""Standard deviations of the noise, as the balanced setting has it."""

CHANCE = 0.25
"""Share of pixels that may be judged wrongly: means over a dozen noisy pixels a side miss by a third of a deviation."""


def scene(step: float, seed: int = 1):
    """A wall half of which stands 10 pixels of disparity nearer, and is brighter by `step`; grey, with noise."""
    disparity = np.zeros(SIZE, np.float32)
    disparity[:, EDGE:] = 10.0
    colour = np.full((*SIZE, 4), 0.6, np.float32)
    colour[:, EDGE:] += step
    return disparity, opaque(colour + np.random.default_rng(seed).normal(0.0, NOISE, colour.shape).astype(np.float32))


def judged(step, *, tolerance=TOLERANCE, unknown=None, radius=1):
    disparity, colour = scene(step)
    band = edge_band(disparity_steps(disparity), threshold=0.25, radius=radius)
    unknown = np.zeros(SIZE, bool) if unknown is None else unknown
    return band, differing(band, disparity, colour, tolerance=tolerance, unknown=unknown)


@pytest.mark.parametrize("radius", [0, 1, 2, 3])
def test_the_band_reaches_its_radius_to_either_side(radius):
    disparity, _ = scene(0.0)
    columns = np.nonzero(edge_band(disparity_steps(disparity), threshold=0.25, radius=radius).any(axis=0))[0]
    np.testing.assert_array_equal(columns, np.arange(EDGE - radius, EDGE + radius))


def test_sides_that_look_the_same_are_left_alone():
    band, differs = judged(0.0)
    assert differs[band].mean() < CHANCE


@pytest.mark.parametrize("step", [0.3, -0.3, 5.0])
def test_sides_that_differ_by_more_than_the_noise_are_traced(step):
    band, differs = judged(step)
    assert differs[band].mean() > 1.0 - CHANCE
    assert not np.any(differs & ~band)


def test_black_before_a_transparent_film_differs_by_its_alpha_alone():
    disparity, _ = scene(0.0)
    black = np.zeros((*SIZE, 4), np.float32)
    black[:, EDGE:, 3] = 1.0
    band, nothing = edge_band(disparity_steps(disparity), threshold=0.25, radius=1), np.zeros(SIZE, bool)
    assert differing(band, disparity, black, tolerance=TOLERANCE, unknown=nothing)[band].all()
    assert not differing(band, disparity, black[..., :3], tolerance=TOLERANCE, unknown=nothing)[band].any()


def test_without_a_tolerance_the_whole_band_is_traced():
    band, differs = judged(0.0, tolerance=0.0)
    np.testing.assert_array_equal(differs, band)


def test_beside_what_is_not_known_the_band_stays():
    unknown = np.zeros(SIZE, bool)
    unknown[40, EDGE + 2] = True
    band, differs = judged(0.0, unknown=unknown)
    assert differs[40, EDGE]
    assert not differs[:30][band[:30]].all(), "far from it the sides are compared"


def test_noise_free_sides_of_one_colour_are_alike_and_of_two_are_not():
    disparity, _ = scene(0.0)
    band = edge_band(disparity_steps(disparity), threshold=0.25, radius=1)
    flat = np.full((*SIZE, 4), 0.5, np.float32)
    nothing = np.zeros(SIZE, bool)
    assert not differing(band, disparity, flat, tolerance=TOLERANCE, unknown=nothing).any()
    flat[:, EDGE:] += 0.02
    np.testing.assert_array_equal(differing(band, disparity, flat, tolerance=TOLERANCE, unknown=nothing), band)


# A pixel's own colour


def antialiased(noise=0.0, near=0.9, far=0.3):
    """A nearer half plane whose straight edge runs across the pixels; the share of each that it covers is exact."""
    x = np.arange(SIZE[1] + 1.0)
    edge = EDGE + 0.31 * (np.arange(SIZE[0])[:, None] - 40.0)
    coverage = np.clip(x[1:] - edge, 0.0, 1.0)
    colour = np.repeat((far + (near - far) * coverage)[..., None], 4, axis=-1).astype(np.float32)
    disparity = np.where(coverage > 0.5, 10.0, 0.0).astype(np.float32)
    return disparity, colour + np.random.default_rng(2).normal(0.0, noise, colour.shape).astype(np.float32), coverage


def mixed_of(disparity, colour, tolerance=TOLERANCE):
    band = edge_band(disparity_steps(disparity), threshold=0.25, radius=1)
    nothing = np.zeros(SIZE, bool)
    return band, *mixed_and_contrasting(band, disparity, colour, tolerance=tolerance, unknown=nothing)


def test_of_an_antialiased_edge_exactly_the_mixed_pixels_are_flagged():
    disparity, colour, coverage = antialiased()
    band, mixed, contrasting = mixed_of(disparity, colour)
    # Two hundredths of the other side, which are 0.005 after tone mapping, are seen; a thousandth is not.
    share = np.minimum(coverage, 1.0 - coverage)
    told = band & ((share < 0.001) | (share > 0.02))
    assert told[band].mean() > 0.9
    np.testing.assert_array_equal(mixed[told], share[told] > 0.02)
    assert not np.any(mixed & ~band)
    assert 0.2 < mixed[band].mean() < 0.6
    np.testing.assert_array_equal(contrasting, band)


def test_a_pure_edge_has_no_mixed_pixel():
    disparity, colour, _ = antialiased()
    pure = np.where(disparity[..., None] > 0.0, np.float32(0.9), np.float32(0.3)) + np.zeros_like(colour)
    band, mixed, _ = mixed_of(disparity, pure)
    assert band.any()
    assert not mixed.any()


def test_noise_alone_mixes_next_to_nothing():
    """2.3 % of a normal distribution are two deviations off to one side; means over 20 pixels add a little."""
    disparity, colour = scene(0.5)
    band, mixed, contrasting = mixed_of(disparity, colour)
    assert 0.0 < mixed[band].mean() < 0.06
    assert contrasting[band].mean() < 0.2, "of seven deviations, and not of eight"
    assert not mixed_of(*scene(0.0))[1].any()


def test_a_shade_is_no_noise():
    """One that changes as much over a window as the sides differ: mixed pixels show beside it as beside none."""
    disparity, colour, coverage = antialiased()
    shaded = colour + 0.05 * np.arange(SIZE[0], dtype=np.float32)[:, None, None]
    band, mixed, _ = mixed_of(disparity, shaded)
    half = band & (np.minimum(coverage, 1.0 - coverage) > 0.3)
    assert mixed[half].all()


def test_with_no_tolerance_all_of_the_band_is_mixed():
    disparity, colour, _ = antialiased()
    band, mixed, contrasting = mixed_of(disparity, colour, tolerance=0.0)
    np.testing.assert_array_equal(mixed, band)
    np.testing.assert_array_equal(contrasting, band)


@pytest.mark.parametrize("width", [1, 2])
def test_a_wire_has_no_pixel_of_its_own_and_is_flagged_whole(width):
    disparity, colour = np.zeros(SIZE, np.float32), np.full((*SIZE, 4), 0.3, np.float32)
    disparity[:, EDGE : EDGE + width], colour[:, EDGE : EDGE + width] = 10.0, 0.9
    colour += np.random.default_rng(3).normal(0.0, NOISE, colour.shape).astype(np.float32)
    band, mixed, _ = mixed_of(disparity, colour)
    assert mixed[:, EDGE : EDGE + width].all()
    beside = band.copy()
    beside[:, EDGE : EDGE + width] = False
    assert mixed[beside].mean() < 0.06, "the wall beside it is pure"


# A disc, warped

DISC_SIZE = (120, 90)
DISC, WALL = 2.0, 4.0
DISC_RADIUS = 0.35
DISC_NOISE = 0.06
"""Of a single pixel: the disc's colour is 0.6 brighter than the wall's, seven deviations after tone mapping."""

TRACED_WHEN_SIDES_DECIDED = 406
"""Pixels that `balanced` flagged around the disc when all pixels whose sides differ were: counted with that rule."""


def disc_seen_by(camera, noise):
    """Colour and depth of a disc before a wall, both parallel to the picture: a pixel's share of the disc is its mean
    over 16 x 16 points."""
    fine = 16
    x, y = np.meshgrid((np.arange(camera.width * fine) + 0.5) / fine, (np.arange(camera.height * fine) + 0.5) / fine)
    origin, (right, up, _) = camera.ray_from_px(x, y)
    at = camera.world_from_camera[:3, 3]
    inside = np.hypot(at[0] + origin[0] + DISC * right, at[1] + origin[1] + DISC * up) < DISC_RADIUS
    coverage = inside.reshape(camera.height, fine, camera.width, fine).mean(axis=(1, 3))
    middle = inside[fine // 2 :: fine, fine // 2 :: fine]
    colour = np.ones((*coverage.shape, 4), np.float32)
    colour[..., :3] = (0.2 + 0.6 * coverage)[..., None]
    colour[..., :3] += np.random.default_rng(5).normal(0.0, noise, colour[..., :3].shape).astype(np.float32)
    return {COLOUR_PASS: colour, DEPTH_PASS: np.where(middle, DISC, WALL).astype(np.float32)[..., None]}


def disc_warped(accuracy):
    eyes = stereo_rig(DISC_SIZE, mode="parallel", ipd=0.11, convergence=3.0)
    source = disc_seen_by(eyes["left"], DISC_NOISE)
    nothing = np.zeros(DISC_SIZE[::-1], bool)
    result = reproject_pair(source, eyes["left"], eyes["right"], accuracy=accuracy, invalid=nothing)
    return result, disc_seen_by(eyes["right"], 0.0)[COLOUR_PASS]


def test_around_a_disc_at_most_three_fifths_are_traced_and_the_others_are_right():
    result, truth = disc_warped(SETTINGS["balanced"])
    silhouettes = (result.reasons & Reason.SILHOUETTE.bit) > 0
    assert 0 < silhouettes.sum() <= 0.6 * TRACED_WHEN_SIDES_DECIDED
    noise = DISC_NOISE / (1.0 + truth[..., 0]) ** 2
    error = np.abs(tone(result.passes[COLOUR_PASS]) - tone(truth)).mean(axis=-1) / noise
    beside = dilate((disc_warped(SETTINGS["exact"])[0].reasons & Reason.SILHOUETTE.bit) > 0, 1) & (result.reasons == 0)
    assert beside.sum() > 100
    assert np.sqrt(np.mean(error[beside] ** 2)) < 0.5 * SETTINGS["balanced"].colour_tolerance
    # What is left in each is noise, of which little is beyond two deviations more.
    assert np.mean(error[beside] > SETTINGS["balanced"].colour_tolerance) < 0.01


def test_exact_traces_all_that_touches_the_band_and_looks_up_as_ever():
    result, _ = disc_warped(SETTINGS["exact"])
    (view,) = result.views
    np.testing.assert_array_equal(view.edges.unusable, view.edges.band)
    touched = touches(view.edges.band, result.warp.x, result.warp.y, share=0.02) & (view.warped.empty == 0)
    assert touched.any()
    assert (result.reasons[touched] & Reason.SILHOUETTE.bit).all()
    plain = lookup(view.classifier.source.passes[COLOUR_PASS], result.warp.x, result.warp.y)
    np.testing.assert_array_equal(result.passes[COLOUR_PASS], plain, err_msg="no lookup leaves anything out")


def test_a_pixel_that_touches_mixed_ones_a_little_takes_the_others():
    result, _ = disc_warped(SETTINGS["balanced"])
    (view,) = result.views
    x, y = result.warp.x, result.warp.y
    some = touches(view.edges.unusable, x, y, share=0.02) & ~touches(view.edges.unusable, x, y, share=0.4)
    some &= result.reasons == 0
    assert some.sum() > 10
    source = view.classifier.source.passes[COLOUR_PASS]
    for row, column in np.argwhere(some)[:10]:
        # The eyes are parallel, so that positions lie on rows.
        left = int(np.floor(x[row, column] - 0.5))
        (taken,) = (c for c in (left, left + 1) if not view.edges.unusable[row, c])
        np.testing.assert_allclose(result.passes[COLOUR_PASS][row, column], source[row, taken], rtol=1e-5)


def test_beside_holes_pixels_are_traced_among_fragments_alone():
    """Of one colour, so that no side differs: left of a step a wall, right of it one whose depth is noise."""
    eyes = stereo_rig(DISC_SIZE, mode="parallel", ipd=0.11, convergence=3.0)
    depth = np.full(DISC_SIZE[::-1], WALL, np.float32)
    depth[:, 60:] = np.random.default_rng(7).uniform(DISC, WALL, (DISC_SIZE[1], 60)).astype(np.float32)
    depth[20:70, 20:40] = DISC
    passes = {COLOUR_PASS: np.full((*depth.shape, 4), 0.5, np.float32), DEPTH_PASS: depth[..., None]}
    nothing = np.zeros(depth.shape, bool)
    result = reproject_pair(passes, eyes["left"], eyes["right"], accuracy=SETTINGS["balanced"], invalid=nothing)
    ring = dilate((result.reasons & Reason.DISOCCLUDED.bit) > 0, 1) & (result.warped.empty == 0)
    flagged = (result.reasons & Reason.SILHOUETTE.bit) > 0
    assert ring[:, :50].sum() > 50
    assert flagged[:, :50][ring[:, :50]].mean() < 0.2
    assert flagged[:, 60:100][ring[:, 60:100]].mean() > 0.9
