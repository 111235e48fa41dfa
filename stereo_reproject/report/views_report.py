"""The report of many views as data: report.json is `as_json` of a `ViewsReport`, and docs/many-views.md explains it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from ..estimate.shared_noise import SharedNoise
from ..pipeline.stages import Stage
from ..pipeline.views_maker import FinishedView, PlanStep, ViewsMaker
from .as_json import ABSENT, Absent
from .frame_report import MemoryReport
from .header import PictureHeader
from .views_table import MADE, RENDERED


@dataclass(frozen=True, kw_only=True)
class ViewReport:
    """One view: its name, `how` it came to be (`RENDERED` or `MADE`), the names of the views that it was made from, and
    the share of its pixels that was traced, 0 to 1. honest_ratio is the estimate of its error and interval that of its
    95 % ends, None where nothing was probed. shown_from has the share of its pixels that each of those views shows, by
    name. camera is the name of its own camera in the scene, where it has one."""

    name: str
    how: str
    from_: tuple[str, ...]
    traced: float
    honest_ratio: float | None
    interval: tuple[float, float] | None
    shown_from: Mapping[str, float] = field(default_factory=dict)
    camera: str | Absent = ABSENT


@dataclass(frozen=True, kw_only=True)
class ViewsCompareReport:
    """The comparison with plain renders of some views in the same run.

    views are their names: both ends, and one that was made. plain_seconds are predicted for all views, from those that
    were rendered plainly, with one sync; speedup is that over the seconds of our views. The measures are those of the
    worst of them, as `images.metrics` has them; a view that was rendered whole is as good as plain.
    flicker_ratio is how much a surface changes from the view that was made to its neighbour, over that between plain
    renders, None where pictures are not denoised.
    """

    views: tuple[str, ...]
    plain_seconds: float
    speedup: float
    honest_ratio: float
    bias: float
    noise_ratio: float
    worst_tiles: float
    wrong_tiles: float
    flicker_ratio: float | None
    flip: float | None
    noise_flip: float | None
    flip_ratio: float | None


@dataclass(frozen=True, kw_only=True)
class NeighboursReport:
    """The noise of the mean of neighbouring views, as many as `count`, over that of as many plain renders.

    It is a ratio of standard deviations. noise_ratio is that of all such views, worst_noise_ratio that of the worst
    ones, whose names are worst_views.
    """

    count: int
    noise_ratio: float
    worst_noise_ratio: float
    worst_views: tuple[str, ...]


@dataclass(frozen=True, kw_only=True)
class FreshReport:
    """Pixels that were traced anew though the warp has an answer.

    share is what was asked for. predicted_seconds follow from whole renders; seconds are their part, by their number,
    of the seconds of all traces that were made together with them. noise_ratio_without is what
    `NeighboursReport.noise_ratio` would be without them, None where that is not known.
    """

    share: float
    predicted_seconds: float
    seconds: float
    noise_ratio_without: float | None


@dataclass(frozen=True, kw_only=True)
class ViewsReport(PictureHeader):
    """The report of many views of one frame; size is that of a view.

    cone_degrees is the angle between the outermost cameras, baseline the distance between them and focus_distance that
    of the plane that all views show alike, in scene units; cameras that the scene places have none. plan has a line for
    each decision on the way. seconds are by stage and in total. predicted_speedup is over rendering each view plainly.
    neighbours is None where pictures are denoised; fresh is absent where nothing was traced anew. files are the
    names of all files of the result.
    """

    cone_degrees: float | Absent = ABSENT
    baseline: float | Absent = ABSENT
    focus_distance: float | Absent = ABSENT
    display: str | None
    views: tuple[ViewReport, ...]
    plan: tuple[str, ...]
    seconds: Mapping[str, float]
    predicted_speedup: float
    packed_by: str
    memory: MemoryReport
    warnings: tuple[str, ...]
    neighbours: NeighboursReport | None = None
    fresh: FreshReport | Absent = ABSENT
    files: tuple[str, ...] = ()
    compare: ViewsCompareReport | Absent = ABSENT


def view_report(view: FinishedView) -> ViewReport:
    """Return the report of one view."""
    told = view.estimate
    ends = None if told is None else (told.honest_low, told.honest_high)
    return ViewReport(
        name=view.name,
        how=MADE if view.sources else RENDERED,
        from_=view.sources,
        traced=float(np.mean(view.traced)),
        honest_ratio=None if told is None else told.honest_ratio,
        interval=ends if ends is not None and all(map(math.isfinite, ends)) else None,
        shown_from=view.shown_from,
    )


def neighbours_report(noise: SharedNoise | None, names: Sequence[str]) -> NeighboursReport | None:
    """Return the report of the noise that the views of these names have in common; None where it is not known."""
    if noise is None:
        return None
    return NeighboursReport(
        count=noise.count,
        noise_ratio=noise.mean,
        worst_noise_ratio=noise.worst,
        worst_views=tuple(names[noise.worst_first : noise.worst_first + noise.count]),
    )


def fresh_report(maker: ViewsMaker, without: SharedNoise | None) -> FreshReport | Absent:
    """Return the report of what was traced anew; `without` is the noise that views would have in common without it."""
    fresh, camera = maker.fresh, maker.views[0].camera
    # Where all views were rendered, there was nothing to trace anew.
    if not fresh.traced:
        return ABSENT
    return FreshReport(
        share=fresh.share,
        predicted_seconds=fresh.traced / (camera.width * camera.height) * maker.packed_seconds,
        seconds=fresh.traced / fresh.filled * maker.watch.seconds.get(Stage.FILL, 0.0),
        noise_ratio_without=None if without is None else without.mean,
    )


def plan_lines(steps: Sequence[PlanStep]) -> tuple[str, ...]:
    """Return a line for each step of the plan."""
    return tuple(f"{_span(step.views)} {step.text}" for step in steps)


def _span(names: Sequence[str]) -> str:
    """Return names of views that follow each other as the first and the last of them."""
    return names[0] if len(names) == 1 else f"{names[0]} to {names[-1]}"
