"""All cases of a price list on one scene, against one multiview: what `tradeoff` on the command line calls.

What the cases share, they share so that each is as it would be alone. The source eye is the same for all, to the bit:
it is rendered once, from a scene that nothing has synced, and every case counts its seconds. Multiview and the
heuristic mask, whose source has more passes, begin from a scene copy of their own, as unsynced as that. What only the
first render of a process pays (reading textures, compiling the hole camera) is paid by a small render before all of
them, and what only the first packed trace of a scene pays (a portal's sheet, which Cycles syncs) by a trace of a few
pixels after the shared source. Neither counts in any case; the heuristic mask alone pays for its own sheet.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

import bpy
import numpy as np

from ...errors import BadInputError, StereoReprojectError
from ...files import write_json
from ...images.passes import Passes, deepest
from ...images.reasons import Reason
from ...pipeline.frame import render_stereo_frame
from ...pipeline.onlooker import Onlooker
from ...pipeline.stages import OUTSIDE_TOTAL, Stage
from ...pipeline.stereo_frame import StereoFrame, colour, traced_fractions
from ...pipeline.stopwatch import Stopwatch
from ...report.as_json import as_json
from ...report.chart_canvas import check_charts
from ...settings.frame import StereoSettings
from ...trace.requests import TraceRequest
from ...tradeoff.cases import (
    HEURISTIC,
    TRADEOFF_FILES,
    Row,
    TradeoffCase,
    chosen_cases,
    price_list,
    split_probes,
    write_csv,
)
from ...tradeoff.charts import draw_charts
from ..engines.renderer import BlenderRenderer
from ..scene.warnings import first_layer_alone, scene_warnings
from ..scene.working import make_small, working_scene
from .compare import MultiviewReference, render_reference
from .frame import report_header
from .known_costs import known_costs
from .price_list_renderers import HeuristicRenderer, SharedSourceRenderer, render_shared_source

OnStage = Callable[[str, str], None]

NOTHING_SHARED: Mapping[str, float] = MappingProxyType({})

WARM_UP_WIDTH_PIXELS = 64
WARM_UP_SAMPLES = 1
WARM_UP_PIXELS_PER_SIDE = 8
"""Pixels that are traced to warm up, across and down the picture."""


def render_prices(
    scene: bpy.types.Scene,
    settings: StereoSettings,
    work: Path,
    *,
    only: Sequence[str] = (),
    on_stage: OnStage = lambda *_: None,
) -> tuple[dict[str, Any], list[str]]:
    """Make the cases of a price list for one frame, all or `only` those named, and write their files into work/out.

    Return what tradeoff.json holds, and the files' names. on_stage gets the name of each case, and of the stage that
    begins in it. A case that the scene cannot have is left out, with a warning that says why. Raises BadInputError and
    StereoReprojectError.
    """
    check_charts()
    out = work / "out"
    out.mkdir(exist_ok=True)
    on_stage("warm-up", "")
    warm_up = _warm_up(scene, settings, work)
    on_stage("multiview", "")
    multiview = render_reference(scene, settings, work)
    facts, outcome = _render_cases(scene, settings, work, multiview, chosen_cases(only), on_stage)
    facts["warm_up_seconds"] += warm_up
    measured = {"seconds": multiview.seconds, "noise_rmse": multiview.noise_rmse}
    prices = price_list(facts, measured, outcome.rows, outcome.left_out)
    left_out = [f"{name} is left out: {why}" for name, why in outcome.left_out]
    prices["warnings"] = scene_warnings(scene, settings.scene) + first_layer_alone(scene, "all runs are") + left_out
    on_stage(Stage.WRITE, "")
    write_csv(out / "tradeoff.csv", prices)
    write_json(out / "tradeoff.json", prices)
    draw_charts(prices, out)
    return prices, list(TRADEOFF_FILES)


def _warm_up(scene: bpy.types.Scene, settings: StereoSettings, work: Path) -> float:
    """Render a few pixels in every way that the cases need, so that no case pays for what only a first render costs.
    Return the seconds that it took.
    """
    start = time.perf_counter()
    with working_scene(scene, replace(settings.scene, samples=WARM_UP_SAMPLES)) as working:
        make_small(working, WARM_UP_WIDTH_PIXELS)
        renderer = BlenderRenderer(working, work, packed_by=settings.packed_by)
        source, _ = renderer.render_source(settings.source)
        _trace_few(renderer, settings.target, source, ("packed", "card"))
    return time.perf_counter() - start


def _trace_few(renderer: BlenderRenderer, target: str, source: Passes, methods: Sequence[str]) -> None:
    """Trace a few pixels of the target view by each of the fill methods that can be used for what the source's passes
    show, and throw them away.
    """
    camera = renderer.cameras[target]
    pixels = np.zeros((camera.height, camera.width), bool)
    down, across = (max(side // WARM_UP_PIXELS_PER_SIDE, 1) for side in pixels.shape)
    pixels[::down, ::across] = True
    blockers = renderer.fill_blockers(deepest(source))
    for method in methods:
        if not blockers[method]:
            renderer.trace(method, [TraceRequest(target, pixels)])


@dataclass
class _Outcome:
    """The outcome of cases that are rendered with these settings and measured against this multiview: rows of the
    price list, and the names of cases that are left out, each with the reason.
    """

    settings: StereoSettings
    multiview: MultiviewReference
    rows: list[Row] = field(default_factory=list)
    left_out: list[tuple[str, str]] = field(default_factory=list)

    def add(
        self,
        case: TradeoffCase,
        renderer: BlenderRenderer,
        watch: Stopwatch,
        *,
        shared: Mapping[str, float] = NOTHING_SHARED,
    ) -> None:
        """Render a case and add its row. A case that raises StereoReprojectError is left out with the reason; the
        others go on. watch and shared are as for `_make`.
        """
        try:
            self.rows.append(_make(case, renderer, self.settings, self.multiview, watch, shared=shared))
        except StereoReprojectError as error:
            self.left_out.append((case.name, str(error)))


def _render_cases(
    scene: bpy.types.Scene,
    settings: StereoSettings,
    work: Path,
    multiview: MultiviewReference,
    chosen: Sequence[TradeoffCase],
    on_stage: OnStage,
) -> tuple[dict[str, Any], _Outcome]:
    """Render the chosen cases. Return facts of the scene and its source, by their keys in tradeoff.json, and the rows
    in the cases' order. Raises StereoReprojectError when not a single case could be made.
    """
    outcome = _Outcome(settings, multiview)
    facts = _add_on_shared_source(outcome, scene, work, [case for case in chosen if case.kind != HEURISTIC], on_stage)
    for case in chosen:
        if case.kind == HEURISTIC:
            _add_heuristic(outcome, scene, work, case, on_stage)
    if not outcome.rows:
        raise StereoReprojectError(f"no run came through: {outcome.left_out[0][1]}")
    order = [case.name for case in chosen]
    outcome.rows.sort(key=lambda row: order.index(row.name))
    return facts, outcome


def _add_on_shared_source(
    outcome: _Outcome, scene: bpy.types.Scene, work: Path, cases: Sequence[TradeoffCase], on_stage: OnStage
) -> dict[str, Any]:
    """Render the source that these cases share, and add each of them to the outcome. Return facts of the scene and its
    source, by their keys in tradeoff.json.
    """
    settings = outcome.settings
    start = time.perf_counter()
    with working_scene(scene, settings.scene) as working:
        copied = time.perf_counter() - start
        facts = as_json(report_header(scene, working, settings))
        del facts["accuracy"]
        seed = working.cycles.seed
        on_stage(Stage.SOURCE, "")
        source = render_shared_source(working, settings, work)
        facts["source"] = {"seconds": source.seconds, "sync_seconds": source.cost.sync_seconds}
        start = time.perf_counter()
        renderer = SharedSourceRenderer(working, work, source, packed_by=settings.packed_by)
        _trace_few(renderer, settings.target, source.passes, ("packed",))
        facts["warm_up_seconds"] = time.perf_counter() - start
        shared = {"plan": copied, "source": source.seconds}
        for case in cases:
            # Renders leave their seed behind; each case begins with the scene's own, as it would alone.
            working.cycles.seed = seed
            watch = _watch(case, on_stage)
            renderer = SharedSourceRenderer(working, work, source, packed_by=settings.packed_by)
            outcome.add(case, renderer, watch, shared=shared)
    return facts


def _add_heuristic(
    outcome: _Outcome, scene: bpy.types.Scene, work: Path, case: TradeoffCase, on_stage: OnStage
) -> None:
    """Add the case of the heuristic mask to the outcome; its source is rendered from a scene copy of its own."""
    watch = _watch(case, on_stage)
    with working_scene(scene, outcome.settings.scene) as working:
        renderer = HeuristicRenderer(working, work, packed_by=outcome.settings.packed_by)
        outcome.add(case, renderer, watch)


def _watch(case: TradeoffCase, on_stage: OnStage) -> Stopwatch:
    """Return the stopwatch of a case, started at its first stage; on_stage gets the case's name and each stage's."""
    watch = Stopwatch(Onlooker(lambda stage: on_stage(case.name, stage)))
    watch.lap(Stage.PLAN)
    return watch


def _make(
    case: TradeoffCase,
    renderer: BlenderRenderer,
    settings: StereoSettings,
    multiview: MultiviewReference,
    watch: Stopwatch,
    *,
    shared: Mapping[str, float] = NOTHING_SHARED,
) -> Row:
    """Render one case, measure it against multiview, and return its row. shared are seconds, by stage, that were spent
    for all cases together and that the case's own watch does not see. Raises StereoReprojectError when it cannot be
    made.
    """
    blocker = renderer.fill_blockers().get(case.fill)
    if blocker:
        raise BadInputError(blocker)
    frame = render_stereo_frame(
        renderer,
        case.settings(settings),
        watch=watch,
        accuracy=case.accuracy,
        known_costs=lambda: known_costs(renderer.scene, renderer.packed_by),
    )
    return _row(case, frame, settings, multiview, _seconds(frame, shared))


def _row(
    case: TradeoffCase,
    frame: StereoFrame,
    settings: StereoSettings,
    multiview: MultiviewReference,
    seconds: dict[str, float],
) -> Row:
    """Return the row of a case whose frame is rendered: its seconds, by stage, and its target measured against
    multiview.
    """
    fractions = traced_fractions(frame)
    refined = frame.refinement.fill
    return Row(
        name=case.name,
        kind=case.kind,
        accuracy=case.accuracy_name,
        seconds=seconds,
        speedup=multiview.seconds / sum(seconds.values()),
        **multiview.judge(colour(frame.eyes[settings.target]), frame.variance_share),
        traced=fractions.pop("rerendered"),
        fill=frame.fill.method,
        refine_fill=None if refined is None else refined.method,
        fractions=fractions,
        estimate=_estimate(frame, case),
    )


def _seconds(frame: StereoFrame, shared: Mapping[str, float]) -> dict[str, float]:
    """Return the case's seconds by stage, shared ones added. Of the fill's seconds, the probes' part is a stage of its
    own.
    """
    stages = {name: seconds for name, seconds in frame.seconds.items() if name not in ("total", *OUTSIDE_TOTAL)}
    stages |= {name: stages[name] + seconds for name, seconds in shared.items()}
    probe = (frame.reasons & Reason.PROBE.bit) > 0
    hole = (frame.reasons & ~(Reason.PROBE.bit | Reason.REFINED.bit)) > 0
    in_fill = 0 if frame.fill.method == "full" else int(probe.sum())
    return split_probes(stages, int(hole.sum()), in_fill)


def _estimate(frame: StereoFrame, case: TradeoffCase) -> dict[str, float | None] | None:
    """Return the frame's estimated noise ratio and honest ratio with their intervals, and the promise of the case; None
    without an estimate.
    """
    estimate = frame.refinement.estimate
    if estimate is None:
        return None
    return {
        "noise_ratio": estimate.noise_ratio,
        "low": estimate.low,
        "high": estimate.high,
        "honest_ratio": estimate.honest_ratio,
        "honest_low": estimate.honest_low,
        "honest_high": estimate.honest_high,
        "promise": case.accuracy.promise,
    }
