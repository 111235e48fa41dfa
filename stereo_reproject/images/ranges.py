"""What a file cannot hold, or a picture should not: said before the file is delivered."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .passes import COLOUR_PASS, Passes, pass_letters

HALF_MAX = 65504.0
"""The greatest finite half float."""


def range_warnings(passes: Passes, *, view: str, half: bool) -> list[str]:
    """A line each for values of one eye that are no numbers, negative light, or more than half floats can hold.

    half: whether a file of half floats is to be made of the passes. Of a multilayer file Blender makes the colours half
    floats and nothing else.
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
        beyond = _count(np.abs(np.nan_to_num(image, posinf=np.inf, neginf=-np.inf)) > HALF_MAX)
        if beyond:
            where = f"{beyond} pixels of the {view} eye's {name} pass"
            warnings.append(f"{where} are beyond what half floats hold: set the output's color depth to Float (Full)")
    return warnings


def _count(where: NDArray[np.bool_]) -> int:
    return int(where.any(axis=-1).sum())
