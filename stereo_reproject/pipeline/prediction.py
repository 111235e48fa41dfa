"""Prediction of a pair's seconds before it is rendered, from a sketch of it: a small render with few samples.

Which pixels the probes will have traced is not known beforehand. So the prediction is a range: from the holes and
probes alone to all pixels that may look different from each eye.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..images.effects import SEEN_DIFFERENTLY, WHOLE_FRAME_EFFECTS, Effect
from ..images.reasons import Reason
from ..settings.accuracy import Accuracy
from ..trace.costs import TraceCosts
from ..trace.fill import FillChoice, SourceCost
from ..trace.planner import FillPlanner


@dataclass(frozen=True)
class Sketch:
    """Measurements of two small renders of the source, the first with a few samples, the second with a few more.

    pixels is the number of pixels of either; samples (per pixel), seconds and sync_seconds (a part of seconds) are
    those of the first and of the second.
    """

    pixels: int
    samples: tuple[int, int]
    seconds: tuple[float, float]
    sync_seconds: tuple[float, float]


@dataclass(frozen=True)
class HoleShares:
    """Predicted shares of the target's pixels, 0 to 1, that are holes: by reason, and in total."""

    disoccluded: float
    outside: float
    silhouette: float
    total: float
    beforehand: float = 0.0
    """Share of pixels that are not to be warped: blurred edges, volumes before the sky, contrast behind glass."""


@dataclass(frozen=True)
class Prediction:
    """Predicted seconds and shares of a frame that is not rendered yet.

    source is the cost of the source render; warp and fill_seconds are seconds; refine is the least and the most seconds
    of refining. probes is the number of probe traces, and called_for that of pixels that may look different from each
    eye; both are shares of the target's pixels and leave holes out. fill is the method by which holes are expected to
    be traced, costs are those of tracing by which it is chosen.
    """

    source: SourceCost
    warp: float
    holes: HoleShares
    probes: float
    called_for: float
    fill: FillChoice
    costs: TraceCosts
    fill_seconds: float
    refine: tuple[float, float]

    @property
    def multiview(self) -> float:
        """Seconds of Blender's own multiview, which renders both eyes, denoises both, and syncs the scene once."""
        return self.source.seconds + self.source.per_frame + self.denoise

    @property
    def denoise(self) -> float:
        """Seconds that it takes to denoise both eyes."""
        return 2.0 * self.source.denoise_seconds

    @property
    def total(self) -> tuple[float, float]:
        """Least and most seconds of the pair: without any refining, and with all that may be called for."""
        least = self.source.seconds + self.denoise + self.warp + self.fill_seconds
        return least + self.refine[0], least + self.refine[1]

    @property
    def gain(self) -> tuple[float, float]:
        """Least and greatest speed-up over Blender's multiview; above 1 is faster."""
        least, most = self.total
        return self.multiview / most, self.multiview / least


def sketch_accuracy(accuracy: Accuracy, scale: float) -> Accuracy:
    """Return the accuracy with which a sketch is warped to count the holes of the picture; scale is its width over the
    picture's.

    The step in disparity that counts is made smaller by scale, as steps are in the sketch's pixels. All silhouettes
    count, also those that look alike on both sides: to tell them, the noise must be the picture's, and the sketch's is
    not.
    """
    return replace(accuracy, silhouette_step=accuracy.silhouette_step * scale, colour_tolerance=0.0)


def predict_samples(sketch: Sketch, pixels: int, samples: int, limit: float) -> int:
    """Return the samples per pixel that a source of `pixels` pixels gets within `limit` seconds: from 1 to `samples`.

    A limit of 0 or less is none.
    """
    per_sample = _sample_seconds(sketch) * pixels
    return samples if limit <= 0.0 or per_sample * samples <= limit else max(int(limit / per_sample), 1)


def _sample_seconds(sketch: Sketch) -> float:
    """Return the seconds that one sample of one pixel takes, from the two renders of the sketch."""
    first, second = (s - sync for s, sync in zip(sketch.seconds, sketch.sync_seconds, strict=True))
    few, more = sketch.samples
    per_sample = (second - first) / (sketch.pixels * (more - few))
    # Without a difference, samples are lost among what a call costs anyway: all of it is a safe guess.
    return per_sample if per_sample > 0.0 else max(second, 0.0) / (sketch.pixels * more)


