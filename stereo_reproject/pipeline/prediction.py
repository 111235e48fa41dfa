"""What a pair will cost before it is rendered, from a sketch of it: small, with few samples.

What probes will ask for is not known beforehand. So the prediction is a range: from the holes and probes alone to all
that is called for and may be seen differently by each eye.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..images.effects import OF_THE_WHOLE_FRAME, SEEN_DIFFERENTLY, Effect
from ..images.reasons import Reason
from ..settings.accuracy import Accuracy
from ..trace.fill import FillChoice, SourceCost, choose_fill
from ..trace.planner import FillPlanner


@dataclass(frozen=True)
class Sketch:
    """Two renders of the source eye as a sketch, of `pixels` each, with a few samples and a few more.

    samples, seconds and sync_seconds are of the first and the second.
    """

    pixels: int
    samples: tuple[int, int]
    seconds: tuple[float, float]
    sync_seconds: tuple[float, float]


@dataclass(frozen=True)
class Holes:
    """Shares of the target's pixels by reason, and of all that are holes, at the picture's own size."""

    disoccluded: float
    outside: float
    silhouette: float
    total: float
    beforehand: float = 0.0
    """Of what the sketch shows to be beyond a warp: blurred edges, volumes before the sky, contrast behind glass."""


@dataclass(frozen=True)
class Prediction:
    """Seconds and shares that are predicted; total, refine and gain are (least, most)."""

    source: SourceCost
    warp: float
    holes: Holes
    probes: float
    called_for: float
    fill: FillChoice
    fill_seconds: float
    refine: tuple[float, float]

    @property
    def multiview(self) -> float:
        """Blender's own multiview renders both eyes, denoises both, and syncs the scene once."""
        return self.source.seconds + self.source.per_frame + self.denoise

    @property
    def denoise(self) -> float:
        """Of both eyes."""
        return 2.0 * self.source.denoise_seconds

    @property
    def total(self) -> tuple[float, float]:
        least = self.source.seconds + self.denoise + self.warp + self.fill_seconds
        return least + self.refine[0], least + self.refine[1]

    @property
    def gain(self) -> tuple[float, float]:
        least, most = self.total
        return self.multiview / most, self.multiview / least


def sketch_accuracy(accuracy: Accuracy, scale: float) -> Accuracy:
    """The accuracy with which a sketch is warped to count the holes of a picture 1 / scale times as wide.

    Steps in disparity are as much smaller in pixels. The sketch's noise tells nothing about which silhouettes look the
    same on both sides: all are counted.
    """
    return replace(accuracy, silhouette_step=accuracy.silhouette_step * scale, colour_tolerance=0.0)


def predict_samples(sketch: Sketch, pixels: int, samples: int, limit: float) -> int:
    """Return the samples, at most `samples`, that the source eye comes to in `limit` seconds (0: in any time)."""
    per_sample = _sample_seconds(sketch) * pixels
    return samples if limit <= 0.0 or per_sample * samples <= limit else max(int(limit / per_sample), 1)


def _sample_seconds(sketch: Sketch) -> float:
    """Seconds of a sample of a pixel."""
    first, second = (s - sync for s, sync in zip(sketch.seconds, sketch.sync_seconds, strict=True))
    few, more = sketch.samples
    per_sample = (second - first) / (sketch.pixels * (more - few))
    # Else it is lost among what a call costs anyway.
    return per_sample if per_sample > 0.0 else max(second, 0.0) / (sketch.pixels * more)


def predict_source(sketch: Sketch, pixels: int, samples: int) -> SourceCost:
    """The cost of the source eye at its own size: what a call takes apart from its samples stays, samples add up."""
    per_sample = _sample_seconds(sketch)
    first = sketch.seconds[0] - sketch.sync_seconds[0]
    fixed = max(first - per_sample * sketch.pixels * sketch.samples[0], 0.0)
    sync = sketch.sync_seconds[0]
    return SourceCost(sync + fixed + per_sample * pixels * samples, sync)


