"""What the trace renders of a frame tell of the costs by which the next one's fill method is chosen."""

from dataclasses import replace

import numpy as np
import pytest

from stereo_reproject.trace.costs import ASSUMED, MEASURED, TraceCosts, cost_limits, costs_of
from stereo_reproject.trace.fill import SourceCost, choose_fill
from stereo_reproject.trace.measuring import TraceRender, learned_costs, open_share
from stereo_reproject.trace.tuning import TUNING

ASSUMED_COSTS = TraceCosts()

FREE = {"packed": None, "card": None}
SOURCE = SourceCost(seconds=21.0, sync_seconds=1.0)

MACHINES = {
    "a few cores": (TraceCosts(1.3, 0.2, 0.4, 0.5), SourceCost(80.0, 4.0)),
    "a quick device": (TraceCosts(0.8, 0.05, 0.06, 0.1), SourceCost(5.5, 0.8)),
    "one that is slow to start": (TraceCosts(0.9, 0.3, 2.0, 0.9), SourceCost(20.0, 5.0)),
}


def render_on(machine, source, method, share):
    """As it would take on a machine of these costs."""
    per_pixel = machine.packed_pixel_cost * share + (machine.card_pixel_cost if method == "card" else 0.0)
    sync = machine.resync_share * source.sync_seconds
    seconds = machine.render_call_seconds + sync + per_pixel * source.per_frame
    return TraceRender(method, seconds, sync, share)


@pytest.mark.parametrize(("machine", "source"), MACHINES.values(), ids=MACHINES)
def test_a_few_frames_settle_on_what_the_machine_takes(machine, source):
    known = ASSUMED_COSTS
    for _ in range(12):
        known = learned_costs(known, source, [render_on(machine, source, "packed", share) for share in (0.06, 0.2)])
    for share in (0.05, 0.1, 0.3):
        predicted, true, at_first = (
            choose_fill("packed", share, source, FREE, costs=costs).predicted_seconds
            for costs in (known, machine, ASSUMED_COSTS)
        )
        assert predicted == pytest.approx(true, rel=0.15)
        assert abs(predicted - true) < 0.5 * abs(at_first - true)
    assert known.source == MEASURED
    assert known.resync_share == pytest.approx(machine.resync_share, rel=0.01)
    assert known.card_pixel_cost == ASSUMED_COSTS.card_pixel_cost


@pytest.mark.parametrize(("machine", "source"), MACHINES.values(), ids=MACHINES)
def test_a_card_is_settled_on_too(machine, source):
    known = ASSUMED_COSTS
    for _ in range(40):
        known = learned_costs(known, source, [render_on(machine, source, "card", share) for share in (0.02, 0.2)])
    predicted, true = (
        choose_fill("card", 0.1, source, FREE, costs=costs).predicted_seconds for costs in (known, machine)
    )
    assert predicted == pytest.approx(true, rel=0.15)


def test_a_frame_moves_the_costs_half_of_the_way():
    """A render so long that the call is nothing, of twice the cost."""
    source = SourceCost(10000.0, 0.0)
    machine = replace(ASSUMED_COSTS, packed_pixel_cost=2.0 * ASSUMED_COSTS.packed_pixel_cost)
    learned = learned_costs(ASSUMED_COSTS, source, [render_on(machine, source, "packed", 0.1)])
    assert learned.packed_pixel_cost == pytest.approx(1.5 * ASSUMED_COSTS.packed_pixel_cost, rel=1e-3)
    again = learned_costs(learned, source, [render_on(machine, source, "packed", 0.1)])
    assert again.packed_pixel_cost == pytest.approx(1.75 * ASSUMED_COSTS.packed_pixel_cost, rel=1e-3)


@pytest.mark.parametrize(("seconds", "share"), [(3.0, 1e-5), (0.01, 1e-5), (2.0, 1e-3)])
def test_a_render_of_few_pixels_tells_of_the_call_alone(seconds, share):
    learned = learned_costs(ASSUMED_COSTS, SOURCE, [TraceRender("packed", seconds, 0.25, share)])
    assert learned.packed_pixel_cost == pytest.approx(ASSUMED_COSTS.packed_pixel_cost, rel=0.25)
    moved = (learned.render_call_seconds - ASSUMED_COSTS.render_call_seconds) * (seconds - 0.25 - 0.3)
    assert moved > 0.0


def test_a_short_first_sync_tells_nothing_of_the_next():
    source = SourceCost(20.0, 0.5 * TUNING.min_told_sync_seconds)
    learned = learned_costs(ASSUMED_COSTS, source, [TraceRender("packed", 3.0, 0.9, 0.1)])
    assert learned.resync_share == ASSUMED_COSTS.resync_share
    long = replace(source, sync_seconds=2.0)
    assert learned_costs(ASSUMED_COSTS, long, [TraceRender("packed", 3.0, 0.9, 0.1)]).resync_share == pytest.approx(
        0.5 * (ASSUMED_COSTS.resync_share + 0.45)
    )


