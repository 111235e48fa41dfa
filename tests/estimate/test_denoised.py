"""Probes of a denoised picture: errors are found beside little noise where reflected light is told apart, and the
estimate is honest with and without that."""

from dataclasses import replace

import numpy as np
import pytest

from stereo_reproject.estimate.denoised import DenoisedEstimator
from stereo_reproject.estimate.estimator import light_that_differs
from stereo_reproject.estimate.evidence import ProbeTraces, ReflectedLight
from stereo_reproject.estimate.noise_ratio import estimate, tile_estimates, worst_tiles
from stereo_reproject.estimate.probes import place_random_probes
from stereo_reproject.estimate.refinement import choose_tiles
from stereo_reproject.estimate.target import Provenance, Target
from stereo_reproject.images.contrast import contrast_of
from stereo_reproject.images.denoising import Denoising
from stereo_reproject.images.metrics import tone
from stereo_reproject.images.passes import COLOUR_PASS, MATERIAL_PASS, NOISY_PASS, VIEW_DEPENDENT_PASS
from stereo_reproject.images.reflected_light import without_sparks
from stereo_reproject.images.residual_noise import residual_noise
from stereo_reproject.images.tuning import TUNING
from tests.estimate.colours import opaque

SIZE = (240, 360)
NOISE, REFLECTED_NOISE = 0.05, 0.01
LEFT = 0.02
_SHARE = TUNING.residual_noise_share
DETAIL = 9.0 / 8.0 * NOISE * np.sqrt(LEFT * (1.0 / (_SHARE - LEFT) - 8.0 / 9.0))
"""Amplitude of a chequerboard beside which a denoiser leaves that share of the noise's variance; what it leaves looks
like detail too, a ninth of which is in the mean of 3 x 3 pixels."""

SPACING = 6
MIRROR = np.s_[60:150, 90:210]
EVERYTHING = np.ones(SIZE, bool)

MOSTLY_NOTHING = 0.05
"""Share of a picture that chance has traced at most where nothing is wrong."""

FLATTERED = 0.1
"""How far estimates of noise_ratio^2 may be from the truth on average over the frames of the test."""


class Frame:
    """A picture with waves, warped with as little noise as a denoiser leaves, whose reflection is off by stripes in a
    rectangle. Of each trace's noise a small part is that of the reflected light."""

    def __init__(self, off, seed, *, by_component=True):
        self.rng = np.random.default_rng(seed)
        y, x = np.mgrid[0 : SIZE[0], 0 : SIZE[1]]
        waves = 0.4 + 0.1 * np.sin(x / 30) * np.cos(y / 25)
        # Without detail a denoiser would leave no noise.
        waves += DETAIL * (1.0 - 2.0 * ((x + y) % 2))
        self.truth = opaque(np.repeat(waves[..., None], 4, axis=2).astype(np.float32))
        self.off = np.zeros((*SIZE, 1), np.float32)
        self.off[MIRROR] = off * np.sign(np.sin(x[MIRROR] / 2.0))[..., None]
        self.reflected = np.full((*SIZE, 3), 0.1, np.float32)
        shown = np.zeros((*SIZE, 1), np.float32)
        shown[MIRROR] = 1.0
        colour = opaque(self.truth + self.noise(np.sqrt(LEFT) * NOISE, 4) + self.off).astype(np.float32)
        light = self.reflected + self.off + self.noise(REFLECTED_NOISE, 3)
        self.passes = {
            COLOUR_PASS: colour,
            NOISY_PASS: opaque(colour + self.noise(NOISE, 4)).astype(np.float32),
            VIEW_DEPENDENT_PASS: light.astype(np.float32),
            MATERIAL_PASS: shown,
        }
        if not by_component:
            del self.passes[VIEW_DEPENDENT_PASS]

    def noise(self, sigma, channels, shape=SIZE):
        return self.rng.normal(0.0, sigma, (*shape, channels)).astype(np.float32)

    def traced(self, mask):
        """A trace's colour and its reflected light at the set pixels."""
        count = (int(mask.sum()),)
        reflected = self.reflected[mask] + self.noise(REFLECTED_NOISE, 3, count)
        rest = self.truth[mask][:, :3] - self.reflected[mask] + self.noise(NOISE, 3, count)
        return opaque(np.concatenate([rest + reflected, np.ones((*count, 1))], axis=-1)).astype(np.float32), reflected

    def measured(self, *, tells=True, spacings=(SPACING,)):
        """The evidence of probes this far apart; of several spacings those before the last one are pilots."""
        contrast = contrast_of(light_that_differs(self.passes), EVERYTHING)
        estimator = DenoisedEstimator(contrast, Denoising(lambda _: [], float(residual_noise(self.passes).mean())))
        passes = {name: image.copy() for name, image in self.passes.items()}
        target, uncorrected = Target.of_warp("right", passes, np.zeros(SIZE, np.uint16)), None
        for spacing in spacings:
            seed = int(self.rng.integers(1 << 30))
            probes = place_random_probes(target.warped, spacing=spacing, seed=seed, contrast=contrast)
            place = probes.rows, probes.columns
            (once, first), (again, second) = self.traced(probes.mask), self.traced(probes.mask)
            apart = None
            if VIEW_DEPENDENT_PASS in passes:
                warped, share = passes[VIEW_DEPENDENT_PASS][place], np.ones(probes.rows.size)
                apart = ReflectedLight(warped, first, second, share, np.full(probes.rows.size, tells))
            before = target.colour.copy()
            was = None if uncorrected is None else uncorrected[place]
            traces = ProbeTraces(target.colour[place], once, again, uncorrected=was, reflected=apart)
            target = target.flagged(probes.mask, Provenance.PROBE)
            target, evidence = estimator.measure(target, probes, traces)
            uncorrected = before
        self.corrected = target.colour
        return evidence

    def true_excess(self, pixels):
        """noise_ratio^2 - 1 when the pixels are traced: of the warped ones only what is off counts."""
        was = self.passes[COLOUR_PASS] - self.off
        toned = (tone(self.corrected) - tone(was)).mean(axis=-1)
        slope = 1.0 / (1.0 + self.truth[..., 0]) ** 4
        return (toned**2)[~pixels].sum() / (2.0 * LEFT * NOISE**2 * slope).sum()


