"""The report of a pair as data: report.json is `as_json` of a `FrameReport`, and docs/report.md explains its keys.

Whoever reads a report later (command line, panels, charts) reads the dict that was written as JSON, by any version.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from ..matching.matching import Correction
from ..pipeline.next_accuracy import NextAccuracy
from ..trace.costs import TraceCosts
from ..views.parallax import ScreenParallax
from .as_json import ABSENT, Absent
from .header import ReportHeader


@dataclass(frozen=True)
class FillReport:
    """The choice of a fill method, as `FillChoice` has it, the costs of tracing by which it was chosen, and the packed
    camera that shot the rays ("osl" or "portal"), None for pixels that were not packed."""

    method: str
    reason: str
    predicted_seconds: float
    costs: TraceCosts
    camera: str | None


@dataclass(frozen=True, kw_only=True)
class RefineReport:
    """One render of tiles that refinement asked for: the fill method, and the reason why that method was chosen, in
    words."""

    method: str
    reason: str


@dataclass(frozen=True, kw_only=True)
class GridReport:
    """Counts of the source's grid: all cells, the subdivided ones among them, and the triangles."""

    cells: int
    subdivided: int
    triangles: int


@dataclass(frozen=True, kw_only=True)
class WarpReport:
    """The means of the warp: asked is the setting ("auto", "numpy" or "gpu"), used is the one that did it, and gpu is
    the GPU's name, None without one."""

    asked: str
    used: str
    gpu: str | None


@dataclass(frozen=True, kw_only=True)
class EffectReport:
    """One effect in a frame: what calls for it, its cost, and the error that is left where it is seen.

    called_for is False for an effect that the scene does not have. by are the names of the objects or materials that
    call for it. handling says in words what is done. fraction is the share of the target's pixels traced because of it,
    and seconds its share of the time. excess is the noise ratio squared less 1, from excess_low to excess_high with 95
    % confidence; None where no probe tells.
    """

    effect: str
    called_for: bool
    by: tuple[str, ...]
    handling: str
    fraction: float
    seconds: float
    excess: float | None
    excess_low: float | None
    excess_high: float | None


@dataclass(frozen=True, kw_only=True)
class EstimateReport:
    """The estimate of the target's quality beside what the accuracy promises.

    noise_ratio has a 95 % interval from low to high; excess is that ratio squared less 1. bias is the error apart from
    noise, a root mean square in standard deviations of one plain render's noise; honest_ratio is sqrt(1 + bias^2 / 2),
    from honest_low to honest_high. promise is the greatest honest ratio that is promised, and worst_tiles_promise that
    of the worst tiles; None promises nothing. wrong_tiles is the share, 0 to 1, of the tiles that are wrong so that it
    can be seen. kept is None where the probes cannot tell. probes is the number of probes in tiles that stayed warped,
    tile_size the side of a tile in pixels. from_ says in words where the figures come from.
    """

    noise_ratio: float
    low: float | None
    high: float | None
    excess: float
    bias: float
    honest_ratio: float
    honest_low: float | None
    honest_high: float | None
    promise: float | None
    worst_tiles: float
    worst_tiles_promise: float | None
    wrong_tiles: float
    kept: bool | None
    probes: int
    tile_size: int | None
    from_: str


@dataclass(frozen=True, kw_only=True)
class NoEstimateReport:
    """The part of the report in place of an `EstimateReport` where there is no estimate. It has the same keys, in
    another order; from_ says why there is none."""

    noise_ratio: None = None
    low: None = None
    high: None = None
    excess: None = None
    bias: None = None
    honest_ratio: None = None
    honest_low: None = None
    honest_high: None = None
    worst_tiles: None = None
    worst_tiles_promise: None = None
    wrong_tiles: None = None
    kept: None = None
    tile_size: None = None
    promise: float | None
    probes: int = 0
    from_: str


@dataclass(frozen=True, kw_only=True)
class ParallaxReport:
    """The parallax on the screen of the nearest and of the farthest point that the source eye sees."""

    nearest: ScreenParallax
    farthest: ScreenParallax


@dataclass(frozen=True, kw_only=True)
class MemoryReport:
    """Memory of the process in MiB: the most that it has held so far, and the amount now; None where the system does
    not say."""

    peak_mb: float | None
    resident_mb: float | None


