"""Why a target pixel is traced: flags, of which a mask of pixels is made."""

from __future__ import annotations

from enum import IntFlag

import numpy as np


class Reason(IntFlag):
    """Why a target pixel is traced; a pixel may have several reasons."""

    DISOCCLUDED = 1
    OUTSIDE = 2
    SILHOUETTE = 4
    TRANSPARENT = 8
    VIEW_DEPENDENT = 16
    VOLUME = 32
    DEFOCUS = 64
    MOTION = 128
    REFINED = 256
    PROBE = 512
    INVALID = 1024

    @property
    def bit(self) -> np.uint16:
        """The flag as what a mask is made of."""
        return np.uint16(self.value)

    @property
    def label(self) -> str:
        """The name that reports and legends use."""
        return str(self.name).lower().replace("_", "-")
