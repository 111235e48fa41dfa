"""Checks of single values of settings: each raises BadInputError, whose message is one line."""

from __future__ import annotations

import math

from ..errors import BadInputError
from ..words import Words


def check_choice(name: str, value: str, choices: tuple[str, ...]) -> None:
    """Raise BadInputError unless `value` is one of the choices; `name` is what the message calls it."""
    if value not in choices:
        raise BadInputError(
            Words(
                "{name} must be one of {choices}, not {value}",
                name=Words(name),
                choices=", ".join(choices),
                value=repr(value),
            )
        )


def check_int(name: str, value: int | None, low: int, high: int) -> None:
    """Raise BadInputError unless `value` is None or a whole number from `low` to `high`; `name` is what the message
    calls it."""
    if value is None:
        return
    if isinstance(value, bool) or not isinstance(value, int):
        raise BadInputError(Words("{name} must be a whole number, not {value}", name=Words(name), value=repr(value)))
    if not low <= value <= high:
        raise BadInputError(
            Words("{name} must be from {low} to {high}, not {value}", name=Words(name), low=low, high=high, value=value)
        )


def _is_finite(value: float) -> bool:
    """Return True if a number is finite as a float; a whole number too large for a float is not."""
    try:
        return math.isfinite(value)
    except OverflowError:
        return False


def check_float(name: str, value: float, low: float, *, above: bool = False) -> None:
    """Raise BadInputError unless `value` is a finite number of at least `low`, or with `above` greater than it; `name`
    is what the message calls it."""
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not _is_finite(value):
        raise BadInputError(Words("{name} must be a finite number, not {value}", name=Words(name), value=repr(value)))
    if value < low or (above and value == low):
        message = "{name} must be above {low}, not {value}" if above else "{name} must be at least {low}, not {value}"
        raise BadInputError(Words(message, name=Words(name), low=f"{low:g}", value=f"{value:g}"))
