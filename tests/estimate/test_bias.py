"""What probes tell together of a slow error is taken away, and nothing else is touched."""

from dataclasses import replace

import numpy as np
import pytest

from stereo_reproject.estimate.bias import SourceNoise, _factor, bias_of
from stereo_reproject.estimate.denoised import source_noise
from stereo_reproject.estimate.evidence import ProbeTraces
from stereo_reproject.estimate.probes import Probes, place_random_probes
from stereo_reproject.estimate.tuning import EstimateTuning
from stereo_reproject.images.contrast import contrast_of
from stereo_reproject.images.metrics import squared_error, tone

SIZE = (240, 320)
NOISE = 0.06
SPACING = 6
FACTOR = EstimateTuning().max_bias_factor


def contrast(colour):
    return contrast_of(colour, np.ones(colour.shape[:2], bool)).signal


def corrected(bias, colour, pixels, shown):
    """A copy of the colour (H, W, >= 3), corrected where `pixels` are set."""
    result = colour.copy()
    bias.correct([result], result, pixels, shown)
    return result


class Warped:
    """A grey picture that is off by a slowly changing amount where it shows material 1, and right where it shows 0."""

    def __init__(self, amount, *, seed=1):
        self.rng = np.random.default_rng(seed)
        y, x = np.mgrid[0 : SIZE[0], 0 : SIZE[1]]
        self.truth = np.full((*SIZE, 4), 0.5, np.float32)
        self.shown = (x > SIZE[1] // 2).astype(int)
        off = amount * self.shown * (0.5 + 0.5 * np.sin(y / 60.0))
        self.colour = self.truth.copy()
        self.colour[..., :3] += off[..., None].astype(np.float32)
        self.probes = place_random_probes(np.ones(SIZE, bool), spacing=SPACING, seed=seed)

    def traces(self):
        truth = self.truth[self.probes.mask]
        return [truth + self.rng.normal(0.0, NOISE, truth.shape) for _ in range(2)]

    def bias(self, spoil=None):
        a, b = self.traces()
        if spoil:
            spoil(a, b)
        count = self.probes.rows.size
        # Small enough for `tone` to be a line.
        variance = np.full(count, squared_error(self.truth + NOISE, self.truth).mean())
        noise = SourceNoise(np.zeros((count, 3)), variance)
        colour = self.colour[self.probes.mask]
        return bias_of(self.probes, ProbeTraces(colour, a, b), contrast(self.colour), self.shown, noise=noise)

    def corrected(self, bias):
        return corrected(bias, self.colour, np.ones(SIZE, bool), self.shown)

    def error(self, colour, material):
        return squared_error(colour, self.truth)[self.shown == material].mean()


def test_a_slow_error_goes():
    warped = Warped(0.05)
    assert warped.error(warped.corrected(warped.bias()), 1) < 0.1 * warped.error(warped.colour, 1)


def test_what_is_right_is_hardly_touched_though_its_neighbour_is_wrong():
    """A hundredth of the variance of one trace: what is added is less than a denoiser leaves."""
    warped = Warped(0.2)
    noise = squared_error(warped.truth + NOISE, warped.truth).mean()
    assert warped.error(warped.corrected(warped.bias()), 0) < 0.01 * noise


def test_pixels_that_no_correction_reaches_stay_as_they_are():
    warped = Warped(0.1)
    bias = warped.bias()
    changed = (warped.corrected(bias) != warped.colour).any(axis=-1)
    assert 0.2 < bias.reached.mean() < 0.9
    assert not changed[~bias.reached].any()
    # Beyond the tiles that have a correction themselves some pixels are changed too.
    own = bias.probes.over_pixels(bias.added.any(axis=1), False)
    assert changed[bias.reached & ~own].any()


def test_without_an_error_chance_adds_little():
    warped = Warped(0.0)
    bias = warped.bias()
    assert np.mean(np.any(bias.added != 0.0, axis=1)) < 0.15
    assert warped.error(warped.corrected(bias), 1) < 0.01 * NOISE**2


def test_only_the_pixels_that_are_asked_for_change():
    warped = Warped(0.05)
    pixels = np.zeros(SIZE, bool)
    pixels[50:60] = True
    changed = corrected(warped.bias(), warped.colour, pixels, warped.shown)
    assert np.array_equal(changed[~pixels], warped.colour[~pixels])
    assert not np.array_equal(changed[pixels], warped.colour[pixels])
    assert np.array_equal(changed[..., 3], warped.colour[..., 3])


def test_a_probe_has_no_say_in_what_the_others_tell_of_its_tile():
    def shout(a, b):
        a[700] = b[700] = 50.0

    quiet, loud = Warped(0.05), Warped(0.05)
    others = [w.bias(spoil).without_own[700] for w, spoil in ((quiet, None), (loud, shout))]
    # It is half a picture's brightness off. Its noise is part of what its neighbours' is judged by, but no more.
    assert np.allclose(others[0], others[1], atol=0.05)


def test_a_probe_that_is_no_number_says_nothing():
    def spoil(a, b):
        a[10], b[11] = np.nan, np.inf

    warped = Warped(0.05)
    bias = warped.bias(spoil)
    assert np.isfinite(bias.added).all()
    assert np.isfinite(warped.corrected(bias)).all()


@pytest.mark.parametrize("value", [0.0, 1e-6, 1e4])
def test_no_colour_becomes_negative_or_many_times_brighter(value):
    warped = Warped(0.0)
    warped.colour[..., :3] = value
    colour = warped.corrected(warped.bias())
    assert colour.min() >= 0.0
    assert (colour[..., :3] <= FACTOR * value).all()


def test_an_edge_that_is_a_pixel_aside_is_no_slow_error():
    """All probes that meet the edge are off to one side."""
    warped = Warped(0.0)
    edge = int(warped.probes.columns[warped.probes.columns > SIZE[1] // 2].min())
    warped.shown[:] = 0
    warped.truth[:, edge:, :3] = 0.1
    warped.colour = warped.truth.copy()
    warped.colour[:, edge, :3] = 0.5
    change = np.abs(warped.corrected(warped.bias()) - warped.colour)[..., :3].mean(axis=(0, 2))
    assert change.max() < 0.02 * (0.5 - 0.1)


def test_a_dim_corner_with_a_few_bright_samples_is_not_taken_for_dark():
    """One trace in forty is bright. Most probes see none of those, and all are sure of the same."""
    size, mean, share = (180, 240), 0.3, 1.0 / 40.0
    rng = np.random.default_rng(4)

    def traced(*shape):
        return np.broadcast_to((rng.random((*shape, 1)) < share) * mean / share, (*shape, 4)).astype(np.float32)

    denoised, noisy = np.full((*size, 4), mean, np.float32), traced(*size)
    probes = place_random_probes(np.ones(size, bool), spacing=SPACING, seed=1)
    a, b = (traced(probes.rows.size) for _ in range(2))
    shown = np.zeros(size, int)

    def brightness(noise):
        bias = bias_of(probes, ProbeTraces(denoised[probes.mask], a, b), contrast(denoised), shown, noise=noise)
        return corrected(bias, denoised, np.ones(size, bool), shown)[..., :3].mean() / mean

    nothing = SourceNoise(np.zeros((probes.rows.size, 3)), np.zeros(probes.rows.size))
    assert brightness(nothing) < 0.7
    assert abs(brightness(source_noise(probes, denoised, noisy, np.ones(size, bool))) - 1.0) < 0.02


@pytest.mark.parametrize("value", [0.0, -1.0, 1e30, np.nan])
def test_what_is_no_light_stays_as_it_is_and_the_brightest_is_light(value):
    warped = Warped(0.1)
    warped.colour[40:60, 200:220, :3] = value
    bias = warped.bias()
    assert bias.added.any()
    found = warped.corrected(bias)[40:60, 200:220, :3]
    if value > 0.0:
        assert ((found >= value / FACTOR) & (found <= value * FACTOR)).all()
    else:
        assert np.array_equal(found, warped.colour[40:60, 200:220, :3], equal_nan=True)


@pytest.mark.parametrize("added", [-0.15, -1e-3, 0.0, 1e-3, 0.08])
def test_a_correction_is_exact_after_tone_mapping(added):
    colour = np.array([[1e-3, 0.3, 1.0], [0.5, 2.0, 0.8]], np.float32)
    factor = _factor(colour, np.full(colour.shape, added))
    free = (factor > 1.0 / FACTOR) & (factor < FACTOR)
    assert free.any()
    np.testing.assert_allclose(tone(colour * factor)[free], (tone(colour) + added)[free], rtol=1e-6)


@pytest.mark.parametrize("size", [(1, 1), (3, 40), (17, 17), (40, 3)])
def test_pictures_of_few_tiles_are_corrected_too(size):
    shown, colour = np.zeros(size, int), np.full((*size, 4), 0.5, np.float32)
    probes = place_random_probes(np.ones(size, bool), spacing=6, seed=1)
    truth = colour[probes.mask] + 0.1
    noise = SourceNoise.of_noisy(np.zeros(probes.rows.size))
    bias = bias_of(probes, ProbeTraces(colour[probes.mask], truth, truth), contrast(colour), shown, noise=noise)
    np.testing.assert_allclose(corrected(bias, colour, np.ones(size, bool), shown)[..., :3], 0.6, rtol=0.02)


@pytest.mark.parametrize("share", [0.5, 0.1, 1.0 / 40.0])
def test_a_dim_corner_of_a_noisy_picture_stays_as_bright(share):
    """Between two pixels the warp has their mean, which is less noisy, and so is brighter after `tone`: against that
    all probes agree that it is too bright."""
    size, mean = (180, 240), 0.3
    everything, shown = np.ones(size, bool), np.zeros(size, int)

    def changes(seed):
        """How much brighter the picture becomes where probes are held against single samples, and against means."""
        rng = np.random.default_rng(seed)

        def traced(*shape):
            return np.broadcast_to((rng.random((*shape, 1)) < share) * mean / share, (*shape, 4)).astype(np.float32)

        source = traced(size[0], size[1] + 1)
        warped = 0.5 * (source[:, 1:] + source[:, :-1])
        found = contrast_of(warped, everything)
        probes = place_random_probes(everything, spacing=8, seed=seed)
        a, b = (traced(probes.rows.size) for _ in range(2))
        noise = SourceNoise.of_noisy(probes.neighbourhood_mean(found.noise[probes.rows, probes.columns]))
        for at_probes in (source[probes.rows, probes.columns], warped[probes.mask]):
            bias = bias_of(probes, ProbeTraces(at_probes, a, b), found.signal, shown, noise=noise)
            yield corrected(bias, warped, everything, shown)[..., :3].mean() / warped[..., :3].mean() - 1.0

    off, off_by_means = np.abs(np.mean([list(changes(seed)) for seed in range(12)], axis=0))
    assert off < 0.012
    assert off < 0.5 * off_by_means


def test_what_two_agree_on_is_the_smaller_of_both():
    bias = Warped(0.05).bias()
    one, other = np.array([[0.2, -0.2, 0.1]]), np.array([[0.1, -0.3, -0.1]])
    agreed = replace(bias, added=one, without_own=other).agreed(replace(bias, added=other, without_own=one))
    assert agreed.added.tolist() == agreed.without_own.tolist() == [[0.1, -0.2, 0.0]]


@pytest.mark.parametrize("tiles", [1, 3, 20])
def test_in_a_whole_turn_a_correction_does_not_depend_on_where_the_sides_are(tiles):
    warped, size = Warped(0.05), (SIZE[0], SIZE[1] // SPACING * SPACING)
    traces = np.zeros((*SIZE, 2, 4))
    traces[warped.probes.mask] = np.stack(warped.traces(), axis=1)

    def corrected_turned(by, *, wraps):
        def turned(image):
            return np.roll(image[:, : size[1]], by, axis=1)

        rows, columns = np.nonzero(turned(warped.probes.mask))
        probes = Probes(rows, columns, np.full(rows.size, float(SPACING**2)), SPACING, size, wraps=wraps)
        noise = SourceNoise(np.zeros((rows.size, 3)), np.full(rows.size, 1e-3))
        a, b = np.moveaxis(turned(traces)[probes.mask], 1, 0)
        colour, shown, signal = (turned(image) for image in (warped.colour, warped.shown, contrast(warped.colour)))
        bias = bias_of(probes, ProbeTraces(colour[probes.mask], a, b), signal, shown, noise=noise)
        return np.roll(corrected(bias, colour, np.ones(size, bool), shown), -by, axis=1)

    plain = corrected_turned(0, wraps=True)
    np.testing.assert_allclose(corrected_turned(tiles * SPACING, wraps=True), plain, atol=1e-6)
    assert np.abs(corrected_turned(tiles * SPACING, wraps=False) - plain).max() > 1e-3
