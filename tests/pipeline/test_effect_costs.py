"""Accounts: pixels and seconds are on the effect that has asked for them, and on none twice."""

import numpy as np
import pytest

from stereo_reproject.estimate.evidence import ProbeTraces, measure_tiles
from stereo_reproject.estimate.probes import place_random_probes
from stereo_reproject.images.contrast import contrast_of
from stereo_reproject.images.effects import Effect
from stereo_reproject.images.effects_pass import UNKNOWN_EFFECTS
from stereo_reproject.images.metrics import tone
from stereo_reproject.images.reasons import Reason
from stereo_reproject.pipeline.effect_costs import effect_costs

SIZE = (10, 20)
SECONDS = {"source": 9.0, "fill": 4.0, "refine": 2.0}


def frame():
    """Left half glossy, right half glass; a column of disoccluded pixels, a refined block in each half, two probes."""
    shown = np.full(SIZE, Effect.GLOSSY.value, np.int32)
    shown[:, 10:] = Effect.TRANSMISSION.value
    reasons = np.zeros(SIZE, np.uint16)
    reasons[:, 9] = Reason.DISOCCLUDED.bit
    reasons[2:4, 0:3] = Reason.REFINED.bit
    reasons[2:4, 12:14] = Reason.REFINED.bit
    reasons[6, 3] = reasons[6, 15] = Reason.PROBE.bit
    return shown, reasons


def test_what_holes_cost_is_on_nobody_s_account():
    shown, reasons = frame()
    told = effect_costs(Effect.GLOSSY | Effect.TRANSMISSION, shown, reasons, reasons > 0, SECONDS, None)
    assert told[Effect.GLOSSY].fraction == pytest.approx(7 / 200)
    assert told[Effect.TRANSMISSION].fraction == pytest.approx(5 / 200)
    per_fill = 4.0 / (10 + 2 * 2)
    assert told[Effect.GLOSSY].seconds == pytest.approx(6 * 2.0 / 10 + 2 * per_fill)
    assert told[Effect.TRANSMISSION].seconds == pytest.approx(4 * 2.0 / 10 + 2 * per_fill)
    assert told[Effect.GLOSSY].excess is None


def test_only_what_is_called_for_and_may_look_different_has_an_account():
    shown, reasons = frame()
    told = effect_costs(Effect.GLOSSY | Effect.BUMP | Effect.DENOISING, shown, reasons, reasons > 0, SECONDS, None)
    assert set(told) == {Effect.GLOSSY}
    assert effect_costs(Effect(0), shown, reasons, reasons > 0, SECONDS, None) == {}


def test_a_pixel_of_two_effects_is_paid_for_once():
    shown, reasons = frame()
    shown[:] = (Effect.GLOSSY | Effect.TRANSMISSION).value
    told = effect_costs(Effect.GLOSSY | Effect.TRANSMISSION, shown, reasons, reasons > 0, SECONDS, None)
    assert told[Effect.GLOSSY].fraction == told[Effect.TRANSMISSION].fraction == pytest.approx(12 / 200)
    total = sum(account.seconds for account in told.values())
    assert total == pytest.approx(2.0 + 4 * 4.0 / 14)


def test_a_reason_that_is_an_effect_s_own_is_on_its_account():
    shown, reasons = frame()
    reasons[:] = 0
    reasons[0, :5] = Reason.DEFOCUS.bit
    reasons[1, :3] = Reason.VOLUME.bit
    told = effect_costs(
        Effect.GLOSSY | Effect.DEPTH_OF_FIELD | Effect.VOLUME, shown, reasons, reasons > 0, SECONDS, None
    )
    assert told[Effect.GLOSSY].fraction == 0.0
    assert told[Effect.DEPTH_OF_FIELD].fraction == pytest.approx(5 / 200)
    assert told[Effect.VOLUME].fraction == pytest.approx(3 / 200)


def test_where_it_is_not_known_what_is_shown_all_effects_pay():
    shown, reasons = frame()
    told = effect_costs(
        Effect.GLOSSY | Effect.ALPHA, np.full_like(shown, UNKNOWN_EFFECTS), reasons, reasons > 0, SECONDS, None
    )
    assert told[Effect.GLOSSY] == told[Effect.ALPHA]
    assert told[Effect.GLOSSY].fraction == pytest.approx(12 / 200)