@pytest.mark.parametrize("odd", [0, 1, 2])
def test_no_render_alone_tells_how_long_a_sync_is(odd):
    """Whichever it is of a frame's, the first one with what tracing adds to the scene or the last one."""
    syncs = [0.4, 0.4, 0.4]
    syncs[odd] = 1.9
    renders = [TraceRender("packed", 3.0 + sync, sync, 0.1) for sync in syncs]
    source = SourceCost(20.0, 2.0)
    learned = learned_costs(ASSUMED_COSTS, source, renders)
    assert learned.resync_share == pytest.approx(0.5 * (ASSUMED_COSTS.resync_share + 0.2))
    # Nor does it tell of anything else: its seconds are known apart from the others.
    alike = [TraceRender("packed", 3.4, 0.4, 0.1)] * 3
    assert learned.numbers == pytest.approx(learned_costs(ASSUMED_COSTS, source, alike).numbers)


@pytest.mark.parametrize("method", ["packed", "card", "full"])
@pytest.mark.parametrize("seconds", [0.0, 1e-6, 1e9])
@pytest.mark.parametrize("source", [SOURCE, SourceCost(0.0, 0.0), SourceCost(1e-9, 0.0), SourceCost(1e9, 1e8)])
@pytest.mark.parametrize("share", [0.0, 1e-9, 1.0, 2.0])
def test_whatever_is_measured_the_costs_stay_within_their_limits(method, seconds, source, share):
    known = ASSUMED_COSTS
    for _ in range(5):
        known = learned_costs(known, source, [TraceRender(method, seconds, seconds, share)] * 2)
    for name, (low, high) in cost_limits().items():
        assert low <= known.numbers[name] <= high


def test_what_tells_nothing_changes_nothing():
    assert learned_costs(ASSUMED_COSTS, SOURCE, []) is ASSUMED_COSTS
    whole = TraceRender("full", 90.0, 0.0, 1.0)
    assert learned_costs(ASSUMED_COSTS, SourceCost(20.0, 0.0), [whole]) is ASSUMED_COSTS


def test_costs_choose_the_method():
    quick = SourceCost(0.03, 0.0)
    assert choose_fill("auto", 0.1, quick, FREE).method == "full"
    assert choose_fill("auto", 0.1, quick, FREE, costs=TraceCosts(render_call_seconds=0.01)).method == "packed"
    assert choose_fill("auto", 0.4, SOURCE, FREE).method == "packed"
    dear = choose_fill("auto", 0.4, SOURCE, FREE, costs=TraceCosts(packed_pixel_cost=3.0))
    assert dear.method == "full"
    without = {"packed": "no OSL", "card": None}
    assert choose_fill("auto", 0.1, SOURCE, without).method == "card"
    assert choose_fill("auto", 0.1, SOURCE, without, costs=TraceCosts(card_pixel_cost=0.9)).method == "full"
    # By the same costs, so that a wide refinement is weighed alike.
    cheap = TraceCosts(packed_pixel_cost=0.5)
    assert choose_fill("auto", 0.3, SOURCE, FREE, expected=0.6).method == "full"
    assert choose_fill("auto", 0.3, SOURCE, FREE, expected=0.6, costs=cheap).method == "packed"


def test_a_probe_opens_the_card_for_its_filter():
    holes, probes = np.zeros((2, 10, 100), bool)
    holes[0, :10] = True
    assert open_share(holes, probes) == pytest.approx(0.01)
    probes[5, 7] = True
    assert open_share(holes, probes) == pytest.approx(0.01 + TUNING.card_pixels_per_probe / 1000)
    assert open_share(holes, ~holes) == 1.0


@pytest.mark.parametrize(
    "numbers",
    [
        None,
        [],
        "costs",
        {},
        {**ASSUMED_COSTS.numbers, "resync_share": None},
        {**ASSUMED_COSTS.numbers, "resync_share": "0.5"},
        {**ASSUMED_COSTS.numbers, "resync_share": True},
        {**ASSUMED_COSTS.numbers, "resync_share": float("nan")},
        {**ASSUMED_COSTS.numbers, "resync_share": float("inf")},
        {**ASSUMED_COSTS.numbers, "resync_share": 10**400},
    ],
)
def test_what_is_no_costs_is_none(numbers):
    assert costs_of(numbers, MEASURED) is None


def test_costs_that_are_read_are_held_within_their_limits():
    read = costs_of({**ASSUMED_COSTS.numbers, "packed_pixel_cost": 1e9, "render_call_seconds": -1, "more": 3}, MEASURED)
    assert read == TraceCosts(
        packed_pixel_cost=cost_limits()["packed_pixel_cost"][1],
        render_call_seconds=cost_limits()["render_call_seconds"][0],
        source=MEASURED,
    )
    assert ASSUMED_COSTS.source == ASSUMED
    assert ASSUMED_COSTS.within_limits() == ASSUMED_COSTS
