"""Probes: what a sparse set of twice-traced pixels says of the rest is true, on average and within its interval."""

from __future__ import annotations

import numpy as np
import pytest

from stereo_reproject.estimate.evidence import ProbeTraces, RefinedTiles, measure_tiles, with_refined
from stereo_reproject.estimate.expected_excess import local_noise, neighbours_excess
from stereo_reproject.estimate.noise_ratio import as_rendered, estimate, tile_estimates, worst_tiles
from stereo_reproject.estimate.probes import place_random_probes
from stereo_reproject.estimate.refinement import choose_tiles, enclosed_tiles, outlier_tiles
from stereo_reproject.estimate.tracing import Refinement
from stereo_reproject.images.contrast import Contrast, box_sum, contrast_of
from stereo_reproject.images.metrics import noise_ratio, squared_error, tone
from stereo_reproject.report.estimates import estimate_map, estimate_report
from stereo_reproject.settings.accuracy import SETTINGS
from tests.estimate.colours import opaque

SIZE = (320, 480)
NOISE = 0.08
SPACING = 8

HONEST = 0.06
"""How far the estimate of one frame may be from its true noise ratio: four standard errors of 2400 probes."""

FLATTERED = 0.005
"""How far estimates may be from the truth on average."""

COVERED = 0.85
"""Share of intervals that must hold the truth; 95 % are meant to, and of 40 some more or fewer do by chance."""


class Frame:
    """A grey picture traced with noise, warped with less of it, and wrong by `bias` in a rectangle (a mirror, say)."""

    def __init__(self, bias, *, seed=1, mirror=(slice(80, 200), slice(100, 260)), warped_noise=0.75):
        self.rng = np.random.default_rng(seed)
        y, x = np.mgrid[0 : SIZE[0], 0 : SIZE[1]]
        self.truth = opaque(np.repeat((0.4 + 0.2 * np.sin(x / 60) * np.cos(y / 45))[..., None], 4, axis=2))
        self.warped = opaque(self.truth + self.rng.normal(0.0, warped_noise * NOISE, self.truth.shape))
        self.warped[mirror][..., :3] += bias
        self.holes = np.zeros(SIZE, bool)
        self.holes[:, 300:330] = True

    def traced(self):
        return opaque(self.truth + self.rng.normal(0.0, NOISE, self.truth.shape))

    def probes(self, seed=3):
        contrast = contrast_of(self.warped, ~self.holes)
        return place_random_probes(~self.holes, spacing=SPACING, seed=seed), contrast

    def measured(self, seed=3, spoil=None, shown=None):
        probes, contrast = self.probes(seed)
        w, a, b = (image[probes.mask] for image in (self.warped, self.traced(), self.traced()))
        if spoil:
            spoil(w, a, b)
        return measure_tiles(probes, ~self.holes, contrast, ProbeTraces(w, a, b), materials=shown)

    def refined(self, measured, chosen):
        """The same measured anew once the chosen tiles are traced."""
        pixels = measured.probes.pixels_of(chosen) & ~self.holes
        noise = local_noise(measured)
        return with_refined(
            measured, RefinedTiles(chosen, pixels, self.warped[pixels], self.traced()[pixels]), noise
        ), pixels

    def true_ratio(self, pixels):
        ours = np.where((self.holes | pixels)[..., None], self.traced(), self.warped)
        return noise_ratio(ours, self.traced(), self.traced())


def traces_of(probes, *images):
    """The colours of the probes' pixels in the warped picture and in two traced ones."""
    return ProbeTraces(*(image[probes.mask] for image in images))


def even(shape):
    return Contrast(np.zeros(shape, np.float32), np.ones(shape, np.float32))


def test_each_tile_with_a_warped_pixel_has_one_probe_among_them():
    warped = np.ones((21, 35), bool)
    warped[:8, :8] = False
    warped[8:16, 8:16] = False
    warped[12, 13] = True
    probes = place_random_probes(warped, spacing=8, seed=1)
    assert warped[probes.rows, probes.columns].all()
    tiles = list(zip(*probes.tiles, strict=True))
    assert len(tiles) == len(set(tiles)) == 3 * 5 - 1
    assert (12, 13) in list(zip(probes.rows, probes.columns, strict=True))
    np.testing.assert_array_equal(np.argwhere(probes.mask), np.stack([probes.rows, probes.columns], axis=1))
    np.testing.assert_allclose(probes.weight, probes.tile_sum(warped))


