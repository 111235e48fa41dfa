"""Warnings of values that a file cannot hold or that no picture should have, given before the file is delivered."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .passes import COLOUR_PASS, Passes, pass_letters

MAX_HALF_FLOAT = 65504.0
"""Greatest finite value of a 16-bit half float."""


def range_warnings(passes: Passes, *, view: str, half: bool) -> list[str]:
    """Return a line of warning for each pass of one eye that has NaN, negative light, or values that half floats cannot
    hold.

    view names the eye in these lines. half is set where the passes go into a file of half floats; in a multilayer file
    Blender stores only the colours so. Empty where there is nothing to warn of.
    """
    warnings = []
    negative = _count(passes[COLOUR_PASS] < 0.0)
    if negative:
        warnings.append(f"{negative} pixels of the {view} eye are negative in {COLOUR_PASS}")
    for name, image in passes.items():
        unknown = _count(np.isnan(image))
        if unknown:
            warnings.append(f"{unknown} pixels of the {view} eye's {name} pass are no numbers")
        if not half or not pass_letters(name, image.shape[2]).startswith("RGB"):
            continue
        beyond = _count(np.abs(np.nan_to_num(image, posinf=np.inf, neginf=-np.inf)) > MAX_HALF_FLOAT)
        if beyond:
            where = f"{beyond} pixels of the {view} eye's {name} pass"
            warnings.append(f"{where} are beyond what half floats hold: set the output's color depth to Float (Full)")
    return warnings


def _count(where: NDArray[np.bool_]) -> int:
    """Return the number of pixels for which `where` (H, W, C) is set in any channel."""
    # Mostly there is none, which NumPy tells a hundred times as fast.
    return int(where.any(axis=-1).sum()) if where.any() else 0
