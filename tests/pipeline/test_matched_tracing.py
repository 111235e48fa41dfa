"""How the holes of another engine's picture are filled: traced and matched, or by a second render, and why."""

from types import SimpleNamespace

import numpy as np
import pytest

from stereo_reproject.estimate.tracing import WarpedTarget
from stereo_reproject.images.passes import COLOUR_PASS, DEPTH_PASS
from stereo_reproject.images.reasons import Reason
from stereo_reproject.matching.matching import TracedPixels
from stereo_reproject.pipeline.matched_tracing import MatchedTracing, foreseen_fill
from stereo_reproject.pipeline.tuning import PipelineTuning
from stereo_reproject.settings.accuracy import SETTINGS
from stereo_reproject.trace.fill import SourceCost
from stereo_reproject.trace.planner import FillPlanner

HEIGHT, WIDTH = 90, 120
TRUE, DARK = 0.8, 0.2
"""What the source's engine shows, and what the tracer sees."""


def reprojection():
    """A plain wall with a hole of a tenth of the picture."""
    reasons = np.zeros((HEIGHT, WIDTH), np.uint16)
    reasons[20:50, 40:76] = Reason.DISOCCLUDED.bit
    covered = reasons == 0
    colour = np.where(covered[..., None], TRUE, 0.0) * np.ones((1, 1, 4), np.float32)
    depth = np.where(covered, 5.0, np.inf)[..., None]
    passes = {COLOUR_PASS: colour.astype(np.float32), DEPTH_PASS: depth.astype(np.float32)}
    return SimpleNamespace(passes=passes, reasons=reasons, warp=SimpleNamespace(covered=covered))


class LightMatcher:
    """Traces the wall darker than the picture has it; each pixel takes so many seconds."""

    def __init__(self, *, per_pixel=1e-4, why_not=None):
        self.per_pixel, self.why_not = per_pixel, why_not
        self.asked = []

    def trace(self, method, requests):
        [request] = requests
        count = int(request.pixels.sum())
        self.asked.append((method, count))
        value = TRUE if method == "full" else DARK
        return [{COLOUR_PASS: np.full((count, 4), value, np.float32), DEPTH_PASS: np.full((count, 1), 5.0, np.float32)}]

    def traced_features(self, passes):
        colour = passes[COLOUR_PASS][:, :3]
        some = np.full_like(colour, 0.5)
        normal = np.tile(np.float32((0, 0, 1)), (len(colour), 1))
        depth = passes[DEPTH_PASS][:, 0]
        return TracedPixels(colour, 0.0 * colour, some, 0.0 * colour, normal, 1.0 / depth, depth, depth < 0.0)

    def clean(self, colour):
        return colour

    def trace_cost(self):
        return SourceCost(1.0 + self.per_pixel * self.asked[-1][1], 1.0)

    def unmatchable(self):
        return self.why_not


def filled(matcher, *, asked="auto", seconds=100.0, blockers=None):
    planner = FillPlanner(asked, SourceCost(seconds, 0.0), blockers or {"packed": None, "card": None})
    warped = WarpedTarget("right", reprojection(), planner, SETTINGS["preview"], None, False, 1)
    eye = MatchedTracing(matcher, warped)
    return eye, eye.fill()


def test_holes_are_matched_and_the_rest_stays():
    matcher = LightMatcher()
    eye, choice = filled(matcher)
    assert choice.method == "packed"
    assert np.allclose(eye.target.passes[COLOUR_PASS][..., :3], TRUE, atol=1e-3)
    assert np.all(eye.target.passes[DEPTH_PASS] == 5.0)
    wanted = 30 * 36 + 2 * (30 + 36) + 4
    assert sum(count for _, count in matcher.asked) == wanted == eye.target.traced.sum()
    # tone(TRUE) - tone(DARK) over tone of the picture
    assert eye.correction.mean == pytest.approx((TRUE / 1.8 - DARK / 1.2) / (TRUE / 1.8 * 0.9), rel=0.02)
    assert "packed" not in choice.reason
    assert "against 100.0 s for a second EEVEE render" in choice.reason


def test_what_a_pilot_says_is_dearer_than_a_second_render_is_not_done():
    matcher = LightMatcher(per_pixel=2.0)
    eye, choice = filled(matcher)
    assert [method for method, _ in matcher.asked] == ["packed", "full"]
    assert matcher.asked[1][1] == HEIGHT * WIDTH
    assert choice.method == "full"
    assert choice.reason.startswith("a second EEVEE render, predicted 100.0 s: 1024 pixels took 2049.0 s")
    assert eye.correction is None
    assert np.allclose(eye.target.passes[COLOUR_PASS], TRUE)


@pytest.mark.parametrize(
    ("matcher", "how", "word"),
    [
        (LightMatcher(), {"seconds": 0.5 * PipelineTuning().min_seconds_to_hand_over}, "handing the scene to Cycles"),
        (LightMatcher(why_not="glass is blended"), {}, "glass is blended"),
        (
            LightMatcher(),
            {"blockers": {"packed": "no OSL", "card": "no mask"}},
            "no packed: no OSL",
        ),
    ],
)
def test_a_second_render_is_taken_at_once_and_says_why(matcher, how, word):
    _, choice = filled(matcher, **how)
    assert choice.method == "full"
    assert choice.reason.startswith("a second EEVEE render")
    assert word in choice.reason
    assert [method for method, _ in matcher.asked] == ["full"]


@pytest.mark.parametrize("asked", ["packed", "card", "full"])
def test_what_is_asked_for_is_done(asked):
    matcher = LightMatcher(per_pixel=99.0, why_not="glass is blended")
    _, choice = filled(matcher, asked=asked, seconds=0.5 * PipelineTuning().min_seconds_to_hand_over)
    assert choice.method == asked
    assert {method for method, _ in matcher.asked} == {asked}


def test_without_the_packed_camera_the_other_eye_is_rendered_by_the_same_engine():
    """A card has Cycles go over the whole frame: there is nothing that a pilot could tell."""
    matcher = LightMatcher()
    _, choice = filled(matcher, blockers={"packed": "no OSL", "card": None})
    assert choice.method == "full"
    assert "no OSL" in choice.reason
    assert foreseen_fill("auto", {"packed": "no OSL", "card": None}, None)[0] == "full"
