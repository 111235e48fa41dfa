"""Lines of text are as wide as asked for, and lose nothing."""

import itertools

import pytest
from hypothesis import given
from hypothesis import strategies as st

from stereo_reproject.report.lines import wrapped

WORDS = st.lists(st.text("abcil./WM", min_size=1, max_size=40), max_size=20)


def measure(text):
    """Letters of a made-up font: narrow ones, wide ones, and all others."""
    return sum({"i": 2.5, "l": 2.5, ".": 3.0, "W": 11.0, "M": 10.0}.get(letter, 6.0) for letter in text)


@given(WORDS, st.floats(12.0, 500.0))
def test_no_line_is_too_wide_and_no_letter_is_lost(words, width):
    lines = wrapped(" ".join(words), width, measure)
    assert all(measure(line) <= width for line in lines)
    assert "".join("".join(lines).split()) == "".join(words)


@given(WORDS)
def test_words_stay_whole_where_they_fit(words):
    widest = max(map(measure, words), default=0.0)
    lines = wrapped(" ".join(words), widest, measure)
    assert [word for line in lines for word in line.split()] == words


@given(WORDS, st.floats(0.0, 500.0))
def test_a_line_takes_what_fits(words, more):
    """Else one word on each line would do. A word that is broken begins on a line of its own."""
    width = max(map(measure, words), default=0.0) + more
    lines = wrapped(" ".join(words), width, measure)
    for line, following in itertools.pairwise(lines):
        first = following.split()[0]
        assert measure(f"{line} {first}") > width


@pytest.mark.parametrize("width", [0.0, -5.0])
def test_without_room_a_line_has_one_letter(width):
    assert wrapped("ab c", width, measure) == ["a", "b", "c"]


def test_nothing_is_no_line():
    assert wrapped("  ", 100.0, measure) == []


def test_a_number_stays_with_its_unit():
    width = measure("about 44 %")
    lines = wrapped("in all about 44 % less, and 10 s in vain", width, measure)
    assert lines == ["in all", "about 44 %", "less, and", "10 s in", "vain"]