def test_probes_are_anywhere_in_their_tiles_with_the_same_chance():
    """So the weighted sum of any picture over the probes is its sum, on average."""
    rng = np.random.default_rng(5)
    warped = rng.random((16, 24)) > 0.2
    picture = rng.random(warped.shape)
    sums, drawn = [], np.zeros(warped.shape)
    for seed in range(400):
        probes = place_random_probes(warped, spacing=8, seed=seed)
        np.testing.assert_allclose(probes.weight, probes.tile_sum(warped))
        sums.append((probes.weight * picture[probes.rows, probes.columns]).sum())
        drawn += probes.mask * probes.over_pixels(probes.weight, 0.0)
    assert np.mean(sums) == pytest.approx(picture[warped].sum(), abs=4.0 * np.std(sums) / np.sqrt(len(sums)))
    assert not drawn[~warped].any()
    # Each warped pixel is drawn in one of some 51 pictures, so 400 / 51 times, give or take 4 standard deviations.
    np.testing.assert_allclose(drawn[warped] / 400.0, 1.0, atol=4.0 * np.sqrt(51.0 / 400.0))


def test_a_probe_stands_for_as_many_pixels_as_its_chance_was_small():
    """However uneven the chances: the weighted sum of any picture over the probes is its sum, on average."""
    rng = np.random.default_rng(5)
    shape = (16, 24)
    warped = rng.random(shape) > 0.2
    picture = rng.random(shape)
    contrast = Contrast(rng.random(shape).astype(np.float32) ** 4, np.ones(shape, np.float32))
    sums, rim = [], []
    for seed in range(400):
        probes = place_random_probes(warped, spacing=8, seed=seed, contrast=contrast)
        sums.append((probes.weight * picture[probes.rows, probes.columns]).sum())
        rim.append(contrast.signal[probes.rows, probes.columns].mean())
    true = picture[warped].sum()
    assert np.mean(sums) == pytest.approx(true, abs=4.0 * np.std(sums) / np.sqrt(len(sums)))
    assert np.mean(rim) > 1.5 * contrast.signal[warped].mean(), "probes go where there is contrast"


def test_flat_tiles_without_noise_are_judged_by_their_neighbours():
    """A black product shot with noise in one corner: the flat rest has no contrast, and is too bright in a stripe."""
    frame = Frame(0.0)
    quiet = np.ones((*SIZE, 1), bool)
    quiet[:80, :80] = False
    frame.truth = np.where(quiet, 0.5, frame.truth)
    once, again = (np.where(quiet, frame.truth, frame.traced()) for _ in range(2))
    frame.warped = np.where(quiet, frame.truth, frame.warped)
    frame.warped[160:240, :, :3] += 0.05
    probes, contrast = frame.probes()
    measured = measure_tiles(probes, ~frame.holes, contrast, traces_of(probes, frame.warped, once, again))
    assert (measured.contrast > 0.0).all()
    expected, error = neighbours_excess(measured, 1)
    assert np.isfinite(expected).all()
    assert np.isfinite(error).all()
    rows, columns = probes.tiles
    stripe, beside = (rows > 21) & (rows < 28), (rows > 33)
    inner = (columns > 1) & (columns < 35)
    due = float(np.diff(tone(np.array([[0.5] * 3, [0.55] * 3])), axis=0)[0, 0]) ** 2
    np.testing.assert_allclose(expected[stripe & inner], due, rtol=0.01)
    np.testing.assert_allclose(expected[beside], 0.0, atol=1e-9)


def test_no_warped_pixel_no_probe_and_nothing_to_promise():
    warped = np.zeros((16, 16), bool)
    probes = place_random_probes(warped, spacing=8, seed=1)
    none = np.zeros((0, 4))
    measured = measure_tiles(probes, warped, even(warped.shape), ProbeTraces(none, none, none))
    assert estimate(measured).noise_ratio == 1.0
    assert worst_tiles(measured) == 1.0
    assert not probes.pixels_of(choose_tiles(measured, 1.1)).any()


@pytest.mark.parametrize("bias", [0.0, 0.1, 0.5])
def test_the_estimate_is_the_true_noise_ratio(bias):
    frame = Frame(bias)
    told = estimate(frame.measured())
    true = frame.true_ratio(np.zeros(SIZE, bool))
    assert told.noise_ratio == pytest.approx(true, abs=HONEST * max(1.0, true))
    assert told.low < told.noise_ratio < told.high
    assert told.excess == pytest.approx(told.noise_ratio**2 - 1.0)


