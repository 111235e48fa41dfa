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
    """The figures that are as they should be, and the names of those that are not."""
    usable = {name: value for name, value in record.figures.items() if _RULES.get(name, _is_plain)(value)}
    return usable, [name for name in record.figures if name not in usable]


def _is_plain(value: Any, deepest: int = MAX_DEPTH) -> bool:
    """Return whether a value is JSON with finite numbers of a usual size, and not nested too deeply."""
    if value is None or isinstance(value, (bool, str)):
        return True
    if isinstance(value, (int, float)):
        return _is_number(value)
    parts = value.values() if isinstance(value, dict) else value
    return deepest > 0 and all(_is_plain(part, deepest - 1) for part in parts)


def _is_number(value: Any) -> bool:
    # No NaN is less than anything.
    return isinstance(value, (int, float)) and not isinstance(value, bool) and -MAX_FIGURE < value < MAX_FIGURE


def _is_number_or_none(value: Any) -> bool:
    return value is None or _is_number(value)


def _is_amount(value: Any) -> bool:
    return _is_number(value) and value >= 0


def _is_time_taken(value: Any) -> bool:
    return _is_number(value) and value > 0


def _is_whole(value: Any) -> bool:
    return isinstance(value, int) and _is_amount(value)


def _is_size(value: Any) -> bool:
    return isinstance(value, list) and len(value) == 2 and all(_is_whole(side) and side > 0 for side in value)


def _are_texts(value: Any) -> bool:
    return isinstance(value, list) and all(isinstance(line, str) for line in value)


def _are_seconds(value: Any) -> bool:
    return isinstance(value, dict) and all(map(_is_amount, value.values()))


def _are_fractions(value: Any) -> bool:
    return _are_seconds(value) and "rerendered" in value and all(part < 1.01 for part in value.values())


def _is_comparison(value: Any) -> bool:
    """Return whether it is the result of a comparison with multiview, or None for a frame that was not compared."""
    if value is None:
        return True
    known = isinstance(value, dict) and _is_plain(value) and value.keys() >= {"multiview_seconds", "noise_ratio"}
    return known and _is_amount(value["multiview_seconds"]) and _is_number_or_none(value["noise_ratio"])


def _is_group(value: Any) -> bool:
    return value is None or (isinstance(value, dict) and _is_plain(value))


def _is_list(value: Any) -> bool:
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
    "accuracy": lambda value: value in (*ACCURACIES, CUSTOM),
    "compare": _is_comparison,
    "warnings": _are_texts,
    **dict.fromkeys(("fill", "warp", "estimate", "correction", "memory"), _is_group),
    "layers": _is_list,
}
"""Test that a figure must pass; figures without one are accepted where they are plain."""
