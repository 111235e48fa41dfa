"""Probes of a denoised picture: errors are found that single probes are too noisy for, and the estimate is honest."""

from dataclasses import replace

import numpy as np
import pytest

from stereo_reproject.estimate.denoised import DenoisedEstimator
from stereo_reproject.estimate.evidence import ProbeTraces, measure_tiles
from stereo_reproject.estimate.noise_ratio import estimate
from stereo_reproject.estimate.probes import place_regular_probes
from stereo_reproject.estimate.refinement import _on_mostly_traced_materials, choose_tiles
from stereo_reproject.images.contrast import Contrast
from stereo_reproject.images.denoising import Denoising
from stereo_reproject.images.metrics import tone
from stereo_reproject.images.passes import ALBEDO_PASS, COLOUR_PASS, NOISY_PASS, NORMAL_PASS
from tests.estimate.colours import opaque
from tests.images.test_denoising import blurred

SIZE = (240, 360)
NOISE = 0.05
LEFT = 0.02
SPACING = 6
MIRROR = np.s_[60:150, 90:210]

FLATTERED = 0.1
"""How far estimates of noise_ratio^2 may be from the truth on average over the frames of the test."""


class Frame:
    """A picture with waves, warped with as little noise as a denoiser leaves, wrong by stripes in a rectangle."""

    def __init__(self, bias, seed):
        self.rng = np.random.default_rng(seed)
        y, x = np.mgrid[0 : SIZE[0], 0 : SIZE[1]]
        waves = 0.4 + 0.1 * np.sin(x / 30) * np.cos(y / 25)
        self.truth = opaque(np.repeat(waves[..., None], 4, axis=2).astype(np.float32))
        self.warped = self.noisy(np.sqrt(LEFT) * NOISE)
        self.off = np.zeros(SIZE, np.float32)
        self.off[MIRROR] = bias * np.sign(np.sin(x[MIRROR] / 5.0))
        self.warped[..., :3] += self.off[..., None]
        self.shown = np.zeros(SIZE, int)
        self.shown[MIRROR] = 1
        self.probes = place_regular_probes(np.ones(SIZE, bool), spacing=SPACING, seed=seed)

    def noisy(self, noise=NOISE):
        return opaque((self.truth + self.rng.normal(0.0, noise, self.truth.shape)).astype(np.float32))

    def measured(self):
        once, again = (self.noisy()[self.probes.mask] for _ in range(2))
        nothing = np.zeros((*SIZE, 3), np.float32)
        noisy = opaque(self.noisy() + self.off[..., None])
        passes = {NOISY_PASS: noisy, ALBEDO_PASS: nothing, NORMAL_PASS: nothing, COLOUR_PASS: self.warped}
        contrast = Contrast(np.full(SIZE, 1e-4, np.float32), np.zeros(SIZE, np.float32))
        denoising = Denoising(lambda pictures: blurred(pictures, 2), LEFT)
        everything = np.ones(SIZE, bool)
        traces = ProbeTraces(self.warped[self.probes.mask], once, again)
        estimator = DenoisedEstimator(contrast, noisy, denoising)
        seen = estimator.analyse(self.probes, passes, everything, traces, self.shown)
        return measure_tiles(
            self.probes,
            everything,
            contrast,
            replace(traces, warped=seen.at_probes),
            materials=self.shown,
            remaining_noise=LEFT,
            selection=seen.selection,
        )

    def true_excess(self, pixels):
        """noise_ratio^2 - 1 when the pixels are traced: of the warped ones only what is off counts."""
        toned = tone(self.truth + self.off[..., None]) - tone(self.truth)
        slope = 1.0 / (1.0 + self.truth[..., 0]) ** 4
        return np.mean(toned**2, axis=-1)[~pixels].sum() / (2.0 * LEFT * NOISE**2 * slope).sum()


def test_what_is_wrong_is_found_and_little_else_is_traced():
    frame = Frame(0.05, seed=1)
    measured = frame.measured()
    chosen = choose_tiles(measured, 1.1, worst=1.8)
    pixels = measured.probes.pixels_of(chosen)
    wrong = np.zeros(SIZE, bool)
    wrong[MIRROR] = True
    assert np.mean(pixels[wrong]) > 0.7
    assert np.mean(pixels[~wrong]) < 0.2


def test_where_nothing_is_wrong_next_to_nothing_is_traced():
    measured = Frame(0.0, seed=2).measured()
    assert np.mean(choose_tiles(measured, 1.1, worst=1.8)) < 0.15


@pytest.mark.parametrize(("part", "whole"), [(0.6, True), (0.4, False)])
def test_a_material_most_of_which_is_traced_is_traced_as_a_whole(part, whole):
    measured = Frame(0.05, seed=1).measured()
    mirror = np.nonzero(measured.materials.of_probe == 1)[0]
    chosen = np.zeros(measured.refined.size, bool)
    chosen[mirror[: round(part * mirror.size)]] = True
    more = _on_mostly_traced_materials(measured, chosen, 0.0)
    assert more[mirror].all() == whole
    assert not np.delete(more, mirror).any()
    # What was traced before counts too.
    before = replace(measured, refined=chosen)
    assert _on_mostly_traced_materials(before, np.zeros_like(chosen), 0.0)[mirror].all() == whole
    # Where there is no contrast, nothing can be seen to have moved.
    assert not _on_mostly_traced_materials(measured, chosen, 0.1).any()
    # Where colours are noisy, the probes tell of every tile what it needs.
    assert not _on_mostly_traced_materials(replace(measured, selection=None), chosen, 0.0).any()


@pytest.mark.parametrize("bias", [0.0, 0.02, 0.05])
def test_estimates_are_honest_though_tiles_are_chosen_by_their_own_probe(bias):
    """Were what is left told by the same traces that tiles are chosen by, it would seem less than it is."""
    differences = []
    for seed in range(12):
        frame = Frame(bias, seed=seed)
        measured = frame.measured()
        chosen = choose_tiles(measured, 1.1, worst=1.8)
        pixels = measured.probes.pixels_of(chosen)
        kept = measured.__class__(
            **{**measured.__dict__, "refined": chosen, "remaining": np.where(chosen, 0.0, measured.remaining)}
        )
        differences.append(estimate(kept).excess - frame.true_excess(pixels))
    error = np.std(differences) / np.sqrt(len(differences))
    assert abs(np.mean(differences)) < FLATTERED + 3.0 * error