def test_a_warp_that_is_good_enough_is_left_alone():
    assert not choose_tiles(Frame(0.0).measured(), 1.1, worst=2.0).any()


@pytest.mark.parametrize("promise", [1.1, 1.05, 1.02])
def test_refinement_keeps_its_promise_and_traces_little_beside_what_is_wrong(promise):
    frame = Frame(0.4)
    measured = frame.measured()
    after, pixels = frame.refined(measured, choose_tiles(measured, promise))
    true, told = frame.true_ratio(pixels), estimate(after)
    assert told.noise_ratio <= promise
    assert true <= promise + HONEST
    assert true == pytest.approx(told.noise_ratio, abs=HONEST)
    wrong = 120 * 160
    assert pixels.sum() < 1.6 * wrong, "the mirror, and its rim in whole tiles"


def unlike_tiles():
    """(H, W) numbers of materials in pieces of all sizes, which keep to neither the tiles nor the mirror."""
    shown = np.zeros(SIZE, np.int32)
    for number, (row, column, height, width) in enumerate(
        [(70, 90, 100, 90), (150, 180, 110, 120), (33, 41, 21, 19), (203, 385, 13, 30), (20, 400, 9, 9)], start=1
    ):
        shown[row : row + height, column : column + width] = number
    return shown


@pytest.mark.parametrize("shown", [None, unlike_tiles()], ids=["unknown", "materials"])
@pytest.mark.parametrize("bias", [0.0, 0.15, 0.4])
def test_the_interval_after_the_choice_covers_the_truth(bias, shown):
    """The choice is made by what was measured, and must not flatter what is told of it."""
    hits, off = [], []
    for seed in range(40):
        frame = Frame(bias, seed=seed)
        measured = frame.measured(seed, shown=shown)
        after, pixels = frame.refined(measured, choose_tiles(measured, 1.05, worst=1.5))
        told, true = estimate(after), frame.true_ratio(pixels)
        hits.append(told.low <= true + 0.01 and true - 0.01 <= told.high)
        off.append(told.noise_ratio - true)
    assert np.mean(hits) >= COVERED
    assert abs(np.mean(off)) < 3.0 * np.std(off) / np.sqrt(len(off)) + FLATTERED


@pytest.mark.parametrize("shown", [None, np.zeros(SIZE, np.int32)], ids=["unknown", "all of a material"])
def test_a_small_thing_that_is_very_wrong_is_traced_though_the_frame_is_kept(shown):
    frame = Frame(0.5, mirror=(slice(104, 136), slice(104, 136)))
    measured = frame.measured(shown=shown)
    assert not choose_tiles(measured, 1.1).any(), "the frame as a whole asks for nothing"
    chosen = choose_tiles(measured, 1.1, worst=2.0) | outlier_tiles(measured, 2.0)
    pixels = measured.probes.pixels_of(chosen)
    assert pixels[104:136, 104:136].mean() > 0.75
    assert pixels.sum() < 3 * 32**2
    assert worst_tiles(measured) >= worst_tiles(frame.refined(measured, chosen)[0])


@pytest.mark.parametrize("known", [False, True], ids=["unknown", "materials"])
def test_the_intervals_of_the_tiles_hold_their_truth(known):
    """Where the tiles around are as wrong as itself, by which each is told; and its material, if that is known."""
    frame = Frame(0.12)
    shown = np.zeros(SIZE, np.int32) if known else None
    if shown is not None:
        shown[80:200, 100:260] = 1
    errors, noises = np.zeros(SIZE), np.zeros(SIZE)
    for _ in range(40):
        reference = frame.traced()
        errors += squared_error(frame.warped, reference)
        noises += squared_error(frame.traced(), reference)
    inside, outside, hits = [], [], []
    for seed in range(8):
        measured = frame.measured(seed, shown=shown)
        probes, told = measured.probes, tile_estimates(measured)
        true = np.sqrt(probes.tile_sum(errors) / probes.tile_sum(noises))
        rows, columns = probes.tiles
        in_mirror = (rows >= 11) & (rows < 24) & (columns >= 14) & (columns < 31)
        beside = (rows < 8) | (rows > 27)
        hits += ((told[:, 1] <= true) & (true <= told[:, 2]))[in_mirror | beside].tolist()
        inside.append(np.median(told[in_mirror, 0] / true[in_mirror]))
        outside.append(np.median(told[beside, 0] / true[beside]))
    assert np.mean(hits) >= COVERED
    assert (np.mean(inside), np.mean(outside)) == (pytest.approx(1.0, abs=0.1), pytest.approx(1.0, abs=0.1))


