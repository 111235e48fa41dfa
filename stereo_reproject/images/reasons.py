"""Reasons for which a target pixel is traced, as bit flags of which an image is made."""

from __future__ import annotations

from enum import IntFlag

import numpy as np


class Reason(IntFlag):
    """Reasons for which a target pixel is traced, one bit each; a pixel may have several."""

    DISOCCLUDED = 1
    """The target sees a surface that the source does not."""
    OUTSIDE = 2
    """The target sees what lies outside the source's picture."""
    SILHOUETTE = 4
    """An edge of depth, where the pixel filter mixes in another background, or a thing about one pixel wide."""
    TRANSPARENT = 8
    """Contrast behind glass, which is not where its surface is."""
    VIEW_DEPENDENT = 16
    """A pixel of the mask of what looks different from each eye, or a mirror in which another thing was looked up than
    it shows."""
    VOLUME = 32
    """A volume before the sky."""
    DEFOCUS = 64
    """An edge that is out of focus."""
    DETAIL = 128
    """Detail so fine that a lookup between pixels blurs it, or that a denoiser leaves otherwise in each eye."""
    REFINED = 256
    """A tile that the probes found to be worse than was promised."""
    PROBE = 512
    """A pixel that is traced to measure how wrong the warped picture is."""
    INVALID = 1024
    """A pixel whose lookup would take part of a NaN or an infinity in the source."""
    MOVED = 2048
    """A thing that has moved since the source was rendered, or a surface right beside one."""

    @property
    def bit(self) -> np.uint16:
        """The flag as a number of the type that an image (H, W) of reasons has."""
        return np.uint16(self.value)

    @property
    def label(self) -> str:
        """Name of the reason in reports, as "view-dependent"."""
        return str(self.name).lower().replace("_", "-")

    @property
    def words(self) -> str:
        """Name of the reason for artists, in legends and panels, as "Reflections"."""
        return WORDS[self]


WORDS = {
    Reason.DISOCCLUDED: "Hidden from the first eye",
    Reason.OUTSIDE: "Beyond the frame",
    Reason.SILHOUETTE: "Edges",
    Reason.TRANSPARENT: "Behind glass",
    Reason.VIEW_DEPENDENT: "Reflections",
    Reason.VOLUME: "Volumes",
    Reason.DEFOCUS: "Blurred edges",
    Reason.DETAIL: "Fine detail",
    Reason.REFINED: "Uncertain areas",
    Reason.PROBE: "Spot checks",
    Reason.INVALID: "Broken pixels",
    Reason.MOVED: "Moving things",
}
"""Names of the reasons for artists."""
