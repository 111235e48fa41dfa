"""What is traced to know what tracing costs, before the first frame of an animation is chosen by it."""

from dataclasses import dataclass, field, replace

import numpy as np
import pytest

from stereo_reproject.pipeline.calibration import calibrated_costs, worth_measuring
from stereo_reproject.pipeline.tuning import TUNING
from stereo_reproject.trace.costs import AGREED, MEASURED, TraceCosts
from stereo_reproject.trace.fill import SourceCost
from stereo_reproject.trace.planner import FillPlanner

ASSUMED_COSTS = TraceCosts()

SHAPE = (90, 160)
FREE = {"packed": None, "card": None}
FOUND = TraceCosts(1.5, 0.25, 0.5, 0.125, MEASURED)


@dataclass
class Measurer:
    asked: list = field(default_factory=list)

    def measured_costs(self, planner, request):
        self.asked.append((planner, request))
        return FOUND


def holes(share=0.2):
    return np.random.default_rng(0).random(SHAPE) < share


def calibrated(planner, some=None, seed=0):
    measurer = Measurer()
    costs = calibrated_costs(measurer, planner, "right", holes() if some is None else some, seed)
    return costs, measurer.asked


def test_holes_are_traced_as_many_as_take_a_moment():
    quick, slow = (FillPlanner("auto", SourceCost(seconds, 0.0), FREE) for seconds in (5.0, 200.0))
    costs, [(_, request)] = calibrated(quick)
    assert costs == FOUND
    assert request.view == "right"
    assert request.twice is None
    np.testing.assert_array_equal(request.pixels, holes())

    costs, [(planner, request)] = calibrated(slow)
    assert planner is slow
    assert not (request.pixels & ~holes()).any()
    seconds = ASSUMED_COSTS.packed_pixel_cost * slow.cost.per_frame * request.pixels.mean()
    assert seconds == pytest.approx(TUNING.calibration_seconds, rel=0.02)
    # From all over the picture, and the same in each run.
    assert np.flatnonzero(request.pixels)[-1] - np.flatnonzero(request.pixels)[0] > 0.8 * request.pixels.size
    np.testing.assert_array_equal(calibrated(slow)[1][0][1].pixels, request.pixels)
    assert (calibrated(slow, seed=1)[1][0][1].pixels != request.pixels).any()


@pytest.mark.parametrize("seconds", [0.0, 1e12])
def test_a_source_of_any_cost_is_measured(seconds):
    _, [(_, request)] = calibrated(FillPlanner("auto", SourceCost(seconds, 0.0), FREE))
    assert request.pixels.any()


@pytest.mark.parametrize(
    "change",
    [
        {"asked": "packed"},
        {"asked": "full"},
        {"blockers": {**FREE, "packed": "no OSL"}},
        {"costs": FOUND},
        {"costs": replace(FOUND, source=AGREED)},
    ],
)
def test_it_is_known_where_measuring_is_of_no_use(change):
    planner = FillPlanner("auto", SourceCost(20.0, 1.0), FREE)
    assert worth_measuring(planner, holes())
    assert not worth_measuring(replace(planner, **change), holes())


def test_nothing_is_measured_without_a_hole():
    planner = FillPlanner("auto", SourceCost(20.0, 1.0), FREE)
    assert not worth_measuring(planner, np.zeros(SHAPE, bool))
