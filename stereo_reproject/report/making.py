"""The report of a pair, made from its frames and from what is known of the scene's view layers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..images.effects import EffectsPlan
from ..pipeline.stereo_frame import StereoFrame, traced_fractions
from ..pipeline.stereo_pair import StereoPair
from ..settings.accuracy import Accuracy, accuracy_of
from ..settings.frame import StereoSettings
from ..warp.grid import Grid
from .as_json import ABSENT, Absent
from .estimates import effect_reports, estimate_report
from .frame_report import (
    FillReport,
    FrameReport,
    GridReport,
    LayerReport,
    MemoryReport,
    ParallaxReport,
    RefineReport,
    ReuseReport,
    WarpReport,
)
from .header import ReportHeader


@dataclass(frozen=True, kw_only=True)
class LayerFacts:
    """The facts about one view layer that its renderer knows and the report needs. time_limit and samples_rendered are
    as in `FrameReport`; parallax is None where no point is seen. packed_by is the camera of packed renders. why_whole
    says in words why the frame was not made from a key frame, None where it was; absent where that was not asked for.
    """

    header: ReportHeader
    packed_by: str
    plan: EffectsPlan
    parallax: ParallaxReport | None
    warnings: tuple[str, ...]
    time_limit: float | Absent = ABSENT
    samples_rendered: int | Absent | None = ABSENT
    why_whole: str | Absent | None = ABSENT


def pair_report(
    pair: StereoPair, facts: Sequence[LayerFacts], settings: StereoSettings, memory: MemoryReport
) -> FrameReport:
    """Return the report of a rendered pair. facts are those of its view layers in their order, the main one first;
    memory is that of this process."""
    frame, main = pair.main_frame, facts[0]
    refined = frame.refinement.fill
    return FrameReport(
        **vars(main.header),
        fill=FillReport(
            **vars(frame.fill),
            costs=frame.trace_costs,
            camera=main.packed_by if frame.fill.method == "packed" else None,
        ),
        refine=None if refined is None else (RefineReport(method=refined.method, reason=refined.reason),),
        grid=_grid_report(frame.grid),
        warp=WarpReport(asked=settings.warp, used=frame.warped_by, gpu=frame.gpu),
        fractions=traced_fractions(frame),
        effects=effect_reports(main.plan, frame.effect_costs),
        estimate=estimate_report(frame.refinement, accuracy_of(settings)),
        price=frame.next_accuracy,
        correction=frame.correction,
        time_limit=main.time_limit,
        samples_rendered=main.samples_rendered,
        parallax=main.parallax,
        warnings=tuple(dict.fromkeys(line for layer in facts for line in layer.warnings)),
        seconds=pair.seconds,
        predicted_speedup=pair.predicted_speedup,
        memory=memory,
        layers=layer_reports(pair) if len(pair.frames) > 1 else ABSENT,
        reuse=_reuse_report(frame, main.why_whole, accuracy_of(settings)),
    )


def _grid_report(grid: Grid | None) -> GridReport | None:
    """Return the part of the report about the source's grid; None where nothing was warped."""
    if grid is None:
        return None
    return GridReport(cells=grid.cells, subdivided=int(grid.subdivided.sum()), triangles=grid.triangles)


def _reuse_report(frame: StereoFrame, why_whole: str | Absent | None, accuracy: Accuracy) -> ReuseReport | Absent:
    """Return what is reported of a frame's reuse of a key frame; absent where none was asked for."""
    if isinstance(why_whole, Absent):
        return ABSENT
    reused = frame.reused
    if len(frame.eyes) == 1:
        return ReuseReport(key_frame=None if reused is None else reused.key_frame, whole=why_whole)
    if reused is None:
        return ReuseReport(key_frame=None, whole=why_whole, first_eye_traced=1.0, first_eye=None)
    return ReuseReport(
        key_frame=reused.key_frame,
        whole=None,
        first_eye_traced=float(np.mean(reused.traced)),
        first_eye=estimate_report(reused.refinement, accuracy),
    )


def layer_reports(pair: StereoPair) -> tuple[LayerReport, ...]:
    """Return the report of each view layer of a pair, in their order."""
    return tuple(_layer_report(name, frame) for name, frame in pair.frames.items())


def _layer_report(name: str, frame: StereoFrame) -> LayerReport:
    """Return the report of the view layer `name` from its frame."""
    estimate = frame.refinement.estimate
    return LayerReport(
        name=name,
        rerendered=float(np.mean(frame.traced)),
        fill=frame.fill.method,
        noise_ratio=None if estimate is None else estimate.noise_ratio,
        correction=frame.correction,
        seconds=frame.seconds["total"],
    )
