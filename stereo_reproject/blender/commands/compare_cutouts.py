"""The comparison with multiview in the cut-outs of a panorama, which is what a headset shows of it.

A cut-out is a resampled picture, and interpolation between pixels takes noise away and makes neighbours alike: more so
where the pixels were interpolated before, by the warp. So the ratios to noise are of the nearest pixels: each keeps all
its noise, for the pair and for both of multiview's renders alike, and the ratios hold as they do for the whole picture,
with other weights. FLIP is of pictures as they are seen, interpolated; it too gets all three in the same way.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...images.cutouts import CutoutPixels, cutout_pixels
from ...images.metrics import honest_ratio, noise_ratio, weighted_mean
from ...report.frame_report import CutoutReport
from ...views.camera import Camera
from ...views.cutouts import Cutout, cutouts_of, natural_size
from ...views.panorama import PanoramicCamera
from ...views.solid_angle import PixelWeight

Picture = NDArray[np.float32]


@dataclass(frozen=True)
class SeenPictures:
    """The target eye as people see it, (H, W, 3) from 0 to 1: ours, multiview's, and multiview's with another seed.
    weight is that of its pixels (`views/solid_angle`)."""

    ours: Picture
    reference: Picture
    again: Picture
    weight: PixelWeight

    def flips(self, pixels: CutoutPixels | None = None) -> tuple[float, float]:
        """Return the mean FLIP error of ours and of the repeated render, each against the reference: of the whole
        picture, each pixel by its weight; with pixels that of their cut-out, over what the panorama shows there, where
        all count alike. Raises ImportError unless `has_flip`."""
        reference = _cut(self.reference, pixels)
        shown, weight = (slice(None), self.weight) if pixels is None else (pixels.shown, 1.0)
        ours, again = (_flip(reference, _cut(picture, pixels))[shown] for picture in (self.ours, self.again))
        return weighted_mean(ours, weight), weighted_mean(again, weight)


def has_flip() -> bool:
    """Return whether FLIP can be had: it is installed, and its own parts are there too."""
    try:
        import flip_evaluator  # noqa: F401
    except ImportError:
        return False
    return True


def _cut(picture: Picture, pixels: CutoutPixels | None) -> Picture:
    """Return a picture as it is, or its cut-out."""
    return np.ascontiguousarray(picture if pixels is None else pixels.linear(picture))


def _flip(reference: Picture, test: Picture) -> Picture:
    """Return the FLIP error (H, W) of a picture (H, W, 3) against a reference. Raises ImportError."""
    import flip_evaluator

    errors = flip_evaluator.evaluate(reference, test, "LDR", applyMagma=False, computeMeanError=False)[0]
    return np.asarray(errors, np.float32).reshape(reference.shape[:2])


def compare_cutouts(
    camera: Camera | None,
    pictures: tuple[Picture, Picture, Picture],
    variance_share: Picture,
    seen: SeenPictures | None,
    *,
    has_noise: bool,
) -> tuple[CutoutReport, ...]:
    """Return how a panorama's cut-outs compare with multiview's: none for a camera that is no panorama.

    camera is that of the pictures (H, W, 4): ours, multiview's, and multiview's with another seed, scene-linear and
    with their light as it is seen. variance_share (H, W) is that of the frame; seen is None where FLIP cannot
    be had. has_noise is False where multiview has none to hold errors against.
    """
    cutouts = cutouts_of(camera)
    if not isinstance(camera, PanoramicCamera) or not cutouts:
        return ()
    size = natural_size(camera)
    return tuple(
        _compared(cutout, cutout_pixels(camera, cutout, size), pictures, variance_share, seen, has_noise=has_noise)
        for cutout in cutouts
    )


def _compared(
    cutout: Cutout,
    pixels: CutoutPixels,
    pictures: Iterable[Picture],
    variance_share: Picture,
    seen: SeenPictures | None,
    *,
    has_noise: bool,
) -> CutoutReport:
    """Return how one cut-out compares with multiview's; the parameters are those of `compare_cutouts`."""
    ours, reference, again, share = (pixels.nearest(part)[pixels.shown][None] for part in (*pictures, variance_share))
    flip, noise_flip = (None, None) if seen is None else seen.flips(pixels)
    return CutoutReport(
        name=cutout.name,
        left_degrees=cutout.left_degrees,
        up_degrees=cutout.up_degrees,
        size=pixels.x.shape[0],
        honest_ratio=honest_ratio(ours, reference, again, share) if has_noise else None,
        noise_ratio=noise_ratio(ours, reference, again) if has_noise else None,
        flip=flip,
        noise_flip=noise_flip,
        flip_ratio=flip / noise_flip if flip is not None and noise_flip and has_noise else None,
    )
