"""The figures of an animation's frames, as its chart draws them: in equal steps, with what is missing as a gap."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from numbers import Real
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..pipeline.stages import Stage
from .report import views_in

STAGES = {
    "source": (Stage.SOURCE,),
    "tracing": (Stage.PILOT, Stage.FILL, Stage.REFINE),
    "denoising": (Stage.DENOISE_SOURCE, Stage.DENOISE_TARGET),
}
"""Parts of a frame's seconds in the chart, and the stages of a report that belong to each."""
REST = "the rest"
"""Name of the part of a frame's seconds that is in no stage above."""
REFERENCE, PLAIN = "multiview", "plain renders"
"""Names of what pairs, and mono frames, are held against."""


@dataclass(frozen=True)
class Series:
    """The figures of an animation's N frames, in equal steps, for its chart; NaN where a figure is missing.

    frames (N,) are the frame numbers from the first to the last, each `step` after the one before, also those that were
    not rendered; there (N,) is True for those that were. seconds (N,) are those of the whole frame, stages (N,) those
    of each kind of stage. measured and predicted (N,) are the seconds of Blender's multiview, or of what reference
    names. traced (N,) is the share of the target's pixels that was traced.
    """

    frames: NDArray[np.int64]
    step: int
    there: NDArray[np.bool_]
    seconds: NDArray[np.float64]
    stages: Mapping[str, NDArray[np.float64]]
    measured: NDArray[np.float64]
    predicted: NDArray[np.float64]
    traced: NDArray[np.float64]
    reference: str


def series_of(report: Mapping[str, Any]) -> Series:
    """Return the figures of all frames in a report, the content of animation.json; frames that were asked for but not
    rendered are gaps."""
    rows = {row["frame"]: row for row in report["frames"]}
    known = sorted({*rows, *(report.get("asked_for") or ())})
    # Frames may be rendered in steps. What one run was asked for need not be in step with what another one was.
    step = math.gcd(*(frame - known[0] for frame in known)) or 1
    frames = np.arange(known[0], known[-1] + 1, step)
    slots: list[Mapping[str, Any]] = [rows.get(frame, {}) for frame in frames.tolist()]
    stages = [_stages_of(row) for row in slots]
    return Series(
        frames=frames,
        step=step,
        there=np.array([bool(row) for row in slots]),
        seconds=np.array([number_in(row, "wall_seconds") for row in slots]),
        stages={name: np.array([row[name] for row in stages]) for name in (*STAGES, REST)},
        measured=np.array([number_in(row, "compare", "multiview_seconds") for row in slots]),
        predicted=np.array([number_in(row, "multiview_seconds") for row in slots]),
        traced=np.array([number_in(row, "fractions", "rerendered") for row in slots]),
        reference=PLAIN if views_in(report["frames"]) == 1 else REFERENCE,
    )


def number_in(row: Mapping[str, Any], *keys: str) -> float:
    """Return the number in a row under these keys, the second inside the first; NaN where there is none or it is not
    finite."""
    value: Any = row
    for key in keys:
        value = value.get(key) if isinstance(value, Mapping) else None
    try:
        number = float(value) if isinstance(value, Real) else math.nan
    except OverflowError:
        # Whole numbers may be larger.
        return math.nan
    return number if math.isfinite(number) else math.nan


def _stages_of(row: Mapping[str, Any]) -> dict[str, float]:
    """Return the seconds of one frame for each kind of stage; all NaN for a frame without figures."""
    if not row.get("seconds"):
        return dict.fromkeys((*STAGES, REST), math.nan)
    seconds = {
        name: sum(_or_nothing(number_in(row, "seconds", stage)) for stage in parts) for name, parts in STAGES.items()
    }
    rest = number_in(row, "wall_seconds") - sum(seconds.values())
    return {**seconds, REST: max(_or_nothing(rest), 0.0)}


def _or_nothing(value: float) -> float:
    """Return a number, or 0 for NaN."""
    return 0.0 if math.isnan(value) else value


def mean_of(values: NDArray) -> float | None:
    """Return the mean of the finite numbers in an array; None where there are none."""
    known = values[np.isfinite(values)]
    return float(known.mean()) if known.size else None
