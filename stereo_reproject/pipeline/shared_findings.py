"""What one frame of an animation has found, and others then go by."""

from __future__ import annotations

from collections.abc import Callable

from ..trace.fill import SourceCost


class SharedFindings:
    """Of a frame on its own: there was none before, and it goes by what it finds itself."""

    def cost(self, found: SourceCost) -> SourceCost:
        """What the source render has cost, for the fill methods to be chosen by."""
        return found

    def noise_left(self, find: Callable[[], float]) -> float:
        """What `denoising.noise_left` finds, or has found."""
        return find()

    def gpu_is_faster(self, find: Callable[[], bool]) -> bool:  # noqa: ARG002 - for those that there are more frames of
        """Whether warping on the GPU is found, or was, to be faster than in numpy. Not for a frame on its own: to warp
        it on both would cost more than the faster one saves."""
        return False
