"""Findings that the frames of an animation share, so that all of them are made in one way."""

from __future__ import annotations

from collections.abc import Callable

from ..trace.costs import TraceCosts
from ..trace.fill import SourceCost
from .view_plan import ViewCosts


class SharedFindings:
    """Findings by which a frame is rendered; those of an animation's first frame hold for all its frames.

    This class is for a frame on its own: each method returns what this frame has found. An animation has a subclass
    that returns the findings of its first frame instead.
    """

    def cost(self, found: SourceCost) -> SourceCost:
        """Return the cost of the source render by which the fill method is to be chosen; `found` is that of this
        frame."""
        return found

    def view_costs(self, found: ViewCosts) -> ViewCosts:
        """Return the costs by which it is decided which of many views are rendered whole; `found` are those of this
        frame."""
        return found

    def trace_costs(
        self,
        known: TraceCosts,
        measure: Callable[[], TraceCosts],  # noqa: ARG002
        *,
        packed_by: str,  # noqa: ARG002
    ) -> TraceCosts:
        """Return the costs of tracing by which fill methods are to be chosen: for a frame on its own `known`, those
        that this user has measured, or that are assumed.

        For animations `measure` measures them on this frame where nothing was measured yet. packed_by is the name of
        the packed camera, which has costs of its own.
        """
        return known

    def gpu_is_faster(self, find: Callable[[], bool]) -> bool:  # noqa: ARG002 - for animations
        """Return whether the GPU warps faster than NumPy: False for a frame on its own, which is not measured.

        To warp it with both would cost more than the faster one saves. For animations `find` measures it on this frame.
        """
        return False
