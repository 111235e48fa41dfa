"""Findings that the frames of an animation share, so that all of them are made in one way."""

from __future__ import annotations

from collections.abc import Callable

from ..trace.fill import SourceCost


class SharedFindings:
    """Findings of a frame on its own, which shares none: each method returns what this frame has found.

    An animation has a subclass that returns the findings of its first frame instead.
    """

    def cost(self, found: SourceCost) -> SourceCost:
        """Return the cost of the source render by which the fill method is chosen; `found` is this frame's."""
        return found

    def noise_left(self, find: Callable[[], float]) -> float:
        """Return the share of a pixel's variance that denoising leaves; `find` measures it on this frame
        (`denoising.noise_left`)."""
        return find()

    def gpu_is_faster(self, find: Callable[[], bool]) -> bool:  # noqa: ARG002 - for animations
        """Return whether the GPU warps faster than NumPy; `find` measures it on this frame.

        A frame on its own is not measured, and is warped by NumPy: to warp it with both would cost more than the faster
        one saves.
        """
        return False
