"""What a render consists of: passes by name."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Passes = dict[str, NDArray[np.float32]]
"""Passes by Blender's names, each (H, W, C), or (N, C) for traced pixels."""

COLOUR_PASS = "Combined"
DEPTH_PASS = "Depth"

MASKED_PASS = "Masked"
"""(H, W, 1) of a source: 1 where its pixels must not be warped, 0 elsewhere. Few sources have it."""

EFFECTS_PASS = "Effects"
"""(H, W, 1) `effects.Effect` flags of what each pixel shows. Ours alone: it is dropped before anything is written."""

MATERIAL_PASS = "Shown Material"
"""(H, W, 1) number of the materials that each pixel shows. Ours alone, as the flags are."""

NOISY_PASS = "Noisy"
"""(H, W, 4) colour as it was traced, where the picture is denoised. Ours alone, as are what the denoiser looks at:"""

ALBEDO_PASS = "Guiding Albedo"
NORMAL_PASS = "Guiding Normal"

OURS = (EFFECTS_PASS, MATERIAL_PASS, MASKED_PASS, NOISY_PASS, ALBEDO_PASS, NORMAL_PASS)


def without_ours(passes: Passes) -> Passes:
    """What of the passes is the user's."""
    return {name: image for name, image in passes.items() if name not in OURS}
