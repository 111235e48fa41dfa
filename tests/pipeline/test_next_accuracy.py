"""The price of the next better setting: predicted from the frame that is finished, and never less than it."""

import numpy as np
import pytest

from stereo_reproject.estimate.tracing import Refinement
from stereo_reproject.pipeline.next_accuracy import WHOLE, FinishedTarget, cost_of
from stereo_reproject.settings.accuracy import SETTINGS, for_size
from stereo_reproject.trace.costs import TraceCosts
from stereo_reproject.trace.fill import FillChoice, SourceCost
from stereo_reproject.trace.planner import FillPlanner

ASSUMED_COSTS = TraceCosts()

SIZE = (40, 60)
COST = SourceCost(20.0, 0.0)
SECONDS = {"source": 20.0, "warp": 1.0, "fill": 2.6, "composite": 0.4, "total": 24.0}
FILL = FillChoice("packed", "asked for", 2.6)
NOTHING = Refinement(np.zeros(SIZE, bool))


def holes(share):
    """Holes in this share of the pixels."""
    result = np.zeros(SIZE, bool)
    result[:, : int(share * SIZE[1])] = True
    return result


def price(name="high", *, share=0.2, fill=FILL, needs_probes=False, whole=False, cost=COST):
    planner = FillPlanner("auto", cost, {})
    return cost_of(name, FinishedTarget(holes(share), planner, fill, NOTHING, needs_probes, whole), SECONDS)


def test_more_pixels_cost_more_at_the_pace_of_this_frame():
    told = price()
    assert told.more_seconds == pytest.approx(FillPlanner("auto", COST, {}).plan(0.2).predicted_seconds - 2.6)
    assert told.seconds == pytest.approx(24.0 + told.more_seconds)
    assert told.traced == pytest.approx(0.2)
    slower = price(fill=FillChoice("packed", "asked for", 1.3))
    assert slower.more_seconds > told.more_seconds + 2.0


def test_nothing_better_is_cheaper():
    assert price(share=0.0).more_seconds == 0.0


def test_probes_have_their_price_where_there_are_any():
    unwatched, watched = price(), price(needs_probes=True)
    assert watched.seconds > unwatched.seconds
    assert watched.traced == pytest.approx(
        unwatched.traced + 1.0 / for_size(SETTINGS["high"], SIZE[0] * SIZE[1]).probe_spacing ** 2
    )
    assert unwatched.complete
    assert not watched.complete, "what the probes would ask for is not known"


def test_beyond_the_best_setting_is_a_full_render():
    told = price(WHOLE)
    assert told.seconds == pytest.approx(21.4 + COST.fixed(ASSUMED_COSTS) + COST.per_frame)
    assert told.traced == 1.0
    assert told.complete


def test_a_frame_that_was_rendered_whole_has_nothing_better():
    told = price(whole=True)
    assert (told.accuracy, told.more_seconds, told.seconds, told.traced) == (WHOLE, None, 24.0, 1.0)


def test_a_full_render_that_costs_nothing_more_is_better_all_the_same():
    told = price(WHOLE, cost=SourceCost(1.0, 0.0))
    assert told.more_seconds == 0.0
