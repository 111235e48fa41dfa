"""START HERE for many views: the outermost ones are rendered, and what is between is made from them, or split by
rendering one more.

`view_plan` says which. Two views are a pair: the first is rendered, and the other made from it, or rendered too.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

import numpy as np

from ..settings.accuracy import Accuracy, accuracy_of
from ..settings.frame import StereoSettings
from ..trace.costs import TraceCosts
from ..views.view import Rig
from .renderer import Renderer
from .stopwatch import Stopwatch
from .tuning import TUNING
from .view_plan import Gap, ViewCosts
from .views_maker import FinishedView, PlanStep, ViewsMaker


def render_many_views(
    renderer: Renderer,
    settings: StereoSettings,
    names: Sequence[str],
    on_view: Callable[[FinishedView], None],
    *,
    accuracy: Accuracy | None = None,
    watch: Stopwatch | None = None,
    known_costs: Callable[[], TraceCosts] = TraceCosts,
) -> ViewsMaker:
    """Render the views of these names, from the leftmost to the rightmost, and hand each to `on_view` when it is
    finished; return the maker, which knows how they came about.

    The parameters are those of `render_stereo_frame`. At least two names are needed. Raises StereoReprojectError when a
    render fails.
    """
    rig = Rig.of_cameras(renderer.cameras, renderer.motion)
    maker = ViewsMaker(
        renderer,
        settings,
        [rig[name] for name in names],
        accuracy or accuracy_of(settings),
        watch or Stopwatch(),
        known_costs,
        on_view,
    )
    _make_all(maker)
    maker.watch.lap()
    return maker


def _make_all(maker: ViewsMaker) -> None:
    """Render or make all views, the outermost ones first."""
    last = len(maker.views) - 1
    maker.render(0, "outermost")
    if last == 1:
        _make_other(maker)
        return
    maker.render(last, "outermost")
    filler = GapFiller(maker)
    gaps = [Gap(0, last)]
    while gaps:
        gap = gaps.pop()
        if gap.count and filler.is_split(gap):
            gaps += reversed(gap.halves())
            continue
        # From left to right: no other gap needs this source.
        del maker.sources[gap.first]


def _make_other(maker: ViewsMaker) -> None:
    """Make the second of two views from the first; its tracing is a full render where that is cheaper."""
    [done] = maker.completed((0,), [maker.warped((0,), 1)])
    traced, names = float(np.mean(done.target.traced)), (maker.views[1].name,)
    maker.steps.append(PlanStep(names, f"made from the other: {traced:.0%} traced; {done.fill.reason}"))
    maker.finish((0,), 1, done)


class GapFiller:
    """Fills gaps between rendered views, and learns from each what the next will cost."""

    def __init__(self, maker: ViewsMaker) -> None:
        self._maker = maker
        self._made_seconds = 0.0
        self._refined: tuple[int, float] | None = None

    def is_split(self, gap: Gap) -> bool:
        """Fill a gap by making all of its views, or render the one in the middle and return True: two gaps of half the
        width are left then.

        The view in the middle tells: by its holes, and then, once it is probed, by what its promise calls for.
        """
        maker, differs = self._maker, self._maker.task(*(self._maker.views[end] for end in gap.ends)).may_differ
        start = time.perf_counter()
        tracing = maker.warped(gap.ends, gap.middle)
        self._made_seconds = time.perf_counter() - start
        holes = float(np.mean(tracing.target.traced))
        share = min(holes + self._expected_refinement(gap) * differs, 1.0)
        costs = self._costs()
        if costs.is_split(gap.count, share):
            maker.render(gap.middle, _reason(gap, holes, share, costs, "expected"))
            return True
        [middle] = maker.completed(gap.ends, [tracing])
        traced = float(np.mean(middle.target.traced))
        self._refined = gap.last - gap.first, max(traced - holes, 0.0)
        if differs and _is_split_after_all(gap, traced, costs):
            maker.render(gap.middle, _reason(gap, holes, traced, costs, "found"))
            return True
        names = tuple(maker.views[number].name for number in gap.inner)
        maker.steps.append(PlanStep(names, f"made: {_figures(gap, holes, traced, costs)}"))
        maker.finish(gap.ends, gap.middle, middle)
        for batch in maker.batches([number for number in gap.inner if number != gap.middle]):
            warped = [maker.warped(gap.ends, number) for number in batch]
            for number, done in zip(batch, maker.completed(gap.ends, warped), strict=True):
                maker.finish(gap.ends, number, done)
        return False

    def _expected_refinement(self, gap: Gap) -> float:
        """Return the share of the view in the middle of a gap that its promise will call for beyond the holes: by the
        last gap measured, in proportion to the angle; 0 before any was."""
        if self._refined is None:
            return 0.0
        width, share = self._refined
        return min(share * (gap.last - gap.first) / width, 1.0)

    def _costs(self) -> ViewCosts:
        """Return the costs of a view as they are known by now."""
        maker = self._maker
        whole = maker.plain_seconds(1) - maker.costs[0].sync_seconds
        return ViewCosts(maker.known_costs().packed_pixel_cost, self._made_seconds / max(whole, 1e-9))


def _is_split_after_all(gap: Gap, traced: float, costs: ViewCosts) -> bool:
    """Return whether it is still worth while to render the view in the middle of a gap, which was made already, and of
    which a share `traced` was traced."""
    left, right = gap.halves()
    halved = traced * TUNING.halved_gap_share
    split = 1.0 + costs.of_gap(left.count, halved) + costs.of_gap(right.count, halved)
    return split < costs.of_making(gap.count - 1, traced)


def _reason(gap: Gap, holes: float, share: float, costs: ViewCosts, how: str) -> str:
    """Return why a gap is split, in words: its view in the middle is `how` ("expected" or "found") to have a share
    traced."""
    return f"in the middle of a gap: {_figures(gap, holes, share, costs)} {how}"


def _figures(gap: Gap, holes: float, share: float, costs: ViewCosts) -> str:
    """Return in words what a gap was decided by."""
    made = costs.of_making(gap.count, share)
    return (
        f"of the middle one of {gap.count} views {share:.0%} traced ({holes:.0%} holes): {made:.1f} views of work to"
        f" make them, {costs.of_gap(gap.count, share):.1f} at best"
    )
