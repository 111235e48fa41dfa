"""A thing that is hardly there, which the depth pass lacks and so the warp misses: its traces say what they show."""

from types import SimpleNamespace

import numpy as np
import pytest

from stereo_reproject.estimate.tracing import ProbedTracing, WarpedTarget
from stereo_reproject.images.denoising import Denoising
from stereo_reproject.images.effects import Effect
from stereo_reproject.images.passes import COLOUR_PASS, EFFECTS_PASS, NOISY_PASS, VIEW_DEPENDENT_PASS
from stereo_reproject.settings.accuracy import SETTINGS, for_size
from stereo_reproject.trace.fill import SourceCost
from stereo_reproject.trace.planner import FillPlanner
from tests.estimate.colours import opaque

SIZE = (216, 288)
NOISE = 0.02
DARKER = 0.1
MISSED = np.s_[80:140, 100:180]
"""Where the target shows a grey veil, and the warp the floor behind it."""


class Veil:
    """A glossy floor with a veil before it, which darkens diffuse light alone; traces have EFFECTS_PASS if it tells."""

    def __init__(self, *, tells):
        self.rng, self.tells = np.random.default_rng(3), tells
        self.effects = np.full((*SIZE, 1), Effect.GLOSSY.value, np.float32)
        clean = opaque(np.full((*SIZE, 4), 0.4, np.float32))
        passes = {
            COLOUR_PASS: clean,
            NOISY_PASS: self.noisy(clean),
            EFFECTS_PASS: self.effects.copy(),
            VIEW_DEPENDENT_PASS: np.full((*SIZE, 3), 0.1, np.float32),
        }
        self.truth = clean.copy()
        self.truth[MISSED][..., :3] -= DARKER
        self.effects[MISSED] = (Effect.GLOSSY | Effect.ALPHA).value
        view = SimpleNamespace(
            passes=passes,
            reasons=np.zeros(SIZE, np.uint16),
            variance_share=np.ones(SIZE, np.float32),
            single=None,
            places=lambda place: (place[1].astype(float), place[0].astype(float)),
        )
        planner = FillPlanner("packed", SourceCost(60.0, 1.0), {})
        accuracy = for_size(SETTINGS["balanced"], SIZE[0] * SIZE[1])
        denoising = Denoising(lambda pictures: [p[NOISY_PASS][..., :3] for p in pictures], 1e-5)
        self.eye = ProbedTracing(self, WarpedTarget("right", view, planner, accuracy, denoising, True, 1))

    def noisy(self, clean):
        return opaque(clean + self.rng.normal(0.0, NOISE, clean.shape)).astype(np.float32)

    def trace(self, _method, requests):
        [request] = requests
        pixels = np.concatenate([np.argwhere(mask) for mask in request.masks]).T
        colour = self.noisy(self.truth[tuple(pixels)])
        passes = {COLOUR_PASS: colour, NOISY_PASS: colour, VIEW_DEPENDENT_PASS: np.full((len(colour), 3), 0.1)}
        return [{**passes, EFFECTS_PASS: self.effects[tuple(pixels)]} if self.tells else passes]


@pytest.mark.parametrize("tells", [True, False])
def test_what_the_warp_has_missed_is_traced_where_traces_say_that_something_else_is_there(tells):
    """By reflected light alone, which the veil leaves as it is, nothing would seem wrong."""
    veil = Veil(tells=tells)
    veil.eye.fill()
    traced = veil.eye.refine().pixels[MISSED].mean()
    assert traced > 0.9 if tells else traced < 0.5
