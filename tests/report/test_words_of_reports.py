"""Sentences of reports are plain English texts, and can be made anew in another language with their fields."""

import pytest

from stereo_reproject.report.verdict import duration, quality_of_animation, saved_words
from stereo_reproject.words import Words, in_language

GERMAN = {"{time} saved": "{time} gespart", "No time saved: {time} longer": "Keine Zeit gespart: {time} länger"}


def german(message):
    return GERMAN.get(message, message)


def test_words_are_their_english_text():
    words = Words("{count} frames, {time}", count=3, time=Words("{n} s", n=4))
    assert words == "3 frames, 4 s"
    assert f"{words}." == "3 frames, 4 s."


def test_fields_stand_in_the_translation_as_well():
    assert in_language(Words("{time} saved", time="12 s"), german) == "12 s gespart"


def test_words_within_words_are_translated_too():
    outer = Words("Frame {frame}: {outcome}", frame=7, outcome=Words("{time} saved", time="12 s"))
    assert in_language(outer, german) == "Frame 7: 12 s gespart"


def test_what_has_no_translation_stays_english():
    assert in_language(Words("{n} of {m}", n=1, m=2), german) == "1 of 2"
    assert in_language("plain", german) == "plain"


def test_braces_in_fields_are_no_fields():
    assert in_language(Words("{path} is gone", path="a{b}c"), german) == "a{b}c is gone"


@pytest.mark.parametrize(("seconds", "expected"), [(12.0, "12 s gespart"), (-3.0, "Keine Zeit gespart: 3.0 s länger")])
def test_the_saved_time_can_be_translated(seconds, expected):
    assert in_language(saved_words(seconds), german) == expected


def test_the_verdict_can_be_translated():
    estimate = {"noise_ratio": 1.0, "honest_ratio": 1.3, "promise": 1.1, "kept": False, "wrong_tiles": 0.0, "from": ""}
    rows = [{"frame": frame, "estimate": estimate, "fractions": {"rerendered": 0.1}} for frame in (1, 2)]
    found = quality_of_animation(rows)
    assert isinstance(found.words, Words)
    assert found.words.fields["frames"] == "1-2"
    assert isinstance(duration(75.0), str)
