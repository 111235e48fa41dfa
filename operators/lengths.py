"""Lengths as Blender's own settings show them, in the unit that the scene asks for."""

from __future__ import annotations

import math

import bpy

SYMBOLS = {
    "KILOMETERS": "km",
    "METERS": "m",
    "CENTIMETERS": "cm",
    "MILLIMETERS": "mm",
    "MICROMETERS": "um",
    "MILES": "mi",
    "FEET": "ft",
    "INCHES": "in",
    "THOU": "thou",
}
"""Units of length that a scene may ask for, by Blender's names; all others leave the choice to Blender."""

DIGITS = 3
"""Digits of a length that are shown, at least those before the decimal point."""


def length_words(scene: bpy.types.Scene, length: float) -> str:
    """Return a length in scene units as a text, such as "0.0628 m"."""
    units = scene.unit_settings
    if units.system == "NONE":
        return _rounded(length)
    length *= units.scale_length
    symbol = SYMBOLS.get(units.length_unit)
    if symbol is None:
        return bpy.utils.units.to_string(units.system, "LENGTH", length, precision=DIGITS)
    return f"{_rounded(length / bpy.utils.units.to_value(units.system, 'LENGTH', f'1{symbol}'))} {symbol}"


def _rounded(value: float) -> str:
    """Return a number with its first digits, without zeros at the end."""
    before = math.floor(math.log10(abs(value))) + 1 if value else 1
    return f"{value:.{max(DIGITS - before, 0)}f}".rstrip("0").rstrip(".") if before < DIGITS else f"{value:.0f}"
