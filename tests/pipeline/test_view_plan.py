"""The plan of many views: what is cheap to make is made, and a wide gap of which much must be traced is split."""

import pytest

from stereo_reproject.pipeline.view_plan import Gap, ViewCosts

COSTS = ViewCosts(traced=1.25, made=0.05)


def test_a_gap_knows_its_views():
    gap = Gap(2, 7)
    assert (gap.count, gap.middle, gap.inner) == (4, 4, (3, 4, 5, 6))
    assert gap.halves() == (Gap(2, 4), Gap(4, 7))
    assert Gap(3, 4).count == 0


@pytest.mark.parametrize("count", [1, 2, 3, 46])
def test_what_needs_no_tracing_is_made(count):
    assert not COSTS.is_split(count, 0.0)
    assert COSTS.of_gap(count, 0.0) == pytest.approx(0.05 * count)


def test_a_view_alone_in_its_gap_is_rendered_where_that_is_cheaper():
    assert not ViewCosts(0.99, 0.0).is_split(1, 1.0)
    assert ViewCosts(1.01, 0.0).is_split(1, 1.0)


def test_more_views_in_a_gap_are_a_reason_to_split_it():
    splits = [COSTS.is_split(count, 0.2) for count in range(1, 64)]
    assert splits == sorted(splits)
    assert splits[0] is False
    assert splits[-1] is True


@pytest.mark.parametrize("share", [0.05, 0.2, 0.6, 1.0])
@pytest.mark.parametrize("count", [1, 5, 22, 46, 106])
def test_never_dearer_than_making_all_nor_than_rendering_all(count, share):
    best = COSTS.of_gap(count, share)
    assert best <= COSTS.of_making(count, share)
    assert best <= count * 1.0 + 1e-9 or best == COSTS.of_making(count, share)


def test_dear_tracing_has_all_views_rendered():
    dear = ViewCosts(traced=10.0, made=0.0)
    assert dear.of_gap(7, 1.0) == pytest.approx(7.0)