def test_the_map_of_the_estimate_is_one_where_traced_and_unknown_where_no_probe_tells():
    frame = Frame(0.12)
    measured, pixels = frame.refined(frame.measured(), choose_tiles(frame.measured(), 1.1))
    told = estimate_map(Refinement(pixels, evidence=measured), frame.holes | pixels)
    assert told.shape == (*SIZE, 3)
    assert (told[frame.holes | pixels] == 1.0).all()
    # Half of the trace is holes here: tiles without a warped pixel have no probe, and nothing that needs one.
    assert np.isfinite(told).all()
    assert (told[..., 1] <= told[..., 0]).all()
    assert (told[..., 0] <= told[..., 2]).all()
    unknown = estimate_map(Refinement(pixels), frame.holes)
    assert np.isnan(unknown[~frame.holes]).all()
    assert (unknown[frame.holes] == 1.0).all()


def test_what_was_rendered_whole_has_no_interval_where_nothing_is_known_of_its_noise():
    whole = Refinement(np.ones(SIZE, bool), estimate=as_rendered(None), whole=True)
    told = estimate_report(whole, SETTINGS["balanced"])
    assert (told.noise_ratio, told.low, told.high, told.kept) == (1.0, None, None, True)


def test_a_frame_that_is_mostly_without_noise_has_worst_tiles():
    """A product before black: the median tile has no noise at all."""
    frame = Frame(0.12, mirror=(slice(0, 40), slice(0, 100)))
    for image in (frame.warped, frame.truth):
        image[96:] = 0.0
    probes, contrast = frame.probes()
    a, b = frame.traced(), frame.traced()
    for image in (a, b):
        image[96:] = 0.0
    measured = measure_tiles(probes, ~frame.holes, contrast, traces_of(probes, frame.warped, a, b))
    assert 1.1 < worst_tiles(measured) < 5.0
    told = tile_estimates(measured)
    assert np.isfinite(told).all()
    assert (told[probes.tiles[0] > 14] == 1.0).all()


def lone_tiles(seed, bias=0.8):
    """A frame in which single tiles, far apart, are wrong: nothing around them tells."""
    frame = Frame(0.0, seed=seed)
    for row in range(16, 304, 64):
        for column in range(16, 288, 64):
            frame.warped[row : row + SPACING, column : column + SPACING, :3] += bias
    return frame


def test_a_lone_tile_that_is_wrong_beyond_doubt_is_found_by_its_own_probe():
    measured = lone_tiles(1).measured()
    wrong = (measured.probes.tiles[0] % 8 == 2) & (measured.probes.tiles[1] % 8 == 2) & (measured.probes.tiles[1] < 36)
    assert not choose_tiles(measured, 1.25, worst=2.0)[wrong].any()
    found = outlier_tiles(measured, 2.0)
    assert found[wrong].mean() > 0.9
    assert found[~wrong].mean() < 0.005


@pytest.mark.parametrize(("missing", "enclosed"), [(0, True), (2, True), (3, False)])
def test_a_tile_among_traced_ones_is_traced_too(missing, enclosed):
    measured = Frame(0.0).measured()
    rows, columns = measured.probes.tiles
    ring = [(row, column) for row in (9, 10, 11) for column in (19, 20, 21) if (row, column) != (10, 20)]
    chosen = np.zeros(rows.size, bool)
    for row, column in ring[missing:]:
        chosen[(rows == row) & (columns == column)] = True
    found = enclosed_tiles(measured, chosen)
    assert found[(rows == 10) & (columns == 20)] == enclosed
    assert found.sum() == enclosed


def test_holes_count_as_traced():
    frame = Frame(0.0)
    frame.holes[:48] = True
    measured = frame.measured()
    rows, columns = measured.probes.tiles
    chosen = ((rows == 6) & ((columns == 9) | (columns == 11))) | ((rows == 7) & (columns == 10))
    # At the frame's edge, two neighbours above are holes, and one beside is chosen: three of five are too few.
    chosen |= (rows == 6) & (columns == 1)
    found = enclosed_tiles(measured, chosen)
    # Farther to the right, the frame's own holes enclose two more.
    found &= columns < 30
    assert list(zip(rows[found], columns[found], strict=True)) == [(6, 10)]


