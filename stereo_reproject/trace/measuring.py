"""Measurement of the costs of tracing, from the seconds that the trace renders of a frame took."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from .costs import COST_NAMES, MEASURED, TraceCosts
from .fill import SourceCost
from .tuning import TUNING


@dataclass(frozen=True)
class TraceRender:
    """Measurements of one render that traced pixels.

    method is its fill method. seconds are those of the whole render call, sync_seconds the part of them in which Cycles
    synced the scene. share, 0 to 1, is that of the frame's pixels that it traced: as many traces as the frame has
    pixels are 1. Behind a card it is the share for which the card counts as open (see `open_share`).
    """

    method: str
    seconds: float
    sync_seconds: float
    share: float


def open_share(holes: NDArray[np.bool_], probes: NDArray[np.bool_]) -> float:
    """Return the share of the frame, 0 to 1, for which a card counts as open: as `choose_fill` predicts it.

    holes and probes (H, W) are the pixels of either kind that are traced behind the card. A probe opens it for its
    whole filter. Holes lie together and count as they are: what their rims open besides becomes a part of the cost of
    masked pixels.
    """
    return min(float(np.mean(holes)) + TUNING.card_pixels_per_probe * float(np.mean(probes)), 1.0)


def learned_costs(known: TraceCosts, source: SourceCost, renders: Iterable[TraceRender]) -> TraceCosts:
    """Return the costs that are known after a frame: those before it, moved towards what its trace renders tell.

    source is the measured cost of the frame's source, whose scene was synced anew. The share of a second sync is the
    median over the renders: the first one may also sync what tracing adds to the scene. Of the other costs each render
    tells on top of those before it. A frame moves the costs by `TraceTuning.measured_weight` of the way to what it
    measures, and never beyond their limits. Where no render tells anything, `known` is returned as it is.
    """
    renders = list(renders)
    measured = known
    if renders and _tells_resync(source):
        share = float(np.median([render.sync_seconds for render in renders])) / source.sync_seconds
        measured = replace(known, resync_share=share).within_limits()
    for render in renders:
        measured = _told_by(render, measured, source).within_limits()
    if measured == known:
        return known
    weight = TUNING.measured_weight
    blended = {name: (1.0 - weight) * getattr(known, name) + weight * getattr(measured, name) for name in COST_NAMES}
    return replace(known, **blended, source=MEASURED)


def _told_by(render: TraceRender, known: TraceCosts, source: SourceCost) -> TraceCosts:
    """Return the costs that explain the seconds of one render, as near to the known ones as may be.

    The sync is measured by itself where the first sync was long enough, and its share is known. All other seconds are a
    sum of parts (the call, masked pixels, traced pixels), of which only the sum is measured. Its difference from the
    prediction is divided among the parts by the squares of their predicted seconds, as if each cost were unsure in
    proportion to itself. So a render that traces next to nothing leaves the cost of a pixel as it is.
    """
    amounts = _amounts(render, known, source)
    if not amounts:
        return known
    sync = render.sync_seconds if _tells_resync(source) else known.resync_share * source.sync_seconds
    parts = {name: getattr(known, name) * amount for name, amount in amounts.items()}
    off = render.seconds - sync - sum(parts.values())
    squares = sum(part**2 for part in parts.values())
    moved = {name: (part + off * part**2 / squares) / amounts[name] for name, part in parts.items()}
    return replace(known, **moved)


def _tells_resync(source: SourceCost) -> bool:
    """Return whether the first sync of a source's scene was so long that a second one tells its share."""
    return source.sync_seconds >= TUNING.min_told_sync_seconds


def _amounts(render: TraceRender, known: TraceCosts, source: SourceCost) -> dict[str, float]:
    """Return by the name of a cost the amount by which it is multiplied in the predicted seconds of this render.

    Empty where those tell nothing: of a render of the whole eye, whose seconds are the source's give or take more than
    a call, and of a card so open that its cost is at its limit.
    """
    traced = render.share * source.per_frame
    amounts = {"render_call_seconds": 1.0}
    if render.method == "packed":
        amounts["packed_pixel_cost"] = traced
    elif render.method == "card":
        if known.card_pixel_cost + known.packed_pixel_cost * render.share >= TUNING.max_card_frame_cost:
            return {}
        amounts |= {"card_pixel_cost": source.per_frame, "packed_pixel_cost": traced}
    else:
        return {}
    return {name: amount for name, amount in amounts.items() if amount > 0.0}
