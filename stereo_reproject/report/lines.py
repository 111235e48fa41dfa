"""Text broken into lines by the widths that its letters have."""

from __future__ import annotations

import re
from collections.abc import Callable

BETWEEN_WORDS = re.compile(r"\s+(?!(?<=\d\s)(?:%|(?:s|min|h|px|m|cm|mm)\b))")
"""Space between two words, but not between a number and its unit."""


def wrapped(text: str, width: float, measure: Callable[[str], float]) -> list[str]:
    """Return a text in lines that are no wider than `width`, by `measure`, which returns the width of a text in the
    same unit. Lines end between words, but not between a number and its unit; within a word only where it is wider than
    a whole line, as paths may be. A line has one letter at least.
    """
    lines: list[str] = []
    line = ""
    for word in filter(None, BETWEEN_WORDS.split(text)):
        longer = f"{line} {word}" if line else word
        if measure(longer) <= width:
            line = longer
            continue
        if line:
            lines.append(line)
        *full, line = _pieces(word, width, measure)
        lines += full
    return [*lines, line] if line else lines


def _pieces(word: str, width: float, measure: Callable[[str], float]) -> list[str]:
    """Return a word in pieces, each as long as fits into `width`, and of one letter at least."""
    pieces = [word[:1]]
    for letter in word[1:]:
        if measure(pieces[-1] + letter) <= width:
            pieces[-1] += letter
        else:
            pieces.append(letter)
    return pieces