def test_what_is_wrong_is_found_and_little_else_is_traced():
    measured = Frame(0.05, seed=1).measured()
    pixels = measured.probes.pixels_of(choose_tiles(measured, 1.1, worst=1.8))
    wrong = np.zeros(SIZE, bool)
    wrong[MIRROR] = True
    assert np.mean(pixels[wrong]) > 0.8
    assert np.mean(pixels[~wrong]) < 0.05


@pytest.mark.parametrize("brightness", [0.3, 1e4])
def test_sparks_in_the_source_s_reflected_light_have_nothing_traced(brightness):
    """A probe that meets one would say that its whole surroundings are wrong, and all that shows the same material."""

    def traced(clean):
        frame = Frame(0.0, seed=7)
        frame.passes[VIEW_DEPENDENT_PASS][5::24, 7::24] += brightness
        frame.passes[VIEW_DEPENDENT_PASS] = clean(frame.passes[VIEW_DEPENDENT_PASS])
        return np.mean(choose_tiles(frame.measured(), 1.1, worst=1.8))

    assert traced(without_sparks) < MOSTLY_NOTHING
    assert traced(lambda light: light) > 2.0 * MOSTLY_NOTHING


@pytest.mark.parametrize("by_component", [True, False])
def test_where_nothing_is_wrong_next_to_nothing_is_traced(by_component):
    measured = Frame(0.0, seed=2, by_component=by_component).measured()
    assert np.mean(choose_tiles(measured, 1.1, worst=1.8)) < (0.05 if by_component else 0.3)


def test_reflected_light_told_apart_makes_the_interval_five_times_narrower():
    # With an error, what the noise of the frame is not known for sure would be a part of either interval.
    def width(**how):
        told = estimate(Frame(0.0, seed=3).measured(**how))
        return told.honest_high**2 - told.honest_low**2

    assert width() < 0.2 * width(tells=False)


def test_probes_that_differ_in_other_light_are_heard_as_without():
    """Their pixels may be wrong in the rest of the light, of which the reflected light says nothing."""
    apart, whole = Frame(0.02, seed=4), Frame(0.02, seed=4)
    told, without = apart.measured(tells=False), whole.measured()
    assert np.allclose(told.noise, without.noise)
    assert told.told_noise.mean() > 10.0 * without.told_noise.mean()


def test_the_rest_of_the_light_is_not_heard_where_it_is_all_noise():
    """Were it, one probe would tell little more than noise; what it is off by would count too."""
    frame = Frame(0.0, seed=5)
    frame.passes[COLOUR_PASS][..., :3] += 0.02
    assert frame.measured().excess.mean() < 0.1 * SPACING**2 * 0.02**2


def test_that_the_noise_of_the_frame_is_not_known_for_sure_widens_the_interval():
    told = estimate(Frame(0.05, seed=3).measured())
    error = 1.96 * TUNING.residual_noise_relative_error * (told.honest_ratio**2 - 1.0)
    assert error < told.honest_high**2 - told.honest_ratio**2 < 1.2 * error


def test_a_warped_part_without_noise_is_held_against_the_noise_of_the_frame():
    """As where all that is noisy stands before a black world, and was traced."""
    measured = Frame(0.05, seed=3).measured()
    nothing = np.zeros_like(measured.noise)
    quiet = replace(measured, noise=nothing, seen_noise=nothing)
    assert estimate(quiet).honest_ratio == estimate(measured).honest_ratio > 1.0
    assert worst_tiles(quiet) > 1.0
    assert np.isfinite(tile_estimates(quiet)).all()


@pytest.mark.parametrize("off", [0.0, 0.02, 0.05])
@pytest.mark.parametrize("by_component", [True, False])
def test_estimates_are_honest_after_the_choice(off, by_component):
    differences = []
    for seed in range(12):
        frame = Frame(off, seed=seed, by_component=by_component)
        measured = frame.measured()
        chosen = choose_tiles(measured, 1.1, worst=1.8)
        pixels = measured.probes.pixels_of(chosen)
        kept = replace(measured, refined=chosen, remaining=np.where(chosen, 0.0, measured.remaining))
        differences.append(estimate(kept).excess - frame.true_excess(pixels))
    error = np.std(differences) / np.sqrt(len(differences))
    assert abs(np.mean(differences)) < FLATTERED + 3.0 * error


@pytest.mark.parametrize("by_component", [True, False])
def test_what_a_pilot_has_corrected_is_not_corrected_twice(by_component):
    frame = Frame(0.0, seed=6, by_component=by_component)
    for name in {COLOUR_PASS, NOISY_PASS, VIEW_DEPENDENT_PASS} & set(frame.passes):
        frame.passes[name][..., :3] += 0.05
    frame.measured(spacings=(4 * SPACING, SPACING))
    assert abs((frame.corrected - frame.truth)[..., :3].mean()) < 0.01