def predict_source(sketch: Sketch, pixels: int, samples: int) -> SourceCost:
    """Return the predicted cost of the source at its full size of `pixels` pixels, with `samples` samples each.

    Seconds that do not depend on samples stay as they are in the sketch; those of samples grow with their number.
    """
    per_sample = _sample_seconds(sketch)
    first = sketch.seconds[0] - sketch.sync_seconds[0]
    fixed = max(first - per_sample * sketch.pixels * sketch.samples[0], 0.0)
    sync = sketch.sync_seconds[0]
    return SourceCost(sync + fixed + per_sample * pixels * samples, sync)


def predict_holes(reasons: NDArray[np.uint16], scale: float) -> HoleShares:
    """Return the shares of holes at the picture's size, from the sketch's `reasons.Reason` flags (H, W).

    scale is the sketch's width over the picture's. Areas keep their share of the picture; a band along silhouettes
    keeps its width in pixels, so that its share shrinks by scale.
    """
    lost = (reasons & (Reason.DISOCCLUDED.bit | Reason.OUTSIDE.bit)) > 0
    edges = (reasons & Reason.SILHOUETTE.bit) > 0
    band = scale * float(np.mean(edges & ~lost))
    known = (reasons & (Reason.DEFOCUS.bit | Reason.VOLUME.bit | Reason.TRANSPARENT.bit)) > 0
    beforehand = float(np.mean(known & ~lost & ~edges))
    shares = [float(np.mean((reasons & reason.bit) > 0)) for reason in (Reason.DISOCCLUDED, Reason.OUTSIDE)]
    return HoleShares(shares[0], shares[1], band, min(float(np.mean(lost)) + band + beforehand, 1.0), beforehand)


def effect_shares(called_for: Effect, flags: NDArray | None) -> dict[Effect, float]:
    """Return the share of the picture, 0 to 1, in which each effect that is called for may be seen.

    flags (H, W) are the `Effect` flags of the sketch; without them an effect may be anywhere, and its share is 1.
    """
    return {effect: _share(effect, flags) for effect in called_for & SEEN_DIFFERENTLY}


def _share(effects: Effect, flags: NDArray | None) -> float:
    """Return the share of the picture, 0 to 1, in which any of the effects may be seen; 1 where that is not known.

    flags are as for `effect_shares`. Effects of the whole frame have 1 too.
    """
    if flags is None or effects & WHOLE_FRAME_EFFECTS:
        return 1.0
    return float(np.mean((flags.astype(np.int32) & effects.value) > 0))


def shown_differently(called_for: Effect, flags: NDArray | None) -> float:
    """Return the share of the picture, 0 to 1, that may look different from each eye; flags as for `effect_shares`."""
    differently = called_for & SEEN_DIFFERENTLY
    return _share(differently, flags) if differently else 0.0


def predict(
    planner: FillPlanner, warp_seconds: float, holes: HoleShares, accuracy: Accuracy, shown: float
) -> Prediction:
    """Return the prediction of a frame at a given accuracy.

    planner chooses fill methods, by the predicted cost of the source render. warp_seconds are those of the warp, holes
    the shares to be traced. shown is the share of the picture that may look different from each eye.
    """
    cost, fill = planner.cost, planner.plan(holes.total)
    rest = 1.0 - holes.total
    if fill.method == "full" or accuracy.promise is None or shown == 0.0:
        probes, filled, refine = 0.0, fill, 0.0
    else:
        probes = 2.0 * rest / planner.spacing(fill.method, accuracy.probe_spacing) ** 2
        filled = replace(planner, asked=fill.method).plan(holes.total, spacing=accuracy.probe_spacing)
        refine = planner.plan(shown * rest).predicted_seconds
    return Prediction(
        source=cost,
        warp=warp_seconds,
        holes=holes,
        probes=probes,
        called_for=shown * rest,
        fill=fill,
        costs=planner.costs,
        fill_seconds=filled.predicted_seconds,
        refine=(0.0, refine),
    )


def prediction_fields(prediction: Prediction, rests_on: str) -> dict[str, Any]:
    """Return a prediction as an object of report.json; rests_on says in words which measurements it comes from."""
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
            "costs": asdict(prediction.costs),
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
