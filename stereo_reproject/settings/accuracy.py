"""What an accuracy setting promises, and what it has traced for that."""

from __future__ import annotations

from dataclasses import dataclass, replace

from .frame import StereoSettings
from .tuning import TUNING

EIGHT_BIT_STEP = 1.0 / 255.0
"""Difference between two neighbouring values of an 8-bit picture."""


@dataclass(frozen=True)
class Accuracy:
    """How wide a silhouette is traced, and how alike its two sides may be to be left alone.

    silhouette_step: step in disparity, in pixels, from which a depth edge counts. silhouette_radius: how many
    pixels on either side of it are traced; Cycles' default filter reaches 1.5. colour_tolerance: difference between
    the colours on the two sides, in standard deviations of the picture's noise, below which the edge is left
    warped. promise: the noise ratio that the target is to have at most, by estimate; None makes no promise and no
    probes. probe_spacing: pixels along the side of the tiles that have a probe each, see `for_size`. tile_limit:
    the noise ratio above which a single tile is traced though the frame as a whole keeps its promise;
    promises_worst_tiles: whether that is promised too, of the worst hundredth of the tiles. unseen: noise, as a
    standard deviation after tone mapping, that nobody sees: a tile's error is no worse for being large beside less.
    """

    silhouette_step: float
    silhouette_radius: int
    colour_tolerance: float
    promise: float | None = None
    probe_spacing: int = 8
    tile_limit: float = 2.0
    promises_worst_tiles: bool = False
    unseen: float = EIGHT_BIT_STEP


SETTINGS: dict[str, Accuracy] = {
    "draft": Accuracy(silhouette_step=1.0, silhouette_radius=1, colour_tolerance=1.0),
    "preview": Accuracy(
        silhouette_step=0.5, silhouette_radius=1, colour_tolerance=0.75, promise=1.25, probe_spacing=12, tile_limit=3.0
    ),
    "balanced": Accuracy(silhouette_step=0.25, silhouette_radius=1, colour_tolerance=0.5, promise=1.1),
    "high": Accuracy(
        silhouette_step=0.15,
        silhouette_radius=2,
        colour_tolerance=0.35,
        promise=1.05,
        tile_limit=1.5,
        unseen=0.5 * EIGHT_BIT_STEP,
    ),
    "exact": Accuracy(
        silhouette_step=0.1,
        silhouette_radius=2,
        colour_tolerance=0.0,
        promise=1.02,
        tile_limit=1.2,
        promises_worst_tiles=True,
        unseen=0.0,
    ),
}


def accuracy_of(settings: StereoSettings) -> Accuracy:
    """What these settings ask for. A tolerance takes all else from the setting that promises next less."""
    if settings.tolerance is None:
        return SETTINGS[settings.accuracy]
    promised = [accuracy for accuracy in SETTINGS.values() if accuracy.promise is not None]
    looser = [accuracy for accuracy in promised if (accuracy.promise or 0.0) >= settings.tolerance]
    return replace(looser[-1] if looser else promised[0], promise=settings.tolerance)


def for_size(accuracy: Accuracy, pixels: int) -> Accuracy:
    """The same for a picture of so many pixels: from PROBED_PIXELS on, as many probes find as much.

    Up to LONGEST times the side of a tile; not where the worst tiles are promised something.
    """
    if accuracy.promises_worst_tiles:
        return accuracy
    longer = min(max((pixels / TUNING.small_picture_px) ** 0.5, 1.0), TUNING.max_tile_growth)
    return replace(accuracy, probe_spacing=int(longer * accuracy.probe_spacing))


def for_denoised(accuracy: Accuracy) -> Accuracy:
    """The same for a picture that is denoised: an error shows beside less noise, and more probes are needed for it."""
    spacing = max(round(TUNING.denoised_spacing_ratio * accuracy.probe_spacing), 2)
    limit = accuracy.tile_limit if accuracy.promises_worst_tiles else TUNING.denoised_limit_ratio * accuracy.tile_limit
    return replace(accuracy, probe_spacing=spacing, tile_limit=limit)
