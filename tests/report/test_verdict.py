"""The words that artists read of a pair and of an animation."""

import copy
import json
from pathlib import Path

import pytest

from stereo_reproject.estimate.missing import NOTHING_DIFFERS, PROMISES_NOTHING
from stereo_reproject.report.verdict import (
    AS_GOOD,
    MAY_BE_WRONG,
    NEARLY_AS_GOOD,
    NOT_AS_GOOD,
    TOO_CLOSE,
    UNPROMISED,
    Verdict,
    accuracy_name,
    animation_words,
    duration,
    full_render_gain,
    picture_words,
    predicted_words,
    quality_of,
    quality_of_animation,
    reuse_in_animation,
    saved_by_animation,
    saved_seconds,
    saved_words,
    time_words,
)

WHOLE = json.loads((Path(__file__).parent / "whole_report.json").read_text(encoding="utf-8"))
NO_ESTIMATE = {"noise_ratio": None, "honest_ratio": None, "wrong_tiles": None, "kept": None}


def report(compare=None, fractions=None, **estimate):
    """A report whose estimate is within its promise, but for what is given."""
    made = copy.deepcopy(WHOLE)
    made["estimate"].update({"honest_ratio": 1.04, "kept": True, "from": "probes", **estimate})
    made["fractions"].update(fractions or {})
    made.pop("compare", None)
    return made | ({"compare": compare} if compare else {})


@pytest.mark.parametrize(
    ("made", "words", "good"),
    [
        (report(), AS_GOOD, True),
        (report(honest_ratio=1.2, promise=1.25), NEARLY_AS_GOOD, True),
        (report(wrong_tiles=0.03), f"{AS_GOOD}, but for 3 % of it: see Uncertain Areas", True),
        (report(honest_ratio=1.3, kept=False), NOT_AS_GOOD, False),
        # The worst tiles may break a promise that the frame as a whole keeps.
        (report(honest_ratio=1.01, kept=False, worst_tiles=2.0), NOT_AS_GOOD, False),
        # A denoised picture's interval may hold the promise.
        (report(honest_ratio=1.08, kept=None), TOO_CLOSE, None),
        (report(**NO_ESTIMATE, promise=None, **{"from": PROMISES_NOTHING}), UNPROMISED, None),
        (report(**NO_ESTIMATE, **{"from": NOTHING_DIFFERS}), AS_GOOD, True),
        (report(**NO_ESTIMATE, **{"from": "no noise"}), "Not checked: no noise", None),
        (report(fractions={"rerendered": 1.0}), f"{AS_GOOD}: all of it was rendered", True),
        (report(kept=None, compare={"honest_ratio": 1.09}), f"{AS_GOOD} (measured)", True),
        (report(compare={"honest_ratio": 1.4, "wrong_tiles": 0.2}), f"{NOT_AS_GOOD} (measured)", False),
        (report(compare={"honest_ratio": None}), AS_GOOD, True),
        (report(**NO_ESTIMATE, promise=None, compare={"honest_ratio": 1.4}), f"{NOT_AS_GOOD} (measured)", False),
    ],
)
def test_quality_is_said_in_plain_words(made, words, good):
    assert quality_of(made) == Verdict(words, good)


@pytest.mark.parametrize(("kept", "good"), [(True, None), (False, False)])
def test_no_tick_stands_above_a_warning_that_something_may_be_wrong(kept, good):
    made = report(kept=kept)
    before = quality_of(made)
    made["warnings"] += [f"4.0% of the picture is too near, and {MAY_BE_WRONG}; move the camera"]
    after = quality_of(made)
    assert after.good is good
    assert after.words == (before.words + ", but for what a warning names" if kept else before.words)
    assert quality_of_animation([{**made, "frame": 1}]).good is good


@pytest.mark.parametrize(
    ("seconds", "words"),
    [
        (190.0, "3 min 10 s saved"),
        (7500.0, "2 h 5 min saved"),
        (3599.7, "1 h saved"),
        (7199.0, "2 h saved"),
        (59.6, "1 min saved"),
        (0.42, "0.4 s saved"),
        (9.97, "10 s saved"),
        (0.0, "No time saved"),
        (-0.04, "No time saved"),
        (-12.2, "No time saved: 12 s longer"),
    ],
)
def test_time_is_said_in_plain_words(seconds, words):
    assert saved_words(seconds) == words


@pytest.mark.parametrize(
    ("seconds", "plain", "words"),
    [
        (17.0, 43.0, "17 s saved of 43 s (40 %)"),
        (0.2, 300.0, "0.2 s saved of 5 min (0 %)"),
        (-12.2, 43.0, "No time saved: 12 s longer"),
    ],
)
def test_it_is_said_of_what_the_time_is_saved(seconds, plain, words):
    assert saved_words(seconds, plain) == words


def test_a_duration_never_has_sixty_of_a_unit():
    assert not any("60 " in duration(0.1 * tenth) for tenth in range(90_000))


def seconds(**stages):
    return {"seconds": {"source": 60.0, "total": 70.0, **stages}, "predicted_speedup": 1.5}


def test_what_is_saved_is_the_plain_second_eye_less_what_ours_has_taken():
    assert saved_seconds(seconds()) == pytest.approx(35.0)
    # Loading a copy, measuring and writing are waited for, though no render has them; a comparison is asked for.
    assert saved_seconds(seconds(load=3.0, account=1.0, write=1.0, compare=200.0)) == pytest.approx(30.0)
    assert saved_seconds(seconds() | {"predicted_speedup": 0.9}) == pytest.approx(-7.0)
    assert saved_seconds(seconds() | {"compare": {"multiview_seconds": 100.0}}) == pytest.approx(30.0)


