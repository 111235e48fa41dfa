"""The report of a pair as data: report.json is `as_json` of a `FrameReport`, and docs/report.md explains its keys.

Whoever reads a report later (command line, panels, charts) reads the dict that JSON has, of any version.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from ..matching.matching import Correction
from ..pipeline.next_accuracy import NextAccuracy
from ..trace.fill import FillChoice
from ..views.parallax import ScreenParallax
from .as_json import ABSENT, Absent
from .header import ReportHeader


@dataclass(frozen=True, kw_only=True)
class RefineReport:
    """A render of tiles for which the probes asked: by which fill method, and why by that."""

    method: str
    reason: str


@dataclass(frozen=True, kw_only=True)
class GridReport:
    """Counts of the source grid: its cells, those that are subdivided, and the triangles in all."""

    cells: int
    subdivided: int
    triangles: int


@dataclass(frozen=True, kw_only=True)
class WarpReport:
    """The warp that was asked for ("auto", "numpy" or "gpu"), the one that was used, and the GPU's name, if any."""

    asked: str
    used: str
    gpu: str | None


@dataclass(frozen=True, kw_only=True)
class EffectReport:
    """The cost of an effect, and the error that is left where it is seen.

    by names what calls for the effect. fraction is the share of the target's pixels that was traced because of it.
    excess, with its 95 % interval, is the noise ratio squared less 1; None where no probe tells.
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
    """The noise ratio of the target by its probes, with its 95 % interval, beside what the accuracy promises.

    probes counts those of the tiles that stayed warped; tile_size is in pixels; from_ says where the figures are from.
    """

    noise_ratio: float
    low: float | None
    high: float | None
    excess: float
    promise: float | None
    worst_tiles: float
    worst_tiles_promise: float | None
    kept: bool | None
    probes: int
    tile_size: int | None
    from_: str


@dataclass(frozen=True, kw_only=True)
class NoEstimateReport:
    """The keys of an `EstimateReport` where there is no estimate; from_ says why. The order of the keys is its own."""

    noise_ratio: None = None
    low: None = None
    high: None = None
    excess: None = None
    worst_tiles: None = None
    worst_tiles_promise: None = None
    kept: None = None
    tile_size: None = None
    promise: float | None
    probes: int = 0
    from_: str


@dataclass(frozen=True, kw_only=True)
class ParallaxReport:
    """The parallax of the nearest and the farthest point that the source eye sees."""

    nearest: ScreenParallax
    farthest: ScreenParallax


@dataclass(frozen=True, kw_only=True)
class MemoryReport:
    """Memory of the process in MiB: the most that it held, and what it holds now; None where the system is silent."""

    peak_mb: float | None
    resident_mb: float | None


@dataclass(frozen=True, kw_only=True)
class LayerReport:
    """One of several view layers: the share of its target that was rendered again, its fill method and its seconds."""

    name: str
    rerendered: float
    fill: str
    noise_ratio: float | None
    correction: Correction | None
    seconds: float


@dataclass(frozen=True, kw_only=True)
class CompareReport:
    """The pair against Blender's multiview in the same run.

    The errors are root mean squares after tone mapping; noise_rmse and noise_flip are those of multiview's target eye
    rendered with another seed. no_noise says why there is no ratio to noise; FLIP is None where it is not installed.
    """

    multiview_seconds: float
    speedup: float
    noise_rmse: float
    rmse: float
    noise_ratio: float | None
    worst_tiles: float | None
    no_noise: str | Absent = ABSENT
    flip: float | None
    noise_flip: float | None


@dataclass(frozen=True, kw_only=True)
class FrameReport(ReportHeader):
    """The report of a pair. Seconds are of all view layers, by stage; all else is of the main one.

    fractions are shares of the target's pixels, by the reason why they were traced, and "rerendered" is all of them.
    time_limit, in seconds, and samples_rendered are there where the scene has a time limit; samples_rendered is None
    where nobody knows. layers are there where several view layers are rendered, compare where it was asked for.
    """

    fill: FillChoice
    refine: tuple[RefineReport, ...] | None
    grid: GridReport
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