def test_matte_pixels_are_on_nobody_s_account_but_their_probes_cost_everybody():
    shown, reasons = frame()
    shown[:] = 0
    told = effect_costs(Effect.GLOSSY | Effect.ALPHA, shown, reasons, reasons > 0, SECONDS, None)
    assert told[Effect.GLOSSY].fraction == told[Effect.ALPHA].fraction == 0.0
    total = sum(account.seconds for account in told.values())
    assert total == pytest.approx(2.0 + 4 * 4.0 / 14)


def test_a_full_render_is_on_the_account_of_what_asked_for_it():
    shown, reasons = frame()
    reasons[reasons != Reason.DISOCCLUDED.bit] = 0
    told = effect_costs(Effect.GLOSSY | Effect.TRANSMISSION, shown, reasons, np.ones(SIZE, bool), {"fill": 4.0}, None)
    assert told[Effect.GLOSSY].fraction == pytest.approx(90 / 200)
    assert told[Effect.GLOSSY].seconds == pytest.approx(4.0 * 90 / 200)


def test_a_pixel_of_two_reasons_counts_for_both():
    shown, reasons = frame()
    reasons[:] = 0
    reasons[0, :5] = Reason.VOLUME.bit | Reason.TRANSPARENT.bit
    told = effect_costs(Effect.VOLUME | Effect.TRANSMISSION, shown, reasons, reasons > 0, SECONDS, None)
    assert told[Effect.VOLUME].fraction == told[Effect.TRANSMISSION].fraction == pytest.approx(5 / 200)


def test_silhouettes_of_hair_are_on_hair_s_account():
    shown, reasons = frame()
    shown[:, :10] = (Effect.GLOSSY | Effect.HAIR).value
    reasons[:] = 0
    reasons[:4, :] = Reason.SILHOUETTE.bit
    told = effect_costs(Effect.GLOSSY | Effect.HAIR | Effect.TRANSMISSION, shown, reasons, reasons > 0, SECONDS, None)
    assert told[Effect.HAIR].fraction == pytest.approx(40 / 200)
    assert told[Effect.HAIR].seconds == pytest.approx(4.0 * 40 / 80)
    assert told[Effect.GLOSSY].fraction == told[Effect.TRANSMISSION].fraction == 0.0


def test_the_interval_of_an_effect_holds_what_its_pixels_are_off():
    """Wrong where it is glossy, and right where it is glass."""
    rng = np.random.default_rng(2)
    size, noise, bias, hits = (160, 240), 0.05, 0.06, []
    halves = {Effect.GLOSSY: slice(0, 120), Effect.TRANSMISSION: slice(120, 240)}
    truth = np.full((*size, 4), 0.5)
    shown = np.full(size, Effect.GLOSSY.value, np.int32)
    shown[:, 120:] = Effect.TRANSMISSION.value
    for seed in range(30):
        warped, a, b = (truth + rng.normal(0.0, noise, truth.shape) for _ in range(3))
        warped[:, :120] += bias
        contrast = contrast_of(warped, np.ones(size, bool))
        probes = place_random_probes(np.ones(size, bool), spacing=8, seed=seed)
        traces = ProbeTraces(*(image[probes.mask] for image in (warped, a, b)))
        measured = measure_tiles(probes, np.ones(size, bool), contrast, traces)
        told = effect_costs(
            Effect.GLOSSY | Effect.TRANSMISSION, shown, np.zeros(size, np.uint16), np.zeros(size, bool), {}, measured
        )
        w, a, b = (tone(image).astype(np.float64) for image in (warped, a, b))
        for effect, half in halves.items():
            # What probes in all pixels would say.
            true = np.sum(((w - a) * (w - b) - (a - b) ** 2 / 2.0)[:, half]) / np.sum((a - b) ** 2)
            excess, low, high = told[effect].excess
            assert low < excess < high
            hits.append(low <= true <= high)
        assert told[Effect.GLOSSY].excess[1] > told[Effect.TRANSMISSION].excess[0]
    assert np.mean(hits) >= 0.85
