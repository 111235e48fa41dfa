"""The report of many views as data: report.json is `as_json` of a `ViewsReport`, and docs/many-views.md explains it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from ..pipeline.views_maker import FinishedView, PlanStep
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
    """

    views: tuple[str, ...]
    plain_seconds: float
    speedup: float
    honest_ratio: float
    bias: float
    noise_ratio: float
    worst_tiles: float
    wrong_tiles: float
    flip: float | None
    noise_flip: float | None
    flip_ratio: float | None


@dataclass(frozen=True, kw_only=True)
class ViewsReport(PictureHeader):
    """The report of many views of one frame; size is that of a view.

    cone_degrees is the angle between the outermost cameras, baseline the distance between them and focus_distance that
    of the plane that all views show alike, in scene units; cameras that the scene places have none. plan has a line for
    each decision on the way. seconds are by stage and in total. predicted_speedup is over rendering each view plainly.
    files are the names of all files of the result.
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


def plan_lines(steps: Sequence[PlanStep]) -> tuple[str, ...]:
    """Return a line for each step of the plan."""
    return tuple(f"{_span(step.views)} {step.text}" for step in steps)


def _span(names: Sequence[str]) -> str:
    """Return names of views that follow each other as the first and the last of them."""
    return names[0] if len(names) == 1 else f"{names[0]} to {names[-1]}"
