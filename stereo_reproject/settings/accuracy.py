"""Accuracy settings: the promise of each, and the thresholds by which pixels are traced to keep it."""

from __future__ import annotations

from dataclasses import dataclass, replace

from .frame import StereoSettings
from .tuning import TUNING

EIGHT_BIT_STEP = 1.0 / 255.0
"""Difference between two neighbouring values of an 8-bit picture."""


@dataclass(frozen=True)
class Accuracy:
    """Thresholds by which pixels are traced, and the noise ratio that is promised.

    silhouette_step: step in disparity, in pixels, from which a depth edge counts. silhouette_radius: number of pixels
    that are traced on either side of it; Cycles' default filter reaches 1.5. colour_tolerance: difference between the
    colours on the two sides, in standard deviations of the picture's noise, below which the edge is left warped.
    promise: greatest noise ratio of the target, by estimate; None makes no promise and no probes. probe_spacing: side
    in pixels of the tiles that have a probe each, see `for_size`. tile_limit: noise ratio above which a single tile is
    traced though the frame as a whole keeps its promise; promises_worst_tiles: True where the promise holds for the
    worst hundredth of the tiles, too. unseen: noise, as a standard deviation after tone mapping, that nobody sees:
    beside less noise than this, a tile's error counts as beside this much.
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
    """Return the accuracy that settings ask for. A tolerance replaces the promise of the setting that promises next
    less."""
    if settings.tolerance is None:
        return SETTINGS[settings.accuracy]
    promised = [accuracy for accuracy in SETTINGS.values() if accuracy.promise is not None]
    looser = [accuracy for accuracy in promised if (accuracy.promise or 0.0) >= settings.tolerance]
    return replace(looser[-1] if looser else promised[0], promise=settings.tolerance)


def for_size(accuracy: Accuracy, pixels: int) -> Accuracy:
    """Return the accuracy for a picture of so many pixels. Tiles of a large picture are larger, because as many probes
    find as much there: see `SettingsTuning`. Where the worst tiles are promised something, nothing changes."""
    if accuracy.promises_worst_tiles:
        return accuracy
    longer = min(max((pixels / TUNING.small_picture_px) ** 0.5, 1.0), TUNING.max_tile_growth)
    return replace(accuracy, probe_spacing=int(longer * accuracy.probe_spacing))


def for_denoised(accuracy: Accuracy) -> Accuracy:
    """Return the accuracy for a denoised picture: an error shows beside less noise, and more probes are needed."""
    spacing = max(round(TUNING.denoised_spacing_ratio * accuracy.probe_spacing), 2)
    limit = accuracy.tile_limit if accuracy.promises_worst_tiles else TUNING.denoised_limit_ratio * accuracy.tile_limit
    return replace(accuracy, probe_spacing=spacing, tile_limit=limit)
