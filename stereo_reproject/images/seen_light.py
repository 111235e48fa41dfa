"""Light as it is seen: multiplied by a power of two, so that a picture's middle stands where one would expose it.

Whether an error is seen depends on how bright the picture is shown, not on how bright its scene is. Within the
pipeline, light is therefore multiplied by `display_scale` of the source picture, so that a threshold after
`metrics.tone` means the same in a cellar and in the sun. The scene's own exposure has no part in it: who lights a scene
darker and exposes it longer gets the same picture, and the same scale times the same light. Powers of two are exact in
floating point. So a scene 2^k times as bright is treated alike to the bit, and light multiplied and divided is what it
was.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .metrics import COLOUR_CHANNELS
from .passes import NOISY_PASS, VIEW_DEPENDENT_PASS, Passes, is_light
from .tuning import TUNING

MIDDLE_GREY = 0.18
"""Scene-linear grey at which the logarithmic mean of a picture is shown: the reflectance of a photographer's
grey card, and the usual key of tone mapping (Reinhard et al., 2002)."""

LUMINANCE_WEIGHTS = (0.2126, 0.7152, 0.0722)
"""Weights of red, green and blue in luminance, of Rec. 709 primaries."""

FLOAT_MAX_EXPONENT = 128
"""Exponent of the power of two that is just beyond the largest float32."""

MAX_SCALE_EXPONENT = 64
"""Exponent of the largest scale, and of the smallest with the sign changed: the inverse is then a float32 too."""


def display_scale(colour: NDArray[np.float32]) -> float:
    """Return the power of two that brings the logarithmic mean of a picture's luminance nearest to `MIDDLE_GREY`.

    colour (H, W, >= 3) is scene-linear and finite. Pixels without light do not count, and a luminance counts as within
    `max_stops_from_median` stops of the median. Large pictures are read on a grid. The scale is 1 for a picture without
    light, and never so large that a value of the picture would overflow. A colour that is 2^k times as bright gives
    exactly 2^-k times the scale.
    """
    step = max(int((colour[..., 0].size / TUNING.brightness_pixels) ** 0.5), 1)
    some, (red, green, blue) = colour[::step, ::step], LUMINANCE_WEIGHTS
    luminance = red * some[..., 0] + green * some[..., 1] + blue * some[..., 2]
    lit = luminance[luminance > 0.0]
    if not lit.size:
        return 1.0
    # Exponents are whole numbers, and so the sums for a brighter picture differ by a whole number alone.
    mantissa, exponent = np.frexp(lit)
    middle = int(np.partition(exponent, lit.size // 2)[lit.size // 2])
    stops = TUNING.max_stops_from_median
    whole, rest = divmod(int(np.clip(exponent - middle, -stops, stops).sum()), lit.size)
    mean = (rest + float(np.log2(mantissa.astype(np.float64)).sum())) / lit.size
    wanted = round(float(np.log2(MIDDLE_GREY)) - mean) - whole - middle
    light = colour[..., :COLOUR_CHANNELS]
    largest = int(np.frexp(max(light.max(), -light.min()))[1])
    wanted = min(wanted, MAX_SCALE_EXPONENT, FLOAT_MAX_EXPONENT - largest)
    return 2.0 ** max(wanted, -MAX_SCALE_EXPONENT)


def scaled_colour(colour: NDArray[np.float32], scale: float) -> NDArray[np.float32]:
    """Return a colour (..., C >= 3) with its light multiplied by `scale`; alpha stays as it is.

    For a scale of 1 the colour itself is returned, and no copy.
    """
    if scale == 1.0:
        return colour
    result = colour.copy()
    with np.errstate(over="ignore"):
        result[..., :COLOUR_CHANNELS] *= np.float32(scale)
    return result


def scaled_light(passes: Passes, scale: float) -> Passes:
    """Return the passes (..., C) with all light multiplied by `scale`: the passes of `is_light`, and those of the light
    as it was traced in a denoised picture.

    Other passes, and all of them for a scale of 1, are those that were given.
    """
    return {
        name: scaled_colour(image, scale) if is_light(name) or name in (NOISY_PASS, VIEW_DEPENDENT_PASS) else image
        for name, image in passes.items()
    }