def frame(number, **estimate):
    return {**report(**estimate), "frame": number}


def test_an_animation_names_the_frames_that_are_worse():
    good, worse, unknown = {}, {"kept": False}, {"kept": None}
    assert quality_of_animation([frame(1), frame(2)]) == Verdict(AS_GOOD, good=True)
    found = quality_of_animation([frame(1, **worse), frame(2, **worse), frame(3, **good), frame(4, **unknown)])
    assert found == Verdict("Not as good as rendering both eyes: 2 of 4 frames (1-2)", good=False)
    assert quality_of_animation([frame(1), frame(2, **unknown)]).good is None
    assert quality_of_animation([{"frame": 1, "estimate": None}, {"frame": 2, "estimate": {"kept": True}}]) is None
    assert saved_by_animation({"multiview_seconds": 9000.0, "seconds": 1800.0}) == pytest.approx(7200.0)


def reused(number, key=1, whole=None, **estimate):
    """A frame's row whose first eye was made from a key frame too, or that was rendered whole."""
    first = None if whole else report(**estimate)["estimate"]
    return frame(number) | {
        "reuse": {"key_frame": None if whole else key, "whole": whole, "first_eye_traced": 0.1, "first_eye": first}
    }


def test_a_made_frame_is_as_good_as_the_worse_of_its_eyes():
    assert quality_of_animation([reused(1, whole="a key frame"), reused(2)]) == Verdict(AS_GOOD, good=True)
    assert quality_of_animation([reused(1, whole="a key frame"), reused(2, kept=False)]).good is False
    measured = reused(2) | {"compare": {"honest_ratio": 1.0, "first_eye": {"honest_ratio": 1.3}}}
    assert quality_of_animation([reused(1, whole="a key frame"), measured]).good is False


def test_an_animation_says_how_many_frames_were_made_from_earlier_ones_and_why_others_were_not():
    key = reused(1, whole="a key frame")
    assert reuse_in_animation([frame(1), frame(2)]) is None
    assert reuse_in_animation([key]) is None
    assert reuse_in_animation([key, reused(2), reused(3)]) == Verdict(
        "2 of 3 frames were made from earlier ones", good=True
    )
    changed = reused(3, whole="changed since frame 1: light Lamp")
    assert reuse_in_animation([key, reused(2), changed]) == Verdict(
        "1 of 3 frames were made from earlier ones; 1 could not be: changed since frame 1: light Lamp", good=None
    )


def preview(**changes):
    """A source of 10 s, 2 of them the sync, and a target that takes 4 s, half of it whatever the size."""
    stages = {"plan": 0.0, "source": 10.0, "fill": 4.0, "total": 14.0}
    costs = {"render_call_seconds": 1.5, "resync_share": 0.25}
    made = {"size": [480, 270], "samples": 16, "seconds": stages, "predicted_speedup": 18.0 / 14.0}
    return made | {"fill": {"costs": costs}} | changes


def test_a_preview_predicts_the_full_render():
    assert full_render_gain(preview(), (480, 270), 16) == pytest.approx(18.0 / 14.0)
    # 8 s of rendering become 128, and the 2 s of tracing 32.
    assert full_render_gain(preview(), (960, 540), 64) == pytest.approx((2 + 256) / (2 + 128 + 2 + 32))
    stages = {"plan": 1.0, "source": 10.0, "denoise_source": 1.0, "fill": 4.0, "denoise_target": 1.0, "total": 17.0}
    denoised = preview(seconds=stages, predicted_speedup=20.0 / 17.0)
    assert full_render_gain(denoised, (480, 270), 16) == pytest.approx(20.0 / 17.0)


@pytest.mark.parametrize(
    ("gain", "words"),
    [
        (2.0, "A full render is predicted to take 50 % less time than rendering both eyes"),
        (1.999, "A full render is predicted to take 49 % less time than rendering both eyes"),
        (1.02, "A full render is predicted to save little or no time over rendering both eyes"),
        (0.8, "A full render is predicted to save little or no time over rendering both eyes"),
    ],
)
def test_a_prediction_is_said_in_plain_words(gain, words):
    assert predicted_words(gain) == words


def test_accuracies_have_names_for_artists():
    assert [accuracy_name(name) for name in ("draft", "high")] == ["Fast", "High"]


def test_a_preview_claims_no_gain_of_its_own():
    assert quality_of(report(), preview=True) == Verdict("As good as rendering both eyes of this preview", good=True)
    not_as_good = "Not as good as rendering both eyes of this preview: "
    assert quality_of(report(kept=False), preview=True).words.startswith(not_as_good)
    assert time_words(seconds()) == "35 s saved of 1 min 45 s (33 %)"
    assert time_words(seconds(), full_gain=1.5) == predicted_words(1.5)


def test_a_picture_has_a_name():
    assert picture_words("Slot 2", 7, "14:32") == "Slot 2, frame 7, 14:32"
    assert picture_words(None, None, "14:32", preview=True) == "Preview: 14:32"


@pytest.mark.parametrize(
    ("slot", "frame", "words"),
    [
        ("Slot 1", 6, "Animation, 09:28; Slot 1 has its last frame, 6"),
        (None, 6, "Animation, 09:28, to frame 6"),
        ("Slot 1", None, "Animation, 09:28"),
    ],
)
def test_an_animation_is_not_named_as_its_last_frame_alone(slot, frame, words):
    assert animation_words(slot, frame, "09:28") == words
