"""The costs of tracing measured before anything is chosen by them: for the first frame of an animation, which decides
how all frames are traced."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ..trace.costs import ASSUMED, TraceCosts
from ..trace.planner import FillPlanner
from ..trace.requests import TraceRequest
from .tuning import TUNING


class CostMeasurer(Protocol):
    """A tracer that can trace pixels to measure what that costs."""

    def measured_costs(self, planner: FillPlanner, request: TraceRequest) -> TraceCosts:
        """Return the costs of tracing as they are known once the pixels of this request were traced packed.

        planner has the costs that were known before, and the cost of the source. The pixels are thrown away, and no
        later noise depends on them.
        """
        ...


def worth_measuring(planner: FillPlanner, holes: NDArray[np.bool_]) -> bool:
    """Return whether the costs of tracing can be measured by a view's holes (H, W), and something depends on them.

    It is False where they are not just assumed, where there is nothing to choose or to trace, and where pixels cannot
    be packed.
    """
    assumed = planner.costs.source == ASSUMED and planner.asked == "auto"
    return assumed and not planner.blockers.get("packed") and bool(holes.any())


def calibrated_costs(
    measurer: CostMeasurer, planner: FillPlanner, view: str, holes: NDArray[np.bool_], seed: int
) -> TraceCosts:
    """Return the costs of tracing after a measurement by some of a view's holes (H, W), drawn by chance with this seed.

    As many holes are traced as take `PipelineTuning.calibration_seconds` by what was known before. It must be
    `worth_measuring`.
    """
    rows, columns = np.nonzero(holes)
    seconds_per_pixel = planner.costs.packed_pixel_cost * planner.cost.per_frame / holes.size
    most = TUNING.calibration_seconds / seconds_per_pixel if seconds_per_pixel > 0.0 else np.inf
    count = int(min(rows.size, max(most, 1.0)))
    chosen = np.random.default_rng(seed).choice(rows.size, count, replace=False)
    pixels = np.zeros_like(holes)
    pixels[rows[chosen], columns[chosen]] = True
    return measurer.measured_costs(planner, TraceRequest(view, pixels))
