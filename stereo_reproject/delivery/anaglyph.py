"""Red-cyan anaglyph by least squares: of all anaglyphs the one that looks most like the pair through the glasses.

Eric Dubois, "A projection method to generate anaglyph stereo images", ICASSP 2001; the matrices are those that he
published for red-cyan glasses and an LCD (they are also in FFmpeg's stereo3d filter, `arcd`, to 16 bits). They hold in
linear light; FFmpeg applies them to encoded values.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

LEFT = np.array([[0.456, 0.500, 0.176], [-0.040, -0.038, -0.016], [-0.015, -0.021, -0.005]], np.float32)
RIGHT = np.array([[-0.043, -0.088, -0.002], [0.378, 0.734, -0.018], [-0.072, -0.113, 1.226]], np.float32)
"""Linear RGB of the anaglyph from linear RGB of an eye."""


def dubois(left: NDArray[np.float32], right: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the anaglyph of two sRGB-encoded pictures (H, W, 3) or (H, W, 4) with values in 0..1, in the same shape
    and encoding, clipped to 0..1.

    Alpha, if there is any, is the greater of the two pictures'. Raises ValueError if they differ in shape.
    """
    if left.shape != right.shape:
        raise ValueError(f"the eyes differ in shape: {left.shape} and {right.shape}")
    light = light_of_srgb(left[..., :3]) @ LEFT.T + light_of_srgb(right[..., :3]) @ RIGHT.T
    result = np.empty(left.shape, np.float32)
    result[..., :3] = _encoded(np.clip(light, 0, 1))
    result[..., 3:] = np.maximum(left[..., 3:], right[..., 3:])
    return result


def light_of_srgb(colour: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the linear light of an sRGB-encoded picture (IEC 61966-2-1); values are clipped to 0..1 first."""
    colour = np.clip(colour, 0, 1).astype(np.float32, copy=False)
    return np.where(colour <= 0.04045, colour / 12.92, ((colour + 0.055) / 1.055) ** 2.4).astype(np.float32)


def _encoded(light: NDArray[np.floating]) -> NDArray[np.float32]:
    """Return the sRGB encoding of linear light in 0..1 (IEC 61966-2-1)."""
    return np.where(light <= 0.0031308, light * 12.92, 1.055 * light ** (1 / 2.4) - 0.055).astype(np.float32)
