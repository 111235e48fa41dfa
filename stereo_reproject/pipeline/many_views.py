"""START HERE for many views: the outermost ones are rendered, and what is between is made from them, or split by
rendering one more.

`view_plan` says which. Two views are a pair: the first is rendered, and the other made from it, or rendered too.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ..settings.accuracy import accuracy_of
from ..settings.frame import StereoSettings
from ..trace.costs import TraceCosts
from ..views.view import Rig
from .fresh import FreshPixels
from .renderer import Renderer
from .shared_findings import SharedFindings
from .stopwatch import Stopwatch
from .tuning import TUNING
from .view_plan import Gap, ViewCosts
from .views_maker import FinishedView, PlanStep, ViewsMaker


@dataclass(frozen=True)
class WantedViews:
    """The views that are wanted: their names, from the leftmost to the rightmost, at least two. fresh is the share, 0
    to 1, of the warped pixels of made views that is traced anew; none is in denoised pictures."""

    names: Sequence[str]
    fresh: float = 0.0


def render_many_views(
    renderer: Renderer,
    settings: StereoSettings,
    wanted: WantedViews,
    on_view: Callable[[FinishedView], None],
    *,
    watch: Stopwatch | None = None,
    findings: SharedFindings | None = None,
    known_costs: Callable[[], TraceCosts] = TraceCosts,
) -> ViewsMaker:
    """Render views, and hand each to `on_view` when it is finished; return the maker, which knows how they came about.

    The other parameters are those of `render_stereo_frame`. Raises StereoReprojectError when a render fails.
    """
    rig = Rig.of_cameras(renderer.cameras, renderer.motion)
    maker = ViewsMaker(
        renderer,
        settings,
        [rig[name] for name in wanted.names],
        accuracy_of(settings),
        watch or Stopwatch(),
        known_costs,
        on_view,
        # Alone in a denoised picture, a traced pixel stands out.
        FreshPixels(wanted.fresh if renderer.denoise is None else 0.0, renderer.seed),
        findings=findings or SharedFindings(),
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
    gaps = [Gap(0, last)]
    while gaps:
        gap = gaps.pop()
        if gap.count and _is_split(maker, gap):
            gaps += reversed(gap.halves())
            continue
        # From left to right: no other gap needs this source.
        del maker.sources[gap.first]


def _make_other(maker: ViewsMaker) -> None:
    """Make the second of two views from the first; its tracing is a full render where that is cheaper."""
    tracing = maker.warped((0,), 1)
    [done] = maker.completed((0,), [tracing], maker.filled([tracing]))
    traced, names = float(np.mean(done.target.traced)), (maker.views[1].name,)
    maker.steps.append(PlanStep(names, f"made from the other: {traced:.0%} traced; {done.fill.reason}"))
    maker.finish((0,), 1, done)


def _is_split(maker: ViewsMaker, gap: Gap) -> bool:
    """Fill a gap by making all of its views, or render the one in the middle and return True: two gaps of half the
    width are left then.

    The view in the middle tells: by its holes, and then, once these and its probes are traced, by what its promise
    calls for.
    """
    start = time.perf_counter()
    tracing = maker.warped(gap.ends, gap.middle)
    costs = maker.findings.view_costs(_costs(maker, time.perf_counter() - start))
    holes = maker.fresh.without(float(np.mean(tracing.target.traced)))
    foreseen = tracing.planned_fill()
    if foreseen.method == "full" and foreseen.predicted_seconds > 0.0:
        maker.render(gap.middle, foreseen.reason)
        return True
    if costs.is_split(gap.count, holes):
        maker.render(gap.middle, _figures(gap, holes, "holes", costs))
        return True
    fills = maker.filled([tracing])
    share = maker.fresh.without(float(np.mean(tracing.target.traced))) + tracing.share_to_refine
    if _is_split_after_all(gap, share, costs):
        maker.render(gap.middle, _figures(gap, share, "to be traced", costs))
        return True
    names = tuple(maker.views[number].name for number in gap.inner)
    maker.steps.append(PlanStep(names, f"made: {_figures(gap, share, 'to be traced', costs)}"))
    [middle] = maker.completed(gap.ends, [tracing], fills)
    maker.finish(gap.ends, gap.middle, middle)
    for batch in maker.batches([number for number in gap.inner if number != gap.middle]):
        warped = [maker.warped(gap.ends, number) for number in batch]
        for number, done in zip(batch, maker.completed(gap.ends, warped, maker.filled(warped)), strict=True):
            maker.finish(gap.ends, number, done)
    return False


def _costs(maker: ViewsMaker, warp_seconds: float) -> ViewCosts:
    """Return the costs of a view as they are known by now; warp_seconds are those of warping one. Of a picture that is
    denoised, a made view is denoised too."""
    whole = max(maker.plain_seconds(1) - maker.costs[0].sync_seconds, 1e-9)
    denoising = float(np.mean([cost.denoise_seconds for cost in maker.costs]))
    finishing = denoising if maker.finish_seconds is None else maker.finish_seconds
    tracing = maker.known_costs().packed_pixel_cost * (whole - denoising)
    # As much of each view is traced anew, however far it is from those it is made from.
    made = warp_seconds + finishing + maker.fresh.share * tracing
    return ViewCosts(tracing / whole, made / whole)


def _is_split_after_all(gap: Gap, share: float, costs: ViewCosts) -> bool:
    """Return whether it is worth while to render the view in the middle of a gap, of which a share, 0 to 1, is to be
    traced, though its holes and probes were traced by now."""
    left, right = gap.halves()
    halved = share * TUNING.halved_gap_share
    split = 1.0 + costs.of_gap(left.count, halved) + costs.of_gap(right.count, halved)
    return split < costs.of_making(gap.count, share)


def _figures(gap: Gap, share: float, what: str, costs: ViewCosts) -> str:
    """Return in words what a gap was decided by; `what` says what the share of the middle view is of."""
    made, best = costs.of_making(gap.count, share), costs.of_gap(gap.count, share)
    return (
        f"of the middle one of {gap.count} views {share:.0%} are {what}: {made:.1f} views of work to make them all,"
        f" {best:.1f} at best"
    )
