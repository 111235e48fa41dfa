"""The choice of how holes are traced: never one that is predicted to be slower, and always with a reason."""

import itertools

import numpy as np
import pytest

from stereo_reproject.errors import BadInputError
from stereo_reproject.trace.costs import TraceCosts
from stereo_reproject.trace.fill import SourceCost, check_fill, choose_fill

ASSUMED_COSTS = TraceCosts()

FREE = {"packed": None, "card": None}
NO_OSL = {"packed": "OSL is absent", "card": None}
NO_CARD = {"packed": None, "card": "the camera is orthographic"}
NEITHER = {"packed": "OSL is absent", "card": "the camera is orthographic"}

COSTS = [SourceCost(*cost) for cost in itertools.product([0.0, 0.2, 2.0, 60.0, 3600.0], [0.0, 0.1, 5.0, 100.0])]
FRACTIONS = [0.0, 1e-6, 0.01, 0.06, 0.3, 0.6, 0.9, 1.0]


@pytest.mark.parametrize("blockers", [FREE, NO_OSL, NO_CARD, NEITHER])
@pytest.mark.parametrize("cost", COSTS)
def test_auto_is_never_predicted_to_be_slower_than_full(cost, blockers):
    for fraction in FRACTIONS:
        full = choose_fill("full", fraction, cost, blockers).predicted_seconds
        choice = choose_fill("auto", fraction, cost, blockers)
        assert choice.predicted_seconds <= full
        assert choice.reason
        assert "\n" not in choice.reason


@pytest.mark.parametrize("blockers", [FREE, NO_OSL, NO_CARD, NEITHER])
@pytest.mark.parametrize("cost", COSTS)
def test_auto_takes_nothing_that_is_blocked(cost, blockers):
    for fraction in FRACTIONS[1:]:
        choice = choose_fill("auto", fraction, cost, blockers)
        assert not blockers.get(choice.method)
        for method, blocker in blockers.items():
            assert blocker is None or (method in choice.reason and blocker in choice.reason)


@pytest.mark.parametrize("cost", COSTS)
def test_auto_takes_what_is_predicted_to_be_fastest(cost):
    """Unless that is full by a hair: then full itself, which has no overhead that was guessed wrong."""
    for fraction in FRACTIONS[1:]:
        choice = choose_fill("auto", fraction, cost, FREE)
        each = {method: choose_fill(method, fraction, cost, FREE).predicted_seconds for method in ("packed", "card")}
        if choice.method != "full":
            assert each[choice.method] == min(each.values())


def test_few_holes_are_packed_and_a_frame_of_holes_is_rendered_in_full():
    cost = SourceCost(seconds=20.0, sync_seconds=1.0)
    assert choose_fill("auto", 0.06, cost, FREE).method == "packed"
    assert choose_fill("auto", 0.06, cost, NO_OSL).method == "card"
    assert choose_fill("auto", 0.06, cost, NEITHER).method == "full"
    assert choose_fill("auto", 1.0, cost, FREE).method == "full"
    assert choose_fill("auto", 1.0, cost, NO_OSL).method == "full"


def test_a_source_that_took_no_time_is_rendered_again():
    """Every method costs one render call, and there is nothing to gain."""
    assert choose_fill("auto", 0.05, SourceCost(0.05, 0.02), FREE).method == "full"


def test_without_holes_nothing_is_traced_and_nothing_is_spent():
    choice = choose_fill("auto", 0.0, SourceCost(20.0, 1.0), FREE)
    assert choice.predicted_seconds == 0.0
    assert choice.reason


@pytest.mark.parametrize("method", ["packed", "card", "full"])
@pytest.mark.parametrize("fraction", [0.0, 0.5, 1.0])
def test_what_was_asked_for_is_taken(method, fraction):
    choice = choose_fill(method, fraction, SourceCost(20.0, 1.0), FREE)
    assert choice.method == method
    assert choice.reason
    check_fill(method, FREE)


def test_more_holes_cost_more():
    cost = SourceCost(20.0, 1.0)
    for method in ("packed", "card"):
        predicted = [choose_fill(method, fraction, cost, FREE).predicted_seconds for fraction in FRACTIONS]
        assert np.all(np.diff(predicted) >= 0)
        assert predicted[-1] > predicted[0]


@pytest.mark.parametrize("method", ["packed", "card"])
def test_what_was_asked_for_and_is_blocked_is_bad_input_that_says_why(method):
    with pytest.raises(BadInputError) as raised:
        check_fill(method, NEITHER)
    message = str(raised.value)
    assert NEITHER[method] in message
    assert f"--fill {method}" in message
    assert "--fill auto" in message
    assert "\n" not in message
    assert raised.value.exit_status == 2


@pytest.mark.parametrize("method", ["auto", "full"])
def test_auto_and_full_are_always_possible(method):
    check_fill(method, NEITHER)
    check_fill(method, {})


def test_the_sync_is_not_part_of_what_a_pixel_costs():
    cost = SourceCost(seconds=10.0, sync_seconds=4.0)
    assert cost.per_frame == 6.0
    assert 0.0 < cost.fixed(ASSUMED_COSTS) < cost.sync_seconds
    assert SourceCost(seconds=1.0, sync_seconds=4.0).per_frame == 0.0


def test_probes_cost_what_they_are_traced_for():
    cost = SourceCost(100.0, 0.0)
    for method in ("packed", "card"):
        without = choose_fill(method, 0.1, cost, FREE).predicted_seconds
        assert choose_fill(method, 0.1, cost, FREE, spacing=8).predicted_seconds > without
    packed = choose_fill("packed", 0.1, cost, FREE, spacing=8).predicted_seconds
    assert packed == pytest.approx(choose_fill("packed", 0.1 + 2 / 64, cost, FREE).predicted_seconds)
    # The card's probes have a render of their own, in which every pixel still costs its share.
    card, alone = (choose_fill("card", 0.1, cost, FREE, spacing=s).predicted_seconds for s in (8, None))
    assert card - alone > cost.fixed(ASSUMED_COSTS) + 0.1 * cost.per_frame


def test_a_card_with_probes_is_not_taken_where_a_full_render_is_cheaper():
    cost = SourceCost(10.0, 0.0)
    share = next(s for s in np.linspace(0, 1, 200) if choose_fill("auto", s, cost, NO_OSL).method == "full")
    assert choose_fill("auto", share - 0.1, cost, NO_OSL).method == "card"
    assert choose_fill("auto", share - 0.1, cost, NO_OSL, spacing=8).method == "full"


def test_what_is_expected_to_be_refined_may_decide_for_a_full_render():
    cost = SourceCost(100.0, 0.0)
    assert choose_fill("auto", 0.3, cost, FREE, spacing=8, expected=0.1).method == "packed"
    told = choose_fill("auto", 0.3, cost, FREE, spacing=8, expected=0.6)
    assert told.method == "full"
    assert "60 %" in told.reason
    assert choose_fill("packed", 0.3, cost, FREE, spacing=8, expected=0.6).method == "packed"
