"""The figures of a frame's record, looked at before a report, a chart or a console rests on them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from ..settings.frame import ACCURACIES, CUSTOM
from .frame_record import Record

MAX_FIGURE = 1e12
"""No figure of ours is as large: some of them are added up, and drawn."""

MAX_DEPTH = 8
"""Levels of lists and dicts in each other; ours have three."""


def figures_of(record: Record) -> tuple[dict[str, Any], list[str]]:
    """Return the figures of a record that have the expected form, and the names of those that have not. A record may
    come from a damaged file."""
    usable = {name: value for name, value in record.figures.items() if _RULES.get(name, _is_plain)(value)}
    return usable, [name for name in record.figures if name not in usable]


def _is_plain(value: Any, deepest: int = MAX_DEPTH) -> bool:
    """Return True if a value consists of None, texts, True and False, usable numbers, and lists and dicts of these,
    nested no deeper than `deepest`."""
    if value is None or isinstance(value, (bool, str)):
        return True
    if isinstance(value, (int, float)):
        return _is_number(value)
    parts = value.values() if isinstance(value, dict) else value
    return deepest > 0 and all(_is_plain(part, deepest - 1) for part in parts)


def _is_number(value: Any) -> bool:
    """Return True for a number between -MAX_FIGURE and MAX_FIGURE; NaN, True and False are none."""
    # No NaN is less than anything.
    return isinstance(value, (int, float)) and not isinstance(value, bool) and -MAX_FIGURE < value < MAX_FIGURE


def _is_number_or_none(value: Any) -> bool:
    """Return True for None or a usable number, see `_is_number`."""
    return value is None or _is_number(value)


def _is_amount(value: Any) -> bool:
    """Return True for a usable number that is not negative."""
    return _is_number(value) and value >= 0


def _is_time_taken(value: Any) -> bool:
    """Return True for a usable number above 0."""
    return _is_number(value) and value > 0


def _is_whole(value: Any) -> bool:
    """Return True for a whole number that is not negative."""
    return isinstance(value, int) and _is_amount(value)


def _is_size(value: Any) -> bool:
    """Return True for a list of a width and a height, both whole numbers above 0."""
    return isinstance(value, list) and len(value) == 2 and all(_is_whole(side) and side > 0 for side in value)


def _are_texts(value: Any) -> bool:
    """Return True for a list of texts."""
    return isinstance(value, list) and all(isinstance(line, str) for line in value)


def _are_seconds(value: Any) -> bool:
    """Return True for a dict whose values are numbers that are not negative."""
    return isinstance(value, dict) and all(map(_is_amount, value.values()))


def _are_fractions(value: Any) -> bool:
    """Return True for a dict of shares, "rerendered" among them; a little more than 1 is accepted."""
    return _are_seconds(value) and "rerendered" in value and all(part < 1.01 for part in value.values())


def _is_comparison(value: Any) -> bool:
    """Return True for the result of a comparison with multiview as a record has it, and for None: a frame that was not
    compared."""
    if value is None:
        return True
    known = isinstance(value, dict) and _is_plain(value) and value.keys() >= {"multiview_seconds", "noise_ratio"}
    return known and _is_amount(value["multiview_seconds"]) and _is_number_or_none(value["noise_ratio"])


def _is_group(value: Any) -> bool:
    """Return True for None or a dict of plain values, see `_is_plain`."""
    return value is None or (isinstance(value, dict) and _is_plain(value))


def _is_list(value: Any) -> bool:
    """Return True for a list of plain values, see `_is_plain`."""
    return isinstance(value, list) and _is_plain(value)


_RULES: dict[str, Callable[[Any], bool]] = {
    "wall_seconds": _is_time_taken,
    "beside_seconds": _is_number,
    "multiview_seconds": _is_amount,
    "write_seconds": _is_amount,
    "fractions": _are_fractions,
    "seconds": _are_seconds,
    "size": _is_size,
    "samples": _is_whole,
    "views": _is_whole,
    "rendered_views": _is_whole,
    "honest_ratio": _is_number_or_none,
    "accuracy": lambda value: value in (*ACCURACIES, CUSTOM),
    "compare": _is_comparison,
    "warnings": _are_texts,
    **dict.fromkeys(("fill", "warp", "estimate", "correction", "memory", "reuse"), _is_group),
    "layers": _is_list,
}
"""Test that a figure must pass; figures without one are accepted where they are plain."""