@dataclass(frozen=True, kw_only=True)
class LayerReport:
    """One view layer of several: rerendered is the share of its target's pixels that was traced, and fill its fill
    method. noise_ratio is None without an estimate. correction is the change of traced light to match EEVEE's, None
    where there was none. seconds are those of this layer in total."""

    name: str
    rerendered: float
    fill: str
    noise_ratio: float | None
    correction: Correction | None
    seconds: float


@dataclass(frozen=True, kw_only=True)
class CutoutReport:
    """A cut-out of a panorama compared with that of Blender's multiview: a perspective picture 90° wide and high, of
    size x size pixels, whose middle is so many degrees to the left of the panorama's and above it.

    The ratios are as in `CompareReport`, over the panorama's pixels that are nearest to the cut-out's; FLIP is of
    cut-outs that are interpolated.
    """

    name: str
    left_degrees: float
    up_degrees: float
    size: int
    honest_ratio: float | None
    noise_ratio: float | None
    flip: float | None
    noise_flip: float | None
    flip_ratio: float | None


@dataclass(frozen=True, kw_only=True)
class EyeErrors:
    """Errors of one eye against Blender's multiview, rendered in the same run.

    rmse and flip are those against multiview's eye, as a root mean square after tone mapping and by FLIP; noise_flip is
    that of multiview's eye rendered with another seed, and flip_ratio is flip over noise_flip. noise_ratio, bias,
    honest_ratio, worst_tiles, wrong_tiles and flip_ratio are None where there is no noise, and no_noise then says why.
    FLIP is None where it is not installed.
    """

    rmse: float
    noise_ratio: float | None
    bias: float | None
    honest_ratio: float | None
    worst_tiles: float | None
    wrong_tiles: float | None
    no_noise: str | Absent = ABSENT
    flip: float | None
    noise_flip: float | None
    flip_ratio: float | None


@dataclass(frozen=True, kw_only=True)
class MultiviewSeconds:
    """Time of Blender's multiview beside ours, and its noise: the first part of a `CompareReport`."""

    multiview_seconds: float
    speedup: float
    noise_rmse: float


@dataclass(frozen=True, kw_only=True)
class CompareReport(EyeErrors, MultiviewSeconds):
    """The pair compared with Blender's multiview, rendered in the same run; the errors are the target's.

    noise_rmse is that of multiview's eye rendered with another seed. cutouts is absent but for panoramas. first_eye has
    the errors of the other eye where that was made too; absent where it was rendered.
    """

    cutouts: tuple[CutoutReport, ...] | Absent = ABSENT
    first_eye: EyeErrors | Absent = ABSENT


@dataclass(frozen=True, kw_only=True)
class ReuseReport:
    """Origin of a pair in an animation whose frames may be made from key frames.

    key_frame is the number of the frame that both eyes were made from; None for a frame of which one eye was rendered
    whole, and whole then says why. first_eye_traced is the share of the first eye's pixels that was traced, and
    first_eye the estimate of its error, None where it was rendered. Both are absent from a mono frame, whose one view
    the rest of the report is about.
    """

    key_frame: int | None
    whole: str | None
    first_eye_traced: float | Absent = ABSENT
    first_eye: EstimateReport | NoEstimateReport | Absent | None = ABSENT


@dataclass(frozen=True, kw_only=True)
class FrameReport(ReportHeader):
    """The report of a pair. `seconds` are those of all view layers together, by stage; all else is of the main view
    layer.

    fractions are shares of the target's pixels by the reason why they were traced; its "rerendered" is the share of all
    traced ones. price is the predicted cost of the next better accuracy. Absent keys: time_limit (seconds) and
    samples_rendered without a time limit in the scene, layers with a single view layer, compare unless it was asked
    for, reuse but in an animation that was asked for it. samples_rendered is None where it is not known.
    """

    fill: FillReport
    refine: tuple[RefineReport, ...] | None
    grid: GridReport | None
    warp: WarpReport
    fractions: Mapping[str, float]
    effects: tuple[EffectReport, ...]
    estimate: EstimateReport | NoEstimateReport
    price: NextAccuracy
    correction: Correction | None
    time_limit: float | Absent = ABSENT
    samples_rendered: int | Absent | None = ABSENT
    parallax: ParallaxReport | None
    warnings: tuple[str, ...]
    seconds: Mapping[str, float]
    predicted_speedup: float
    memory: MemoryReport
    layers: tuple[LayerReport, ...] | Absent = ABSENT
    compare: CompareReport | Absent = ABSENT
    reuse: ReuseReport | Absent = ABSENT
