"""Alpha counts as light does: where it is wrong, probes say so, and its tiles are traced."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from stereo_reproject.estimate.tracing import ProbedTracing, WarpedTarget
from stereo_reproject.images.denoising import Denoising
from stereo_reproject.images.passes import ALBEDO_PASS, COLOUR_PASS, NOISY_PASS, NORMAL_PASS
from stereo_reproject.settings.accuracy import SETTINGS, for_size
from stereo_reproject.trace.fill import SourceCost
from stereo_reproject.trace.planner import FillPlanner

SIZE = (216, 288)
NOISE = 0.02
WRONG = 0.3
HALF = np.s_[:, : SIZE[1] // 2]


class Catcher:
    """A shadow catcher on a transparent film: black, its alpha the shadow, which is noisy; half of it warped wrong."""

    def __init__(self, wrong: float, *, denoised: bool, seed: int = 1) -> None:
        self.rng = np.random.default_rng(seed)
        warped = self.traced()
        warped[HALF][..., 3] += wrong
        passes = {COLOUR_PASS: warped}
        if denoised:
            nothing = np.zeros((*SIZE, 3), np.float32)
            passes |= {NOISY_PASS: warped.copy(), ALBEDO_PASS: nothing, NORMAL_PASS: nothing}
        self.guides = {name: image for name, image in passes.items() if name in (ALBEDO_PASS, NORMAL_PASS)}
        view = SimpleNamespace(
            passes=passes,
            reasons=np.zeros(SIZE, np.uint16),
            sampled=lambda place: warped[place],
            variance_share=np.ones(SIZE, np.float32),
            single=None,
        )
        denoising = Denoising(lambda pictures: [p[NOISY_PASS][..., :3] for p in pictures], 0.0) if denoised else None
        planner = FillPlanner("packed", SourceCost(60.0, 1.0), {})
        self.eye = ProbedTracing(
            self,
            WarpedTarget(
                "right", view, planner, for_size(SETTINGS["balanced"], SIZE[0] * SIZE[1]), denoising, True, seed
            ),
        )

    def traced(self):
        colour = np.zeros((*SIZE, 4), np.float32)
        colour[..., 3] = 0.4 + self.rng.normal(0.0, NOISE, SIZE)
        return colour

    def trace(self, _method, requests):
        [request] = requests
        colours = [self.traced()[mask] for mask in request.masks]
        guides = {name: np.concatenate([image[mask] for mask in request.masks]) for name, image in self.guides.items()}
        both = {name: np.concatenate(colours) for name in ((COLOUR_PASS, NOISY_PASS) if guides else (COLOUR_PASS,))}
        return [{**both, **guides}]


@pytest.mark.parametrize("denoised", [False, True])
def test_an_alpha_that_is_wrong_is_told_and_traced(denoised):
    eye = Catcher(WRONG, denoised=denoised).eye
    eye.fill()
    refinement = eye.refine()
    assert refinement.pixels[HALF].mean() > 0.9
    assert refinement.estimate.noise_ratio < 1.5
    np.testing.assert_allclose(eye.target.colour[HALF][..., 3].mean(), 0.4, atol=NOISE)


@pytest.mark.parametrize("denoised", [False, True])
def test_an_alpha_that_is_right_but_for_noise_is_left_alone(denoised):
    """The denoiser leaves alpha as it is: its noise, which is all of the frame's, stays in what is delivered."""
    told = []
    for seed in range(8):
        eye = Catcher(0.0, denoised=denoised, seed=seed).eye
        eye.fill()
        refinement = eye.refine()
        assert refinement.pixels.mean() < 0.05
        told.append(refinement.estimate.noise_ratio)
    assert np.mean(told) == pytest.approx(1.0, abs=0.05)
