"""Accuracy settings: the promise of each, and the thresholds by which pixels are traced to keep it."""

from __future__ import annotations

from dataclasses import dataclass, replace

from .frame import StereoSettings
from .tuning import TUNING

DISPLAY_STEP = 1.0 / 255.0
"""Display step: the difference between two neighbouring values of an 8-bit picture, after tone mapping of its light as
it is seen."""

ROUNDING_VARIANCE = DISPLAY_STEP**2 / 12.0
"""Variance that rounding to display steps adds to a pixel. Errors are held against no less noise than that, though a
picture that is all but black has less: a display shows nothing finer."""


@dataclass(frozen=True)
class Accuracy:
    """One accuracy setting as numbers: what it promises, and the thresholds by which pixels are traced to keep that.

    silhouette_step: step in disparity, in pixels, from which a depth edge counts. silhouette_radius: number of pixels
    traced on either side of it; Cycles' default filter reaches 1.5.

    colour_tolerance: error of a pixel at an edge, in standard deviations of a single pixel's noise, up to which it is
    left warped. Most pixels beside an edge hardly mix its sides: when all were traced whose sides differed by half a
    deviation, the median had been wrong by a seventh of one (a squared error of 0.02 of the noise). With two, which is
    `balanced`, living-room at 960 x 540 and 64 samples traces 8.7 in place of 11.0 % of its pixels, classroom at 480 x
    270 traces 15.2 in place of 25.2 %, and the honest ratio rises by less than 0.001 and by 0.025. The other settings
    are graded around it. With 0 all pixels beside an edge are traced, whatever they show.

    promise: greatest honest ratio of the target (`images.metrics.honest_ratio`), by estimate; None promises nothing and
    places no probes. probe_spacing: side in pixels of the tiles that have one probe each, in a picture of the size that
    `for_size` starts from. tile_limit: honest ratio above which a tile is traced even if the frame as a whole keeps its
    promise; 1.5 in place of 2 at `balanced` brings glass-vase at 960 x 540 with 64 samples from 1.077 to 1.046, for 1.7
    % of an eye (docs/accuracy.md). promises_worst_tiles: True if the worst tiles must not exceed tile_limit either, and
    no tile may be likely to be wrong (`images.metrics.wrong_tiles`); tiles of 6 pixels have probes enough to tell
    (docs/accuracy.md). unseen_steps: standard deviation of noise, in display steps, that nobody sees; where the picture
    has less noise, a tile's error is compared with this much.
    """

    silhouette_step: float
    silhouette_radius: int
    colour_tolerance: float
    promise: float | None = None
    probe_spacing: int = 12
    tile_limit: float = 2.0
    promises_worst_tiles: bool = False
    unseen_steps: float = 1.0

    @property
    def unseen(self) -> float:
        """Standard deviation of noise that nobody sees, as a difference after tone mapping."""
        return self.unseen_steps * DISPLAY_STEP


SETTINGS: dict[str, Accuracy] = {
    "draft": Accuracy(silhouette_step=1.0, silhouette_radius=1, colour_tolerance=4.0),
    "preview": Accuracy(
        silhouette_step=0.5, silhouette_radius=1, colour_tolerance=3.0, promise=1.25, probe_spacing=18, tile_limit=3.0
    ),
    "balanced": Accuracy(silhouette_step=0.25, silhouette_radius=1, colour_tolerance=2.0, promise=1.1, tile_limit=1.5),
    "high": Accuracy(
        silhouette_step=0.15,
        silhouette_radius=2,
        colour_tolerance=1.0,
        promise=1.05,
        tile_limit=1.5,
        unseen_steps=0.5,
    ),
    "exact": Accuracy(
        silhouette_step=0.1,
        silhouette_radius=2,
        colour_tolerance=0.0,
        promise=1.02,
        probe_spacing=6,
        tile_limit=1.2,
        promises_worst_tiles=True,
        unseen_steps=0.0,
    ),
}


def accuracy_of(settings: StereoSettings) -> Accuracy:
    """Return the accuracy that the settings ask for: the named one or, where a tolerance is given, a named one with the
    tolerance in place of its promise. That is the strictest setting whose promised honest ratio is not below the
    tolerance, or `preview` where all are below it."""
    if settings.tolerance is None:
        return SETTINGS[settings.accuracy]
    promised = [accuracy for accuracy in SETTINGS.values() if accuracy.promise is not None]
    looser = [accuracy for accuracy in promised if (accuracy.promise or 0.0) >= settings.tolerance]
    return replace(looser[-1] if looser else promised[0], promise=settings.tolerance)


def for_size(accuracy: Accuracy, pixels: int) -> Accuracy:
    """Return the accuracy for a picture of `pixels` pixels in all. Tiles are larger in larger pictures, within limits
    (see `SettingsTuning`), because as many probes find as much there. An accuracy that promises something of the worst
    tiles stays as it is."""
    if accuracy.promises_worst_tiles:
        return accuracy
    least, most = TUNING.tile_scale_limits
    scale = min(max((pixels / TUNING.unscaled_picture_px) ** 0.5, least), most)
    return replace(accuracy, probe_spacing=round(scale * accuracy.probe_spacing))


def for_denoised(accuracy: Accuracy) -> Accuracy:
    """Return the accuracy for a denoised picture, to be applied after `for_size`. Errors are seen more easily there, so
    that tiles are smaller and probes more, and all pixels beside an edge are traced (measured on living-room, classroom
    and bathroom: docs/production.md); the limit for one tile is wider, because the estimate is noisier."""
    spacing = max(round(TUNING.denoised_spacing_ratio * accuracy.probe_spacing), TUNING.min_denoised_spacing_px)
    limit = accuracy.tile_limit if accuracy.promises_worst_tiles else TUNING.denoised_limit_ratio * accuracy.tile_limit
    return replace(accuracy, probe_spacing=spacing, tile_limit=limit, colour_tolerance=0.0)
