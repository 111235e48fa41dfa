"""What a sketch predicts: exact where the cost follows its model, and a range where only probes will know."""

import numpy as np
import pytest

from stereo_reproject.images.effects import Effect
from stereo_reproject.images.reasons import Reason
from stereo_reproject.pipeline.prediction import (
    HoleShares,
    Sketch,
    effect_shares,
    predict,
    predict_holes,
    predict_samples,
    predict_source,
    prediction_fields,
    shown_differently,
    sketch_accuracy,
)
from stereo_reproject.settings.accuracy import SETTINGS
from stereo_reproject.trace.costs import TraceCosts
from stereo_reproject.trace.fill import SourceCost, choose_fill
from stereo_reproject.trace.planner import FillPlanner

ASSUMED_COSTS = TraceCosts()

FREE: dict[str, str | None] = {"packed": None, "card": None}
BALANCED = SETTINGS["balanced"]


def sketch(*, sync, call, per_sample, pixels=1000, samples=(1, 5)):
    """As it would be measured, were each call to cost `call`, and each sample of a pixel `per_sample`."""
    seconds = tuple(sync + call + per_sample * pixels * count for count in samples)
    return Sketch(pixels, samples, (seconds[0], seconds[1]), (sync, sync))


def test_the_cost_of_the_source_is_extrapolated():
    cost = predict_source(sketch(sync=2.0, call=0.5, per_sample=1e-4), pixels=16000, samples=64)
    assert cost.sync_seconds == 2.0
    assert cost.seconds == pytest.approx(2.0 + 0.5 + 1e-4 * 16000 * 64)


@pytest.mark.parametrize(("limit", "samples"), [(0.0, 64), (200.0, 64), (16.1, 10), (0.1, 1)])
def test_a_time_limit_leaves_fewer_samples(limit, samples):
    measured = sketch(sync=2.0, call=0.5, per_sample=1e-4)
    assert predict_samples(measured, pixels=16000, samples=64, limit=limit) == samples


def test_a_sketch_whose_samples_cost_less_than_chance_stays_positive():
    measured = Sketch(1000, (1, 5), (2.6, 2.5), (2.0, 2.0))
    cost = predict_source(measured, pixels=16000, samples=64)
    assert cost.per_frame >= 0.5
    assert np.isfinite(cost.seconds)


def test_holes_keep_their_share_and_silhouettes_their_pixels():
    reasons = np.zeros((10, 10), np.uint16)
    reasons[0] = Reason.DISOCCLUDED.bit | Reason.SILHOUETTE.bit
    reasons[1, :5] = Reason.OUTSIDE.bit
    reasons[2:4] = Reason.SILHOUETTE.bit
    holes = predict_holes(reasons, 0.25)
    assert holes.disoccluded == pytest.approx(0.10)
    assert holes.outside == pytest.approx(0.05)
    assert holes.silhouette == pytest.approx(0.05)
    assert holes.total == pytest.approx(0.20)


def test_the_steps_of_a_sketch_are_smaller():
    scaled = sketch_accuracy(BALANCED, 0.25)
    assert scaled.silhouette_step == BALANCED.silhouette_step / 4
    assert scaled.silhouette_radius == BALANCED.silhouette_radius
    assert sketch_accuracy(BALANCED, 1.0).silhouette_step == BALANCED.silhouette_step


def flags(*counts):
    """(10, 10) flags, of each (effect, count) that many pixels, one after the other."""
    values = [float(effect.value) for effect, count in counts for _ in range(count)]
    return np.array(values + [0.0] * (100 - len(values)), np.float32).reshape(10, 10)


def test_shares_of_effects():
    called_for = Effect.GLOSSY | Effect.ALPHA | Effect.HAIR | Effect.BUMP
    image = flags((Effect.GLOSSY, 20), (Effect.GLOSSY | Effect.ALPHA, 10), (Effect.BUMP, 30))
    shares = effect_shares(called_for, image)
    assert shares == {Effect.GLOSSY: 0.3, Effect.ALPHA: 0.1, Effect.HAIR: 0.0}
    assert shown_differently(called_for, image) == pytest.approx(0.3)


@pytest.mark.parametrize("effect", [Effect.DEPTH_OF_FIELD, Effect.MOTION_BLUR, Effect.VOLUME])
def test_what_no_material_shows_may_be_anywhere(effect):
    assert effect_shares(effect, flags()) == {effect: 1.0}
    assert shown_differently(effect | Effect.GLOSSY, flags((Effect.GLOSSY, 10))) == 1.0


def test_without_flags_anything_may_be_anywhere():
    assert shown_differently(Effect.GLOSSY, None) == 1.0
    assert shown_differently(Effect.BUMP | Effect.DENOISING, None) == 0.0


COST = SourceCost(102.0, 2.0)
TENTH = HoleShares(0.04, 0.01, 0.05, 0.1)


def predicted(accuracy=BALANCED, asked="auto", blockers=FREE, shown=0.0):
    return predict(FillPlanner(asked, COST, blockers), 1.0, TENTH, accuracy, shown)


def test_a_diffuse_scene_has_one_figure():
    prediction = predicted()
    fill = choose_fill("auto", 0.1, COST, FREE).predicted_seconds
    assert prediction.total == (102.0 + 1.0 + fill,) * 2
    assert prediction.multiview == 202.0
    assert prediction.gain == pytest.approx((202.0 / prediction.total[0],) * 2)
    assert prediction.probes == 0.0


def test_what_may_be_seen_differently_makes_it_a_range():
    prediction = predicted(shown=0.3)
    plain = predicted()
    assert prediction.probes == pytest.approx(2.0 * 0.9 / BALANCED.probe_spacing**2)
    assert prediction.total[0] > plain.total[0]
    refine = choose_fill("auto", 0.3 * 0.9, COST, FREE).predicted_seconds
    assert prediction.total[1] == pytest.approx(prediction.total[0] + refine)
    assert prediction.gain[0] < prediction.gain[1] < plain.gain[0]


def test_a_draft_has_no_probes():
    assert predicted(accuracy=SETTINGS["draft"], shown=1.0).total == predicted().total


def test_probes_behind_a_card_are_further_apart():
    card = predicted(blockers={**FREE, "packed": "no OSL"}, shown=0.3)
    assert card.fill.method == "card"
    assert card.probes == pytest.approx(predicted(shown=0.3).probes / 9)


def test_a_whole_eye_leaves_nothing_to_refine():
    prediction = predicted(asked="full", shown=1.0)
    assert prediction.probes == 0.0
    assert prediction.total[0] == prediction.total[1]
    assert prediction.gain[0] == pytest.approx(202.0 / (102.0 + 1.0 + COST.fixed(ASSUMED_COSTS) + 100.0))


def test_the_fields_say_what_they_rest_on():
    fields = prediction_fields(predicted(shown=0.3), "two sketches")
    assert fields["rests_on"] == "two sketches"
    assert fields["gain"]["low"] < fields["gain"]["high"]
    assert fields["fractions"]["holes"] == 0.1