@pytest.mark.parametrize(
    ("place", "traced", "enclosed"),
    [((0, 0), 3, True), ((0, 0), 2, False), ((39, 20), 4, True), ((39, 20), 3, False)],
)
def test_at_the_border_the_share_of_the_tiles_that_there_are_decides(place, traced, enclosed):
    measured = Frame(0.0).measured()
    rows, columns = measured.probes.tiles
    ring = np.flatnonzero(np.maximum(abs(rows - place[0]), abs(columns - place[1])) == 1)
    chosen = np.zeros(rows.size, bool)
    chosen[ring[:traced]] = True
    found = enclosed_tiles(measured, chosen)
    assert found[(rows == place[0]) & (columns == place[1])] == enclosed
    assert found.sum() == enclosed


def test_where_nothing_is_chosen_nothing_is_enclosed():
    frame = Frame(0.0)
    frame.holes[:], frame.holes[80:88, 80:88] = True, False
    measured = frame.measured()
    assert not enclosed_tiles(measured, np.zeros(measured.pixels.size, bool)).any()


def test_what_was_chosen_by_its_own_probe_does_not_flatter_what_is_told():
    told, true = [], []
    for seed in range(25):
        frame = lone_tiles(seed, bias=0.3)
        measured = frame.measured(seed)
        by_own = outlier_tiles(measured, 2.0)
        pixels = measured.probes.pixels_of(by_own) & ~frame.holes
        noise = local_noise(measured)
        after = with_refined(
            measured, RefinedTiles(by_own, pixels, frame.warped[pixels], frame.traced()[pixels], by_own), noise
        )
        told.append(estimate(after).noise_ratio)
        true.append(frame.true_ratio(pixels))
    off = np.array(told) - np.array(true)
    assert abs(off.mean()) < 3.0 * off.std() / 5.0 + 0.005


def test_noise_beside_a_quiet_place_is_not_taken_for_its_own():
    frame = NoisyObject(64, seed=3)
    frame.warped += frame.rng.normal(0.0, 0.002, frame.truth.shape)
    measured = frame.measured()
    rows, columns = measured.probes.tiles
    beside = (rows == 12) & (columns == 10)
    assert measured.neighbourhood_noise[beside] > 4.0 * local_noise(measured)[beside]


def test_a_texture_without_noise_does_not_make_the_noise_elsewhere_an_error():
    """A sharp sky that only shines over most of the frame; nothing is wrong anywhere."""
    frame = Frame(0.0, warped_noise=1.0)
    sky = np.zeros((*SIZE, 1))
    sky[:200] = 1.0
    texture = 0.4 * np.random.default_rng(5).random((*SIZE, 1))
    images = [
        np.where(sky > 0, frame.truth + texture + 0.02 * (image - frame.truth), image)
        for image in (frame.warped, frame.traced(), frame.traced())
    ]
    frame.warped = images[0]
    probes, contrast = frame.probes()
    measured = measure_tiles(probes, ~frame.holes, contrast, traces_of(probes, *images))
    below = probes.tiles[0] > 26
    assert np.median(local_noise(measured)[below]) > 0.7 * np.median(measured.neighbourhood_noise[below])
    chosen = choose_tiles(measured, 1.1, worst=1.5) | outlier_tiles(measured, 1.5)
    assert chosen[below].mean() < 0.03


def test_a_material_is_judged_as_a_whole_however_its_pieces_lie():
    """Small mirrors apart from each other: the probes around one know little of it, those of all of them know."""
    found, beside = [], []
    for seed in range(6):
        frame = Frame(0.0, seed=seed)
        mirrors = np.zeros(SIZE, np.intp)
        for row, column in np.ndindex(6, 5):
            mirrors[row * 48 + 24 :, column * 56 + 16 :][:8, :8] = 1
        frame.warped[mirrors > 0] += 0.3
        for shown in (None, mirrors):
            measured = frame.measured(seed, shown=shown)
            pixels = measured.probes.pixels_of(choose_tiles(measured, 1.02, worst=1.5))
            found.append(pixels[mirrors > 0].mean())
            beside.append(pixels[(mirrors == 0) & ~frame.holes].mean())
    alone, together = np.mean(found[::2]), np.mean(found[1::2])
    assert together > 0.7 > 0.1 > alone
    assert np.mean(beside[1::2]) < np.mean(beside[::2])