def predict_holes(reasons: NDArray[np.uint16], scale: float) -> Holes:
    """Shares at the picture's size, from the sketch's `reasons.Reason` flags (H, W).

    What is disoccluded, outside or known beforehand to be beyond a warp keeps its share of the picture; a band along
    silhouettes keeps its pixels.
    """
    lost = (reasons & (Reason.DISOCCLUDED.bit | Reason.OUTSIDE.bit)) > 0
    edges = (reasons & Reason.SILHOUETTE.bit) > 0
    band = scale * float(np.mean(edges & ~lost))
    known = (reasons & (Reason.DEFOCUS.bit | Reason.VOLUME.bit | Reason.TRANSPARENT.bit)) > 0
    beforehand = float(np.mean(known & ~lost & ~edges))
    shares = [float(np.mean((reasons & reason.bit) > 0)) for reason in (Reason.DISOCCLUDED, Reason.OUTSIDE)]
    return Holes(shares[0], shares[1], band, min(float(np.mean(lost)) + band + beforehand, 1.0), beforehand)


def effect_shares(called_for: Effect, flags: NDArray | None) -> dict[Effect, float]:
    """Share of the picture in which each effect that is called for may be seen; flags (H, W) are of the sketch.

    Without flags, nobody knows where: all of it.
    """
    return {effect: _share(effect, flags) for effect in called_for & SEEN_DIFFERENTLY}


def _share(effects: Effect, flags: NDArray | None) -> float:
    if flags is None or effects & OF_THE_WHOLE_FRAME:
        return 1.0
    return float(np.mean((flags.astype(np.int32) & effects.value) > 0))


def shown_differently(called_for: Effect, flags: NDArray | None) -> float:
    """Share of the picture in which anything may look different from each eye."""
    differently = called_for & SEEN_DIFFERENTLY
    return _share(differently, flags) if differently else 0.0


def predict(
    cost: SourceCost,
    warp_seconds: float,
    holes: Holes,
    accuracy: Accuracy,
    asked: str,
    blockers: Mapping[str, str | None],
    shown: float,
) -> Prediction:
    """The way of a frame, in predicted seconds; shown is the share of the picture that may be seen differently."""
    fill = choose_fill(asked, holes.total, cost, blockers)
    rest = 1.0 - holes.total
    if fill.method == "full" or accuracy.promise is None or shown == 0.0:
        return Prediction(cost, warp_seconds, holes, 0.0, shown * rest, fill, fill.predicted_seconds, (0.0, 0.0))
    probes = 2.0 * rest / FillPlanner.spacing(fill.method, accuracy.probe_spacing) ** 2
    filled = choose_fill(fill.method, holes.total, cost, blockers, spacing=accuracy.probe_spacing)
    traced = filled.predicted_seconds
    refine = choose_fill(asked, shown * rest, cost, blockers).predicted_seconds
    return Prediction(cost, warp_seconds, holes, probes, shown * rest, fill, traced, (0.0, refine))


def prediction_fields(prediction: Prediction, rests_on: str) -> dict[str, Any]:
    """A prediction as JSON has it; rests_on says in words what it was drawn from."""
    holes = prediction.holes
    least, most = prediction.total
    low, high = prediction.gain
    return {
        "rests_on": rests_on,
        "source_seconds": prediction.source.seconds,
        "denoise_seconds": prediction.denoise,
        "warp_seconds": prediction.warp,
        "fill": {
            "method": prediction.fill.method,
            "reason": prediction.fill.reason,
            "seconds": prediction.fill_seconds,
        },
        "refine_seconds": {"low": prediction.refine[0], "high": prediction.refine[1]},
        "total_seconds": {"low": least, "high": most},
        "multiview_seconds": prediction.multiview,
        "gain": {"low": low, "high": high},
        "fractions": {
            "disoccluded": holes.disoccluded,
            "outside": holes.outside,
            "silhouette": holes.silhouette,
            "beforehand": holes.beforehand,
            "holes": holes.total,
            "probes": prediction.probes,
            "called_for": prediction.called_for,
        },
    }