def test_what_materials_tell_is_of_probes_alone():
    """A tile half of which is a mirror, with its probe on the wall: traced, it has the mirror's error."""
    frame = Frame(0.5)
    measured = frame.measured(shown=unlike_tiles())
    assert measured.materials is not None
    after, _ = frame.refined(measured, choose_tiles(measured, 1.3))
    assert after.refined.any()
    nearby = np.ones(after.refined.size)
    np.testing.assert_array_equal(after.materials.expected(nearby), measured.materials.expected(nearby))


@pytest.mark.parametrize("shown", [None, unlike_tiles()], ids=["unknown", "materials"])
def test_a_firefly_on_a_probe_refines_no_wall_and_hides_no_error(shown):
    def burn_one(w, a, b):
        a[w.shape[0] // 2] = 1000.0

    measured = Frame(0.0).measured(spoil=burn_one, shown=shown)
    assert measured.probes.pixels_of(choose_tiles(measured, 1.1, worst=2.0)).sum() <= 9 * SPACING**2

    def burn_two(w, a, b):
        a[10] = b[500] = 1000.0

    frame = Frame(0.4)
    measured = frame.measured(spoil=burn_two, shown=shown)
    _, pixels = frame.refined(measured, choose_tiles(measured, 1.1, worst=2.0))
    assert frame.true_ratio(pixels) <= 1.1 + HONEST


def test_a_warped_firefly_refines_no_wall():
    def burn(w, a, b):
        w[w.shape[0] // 2] = 1000.0

    measured = Frame(0.0).measured(spoil=burn)
    assert measured.probes.pixels_of(choose_tiles(measured, 1.1, worst=2.0)).sum() <= 25 * SPACING**2


def test_a_firefly_counts_for_no_more_than_a_few_probes():
    """In a frame with little noise one of them is more than all the rest, and would hide what is wrong elsewhere."""
    rng = np.random.default_rng(5)
    warped = np.ones((160, 240), bool)
    probes = place_random_probes(warped, spacing=SPACING, seed=1)
    a, b = (0.4 + rng.normal(0.0, 0.01, (probes.rows.size, 3)) for _ in range(2))
    w = a.mean() + np.where(np.arange(probes.rows.size) % 4 == 0, 0.05, 0.0)[:, None] + np.zeros(3)
    quiet = estimate(measure_tiles(probes, warped, even(warped.shape), ProbeTraces(w, a, b)))
    a[7] = 1000.0
    disturbed = estimate(measure_tiles(probes, warped, even(warped.shape), ProbeTraces(w, a, b)))
    assert quiet.noise_ratio > 1.5
    assert disturbed.noise_ratio > 0.9 * quiet.noise_ratio


class NoisyObject(Frame):
    """All noise is on a small object; the rest is as flat as a backdrop."""

    def __init__(self, side, *, seed):
        super().__init__(0.0, seed=seed)
        self.holes[:] = False
        self.loud = np.zeros((*SIZE, 1))
        self.loud[80 : 80 + side, 100 : 100 + side] = 1.0
        self.truth[:] = 0.4
        self.warped = self.traced()

    def traced(self):
        return self.truth + self.rng.normal(0.0, NOISE, self.truth.shape) * getattr(self, "loud", 0.0)


@pytest.mark.parametrize("side", [40, 64])
def test_a_noisy_thing_on_a_quiet_frame_is_neither_wrong_nor_a_reason_to_trace_it_all(side):
    told = []
    for seed in range(12):
        measured = NoisyObject(side, seed=seed).measured(seed)
        told.append(estimate(measured).excess)
        pixels = measured.probes.pixels_of(choose_tiles(measured, 1.1, worst=2.0))
        assert pixels.sum() <= 4 * side**2
    assert np.mean(told) == pytest.approx(0.0, abs=4.0 * np.std(told) / np.sqrt(len(told)))


def test_one_outlier_on_a_quiet_frame_does_not_have_everything_traced():
    rng = np.random.default_rng(5)
    warped = np.ones((160, 240), bool)
    probes = place_random_probes(warped, spacing=SPACING, seed=1)
    a, b = (0.4 + rng.normal(0.0, 0.001, (probes.rows.size, 3)) for _ in range(2))
    w = a + rng.normal(0.0, 0.0005, a.shape)
    w[100] = 3.0
    measured = measure_tiles(probes, warped, even(warped.shape), ProbeTraces(w, a, b))
    assert estimate(measured).noise_ratio > 1.1
    assert choose_tiles(measured, 1.1, worst=2.0).mean() <= 0.5, "no more than may have something to gain"


def test_a_refining_trace_that_is_no_number_spoils_nothing():
    frame = Frame(0.4)
    measured = frame.measured()
    chosen = choose_tiles(measured, 1.1)
    pixels = measured.probes.pixels_of(chosen) & ~frame.holes
    traced = frame.traced()
    traced[np.argwhere(pixels)[5][0], np.argwhere(pixels)[5][1]] = np.nan
    after = with_refined(
        measured, RefinedTiles(chosen, pixels, frame.warped[pixels], traced[pixels]), local_noise(measured)
    )
    told = estimate(after)
    assert np.isfinite([told.noise_ratio, told.low, told.high, worst_tiles(after)]).all()
    assert told.noise_ratio <= 1.1


def test_a_trace_that_is_no_number_says_nothing():
    def spoil(w, a, b):
        a[5] = np.nan
        b[7] = np.inf

    told = estimate(Frame(0.0).measured(spoil=spoil))
    assert np.isfinite([told.noise_ratio, told.low, told.high]).all()


def test_without_noise_whatever_is_off_is_traced():
    frame = Frame(0.3, warped_noise=0.0)
    probes, contrast = frame.probes()
    truth = frame.truth[probes.mask]
    measured = measure_tiles(probes, ~frame.holes, contrast, ProbeTraces(frame.warped[probes.mask], truth, truth))
    pixels = probes.pixels_of(choose_tiles(measured, 1.1, worst=2.0))
    assert pixels[80:200, 104:256].all()
    assert not pixels[:72].any()
    assert np.isnan(tile_estimates(measured)).all(), "without noise there is no ratio to it"


def test_contrast_is_where_something_is_to_be_seen_and_noise_is_not_contrast():
    rng = np.random.default_rng(2)
    picture = np.full((60, 80, 4), 0.3, np.float32)
    picture[:, 40:] = 0.6
    known = np.ones((60, 80), bool)
    clean = contrast_of(picture, known).signal
    assert clean[:, 38:42].min() > 100.0 * clean[:, :20].max()
    noisy = contrast_of(opaque(picture + rng.normal(0, 0.05, picture.shape)), known)
    assert noisy.signal[:, :20].mean() < 0.1 * noisy.signal[:, 38:42].mean()
    assert noisy.noise[:, :20].mean() == pytest.approx((0.05 / 1.3**2) ** 2, rel=0.15)


def test_contrast_does_not_look_into_holes():
    picture = np.full((40, 60, 4), 0.3, np.float32)
    picture[:, 30:] = 9.0
    known = np.ones((40, 60), bool)
    known[:, 30:] = False
    assert contrast_of(picture, known).signal.max() < 1e-6


def test_box_sum_is_the_sum_over_the_window():
    image = np.random.default_rng(0).random((7, 9))
    padded = np.pad(image, ((1, 1), (2, 2)))
    windows = np.lib.stride_tricks.sliding_window_view(padded, (3, 5))
    np.testing.assert_allclose(box_sum(image, (1, 2)), windows.sum(axis=(2, 3)))


@pytest.mark.parametrize("columns", [2, 5, 12])
@pytest.mark.parametrize("reach", [1, 2])
def test_in_a_whole_turn_tiles_at_the_sides_are_neighbours(columns, reach):
    shape = 24, 8 * columns
    probes = place_random_probes(np.ones(shape, bool), spacing=8, seed=1, wraps=True)
    values = np.arange(probes.rows.size, dtype=float)
    rows, own = probes.tiles
    apart = np.abs(own[:, None] - own)
    beside = np.minimum(apart, columns - apart) <= min(reach, (columns - 1) // 2)
    if columns == 2:
        beside = apart <= reach
    around = (np.abs(rows[:, None] - rows) <= reach) & beside
    np.testing.assert_allclose(probes.neighbour_sum(values, reach), around @ values - values)
