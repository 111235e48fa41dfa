"""The sheet of a panorama's cut-outs: both eyes and the traced pixels as a headset shows them, in perspective."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from ...images.bands import over_bands
from ...images.cutouts import CutoutPixels, block_mean, cutout_pixels
from ...images.exr import VIEWS
from ...images.png import write_png
from ...images.reasons import Reason
from ...pipeline.stereo_frame import StereoFrame, colour
from ...views.cutouts import Cutout, cutouts_of, natural_size
from ...views.panorama import PanoramicCamera
from .delivery import deliver_side_by_side
from .pictures import (
    coloured_holes,
    display,
    drawn,
    legend_below,
    legend_of_holes,
    read_png,
    shares_by_reason,
    text_scale,
)

SIZES_PX = (192, 640)
"""Least and greatest width of a cut-out in the sheet: of less its title has no room, and five of more are wider than
a screen can be."""

TIMES = 2
"""Places across and down whose mean is a pixel of the sheet, where the panorama has pixels enough. A larger panorama is
made smaller first, so that these places lie at most a pixel apart and miss none."""

Eyes = Mapping[str, NDArray[np.float32]]
"""Scene-linear pictures (h, w, 4) of both eyes, by view."""

Shown = Mapping[str, NDArray[np.uint8]]
"""Pictures (h, w, 3) of both eyes in bytes, by view."""

GAP_PX = 6
BACKGROUND = 24


@dataclass(frozen=True)
class SheetCutout:
    """A cut-out of the sheet, of size x size pixels, each the mean of times x times places in the panorama, whose
    pictures are made smaller before by a `block_mean` of coarser times.

    Places are looked up a few rows at a time: those of a whole cut-out would take more memory than its picture.
    """

    camera: PanoramicCamera
    cutout: Cutout
    size: int
    times: int
    coarser: int

    def seen(self, picture: NDArray[np.float32], *, interpolated: bool) -> NDArray[np.float32]:
        """Return the cut-out (S, S, C) of a panorama's picture, which was made smaller: with places interpolated
        between its pixels, or of the nearest ones."""
        result = np.empty((self.size, self.size, picture.shape[-1]), np.float32)

        def work(rows: slice) -> None:
            pixels = self._pixels(rows, self.coarser)
            places = pixels.linear(picture) if interpolated else pixels.nearest(picture)
            result[rows] = block_mean(places, self.times)

        over_bands(self._places, work)
        return result

    def shares(self, reasons: NDArray[np.uint16]) -> dict[Reason, float]:
        """Return the share of the cut-out that has each reason; reasons (H, W) are the panorama's."""
        side = self.size * self.times
        flags = np.empty((side, side), np.uint16)

        def work(rows: slice) -> None:
            flags[self.times * rows.start : self.times * rows.stop] = self._pixels(rows, 1).nearest(reasons)

        over_bands(self._places, work)
        return shares_by_reason(flags)

    @property
    def _places(self) -> tuple[int, int]:
        """Rows of the cut-out, and places in each."""
        return self.size, self.size * self.times**2

    def _pixels(self, rows: slice, coarser: int) -> CutoutPixels:
        """Return the places of these rows of the cut-out, in a picture that was made smaller so many times."""
        places = slice(self.times * rows.start, self.times * rows.stop)
        return cutout_pixels(self.camera, self.cutout, self.size * self.times, places, coarser=coarser)


def sheet_cutouts(camera: PanoramicCamera) -> list[SheetCutout]:
    """Return the cut-outs of a panorama, all of one size; empty where there are none."""
    cutouts = cutouts_of(camera)
    if not cutouts:
        return []
    natural = natural_size(camera)
    size = int(np.clip(natural, *SIZES_PX))
    times = TIMES if natural > size else 1
    coarser = math.ceil(natural / (size * times))
    return [SheetCutout(camera, cutout, size, times, coarser) for cutout in cutouts]


def in_plain_tones(pictures: Eyes) -> Shown:
    """Return scene-linear pictures as bytes, by the tone mapping of `display`."""
    return {view: display(picture) for view, picture in pictures.items()}


def by_view_transform(scene: bpy.types.Scene, path: Path, frame: int) -> Callable[[Eyes], Shown]:
    """Return a function that returns scene-linear pictures of both eyes as bytes, by the scene's view transform at a
    frame, before its compositor. path takes a PNG of them meanwhile; the function raises StereoReprojectError."""

    def shown(pictures: Eyes) -> Shown:
        deliver_side_by_side(scene, pictures, path, frame=frame)
        both = np.split(np.round(255.0 * read_png(path)).astype(np.uint8), 2, axis=1)
        return dict(zip(VIEWS, both, strict=True))

    return shown


def write_cutouts(
    path: Path,
    frame: StereoFrame,
    target: str,
    *,
    shown: Callable[[Eyes], Shown] = in_plain_tones,
    with_legend: bool = True,
) -> None:
    """Write a PNG with the cut-outs of a panorama beside each other: in the first row the left eye's, below them the
    right eye's, then the traced pixels of the target, which is the eye of that name, in the colours of `write_holes`.

    shown returns scene-linear pictures (h, w, 4) of both eyes as bytes (h, w, 3). Without the legend all frames of an
    animation have a picture of one size. Raises BadInputError, and the errors of shown.
    """
    camera = frame.camera
    assert isinstance(camera, PanoramicCamera)
    cutouts = sheet_cutouts(camera)
    coarser = cutouts[0].coarser
    smaller = (block_mean(colour(frame.eyes[view]), coarser) for view in VIEWS)
    eyes = shown({view: _row(cutouts, eye, interpolated=True) for view, eye in zip(VIEWS, smaller, strict=True)})
    traced = _smaller_holes(colour(frame.eyes[target]), frame.reasons, coarser)
    holes = _row(cutouts, traced, interpolated=False).astype(np.uint8)
    pictures = {f"{view.capitalize()} eye": eyes[view] for view in VIEWS}
    pictures[f"Traced pixels of the {target} eye"] = holes
    rows = {name: np.split(picture, len(cutouts), axis=1) for name, picture in pictures.items()}
    sheet = _sheet(path, [cutout.cutout.title for cutout in cutouts], rows)
    if with_legend:
        legend = legend_of_holes(_mean_shares([cutout.shares(frame.reasons) for cutout in cutouts]))
        sheet = np.concatenate([sheet, legend_below(path, legend, sheet.shape[1])])
    write_png(path, sheet)


def _row(cutouts: Sequence[SheetCutout], picture: NDArray[np.float32], *, interpolated: bool) -> NDArray[np.float32]:
    """Return the cut-outs (S, S, C) of a panorama's picture (h, w, C), which was made smaller, beside each other, as
    `SheetCutout.seen` has them."""
    size = cutouts[0].size
    result = np.empty((size, size * len(cutouts), picture.shape[-1]), np.float32)
    for k, cutout in enumerate(cutouts):
        result[:, size * k : size * (k + 1)] = cutout.seen(picture, interpolated=interpolated)
    return result


def _smaller_holes(target: NDArray[np.float32], reasons: NDArray[np.uint16], times: int) -> NDArray[np.float32]:
    """Return the picture (h, w, 3) of traced pixels in bytes' values, after a `block_mean` of so many times. target
    (H, W, 4) and reasons (H, W) are the panorama's, and are not made smaller before: flags have no mean."""
    height, width = (-(-pixels // times) for pixels in reasons.shape)
    result = np.empty((height, width, 3), np.float32)

    def work(rows: slice) -> None:
        pixels = slice(times * rows.start, times * rows.stop)
        result[rows] = block_mean(coloured_holes(target[pixels], reasons[pixels]), times)

    over_bands((height, width * times**2), work)
    return result


def _sheet(path: Path, titles: Sequence[str], rows: Mapping[str, list[NDArray[np.uint8]]]) -> NDArray[np.uint8]:
    """Return rows of pictures (S, S, 3) below each other, each below its name, with the titles of the columns above
    them. path takes texts meanwhile. Raises BadInputError."""
    size = next(iter(rows.values()))[0].shape[1]
    width = len(titles) * (size + GAP_PX) - GAP_PX
    heads = [drawn(path, [(title.capitalize(), None)], size, scale=text_scale(width)) for title in titles]
    height = max(head.shape[0] for head in heads)
    parts = [_side_by_side([_padded(head, height) for head in heads])]
    for name, pictures in rows.items():
        parts += [legend_below(path, [(name, None)], width), _side_by_side(pictures)]
    return np.concatenate(parts)


def _mean_shares(shares: list[dict[Reason, float]]) -> dict[Reason, float]:
    """Return the mean share of each reason over all cut-outs."""
    reasons = [reason for reason in Reason if any(reason in of for of in shares)]
    return {reason: float(np.mean([of.get(reason, 0.0) for of in shares])) for reason in reasons}


def _side_by_side(pictures: list[NDArray[np.uint8]]) -> NDArray[np.uint8]:
    """Return pictures (h, w, 3) of one height beside each other, with gaps between them."""
    gap = np.full((pictures[0].shape[0], GAP_PX, 3), BACKGROUND, np.uint8)
    return np.concatenate([part for picture in pictures for part in (gap, picture)][1:], axis=1)


def _padded(picture: NDArray[np.uint8], height: int) -> NDArray[np.uint8]:
    """Return a picture (h, w, 3) with rows of the background below it, up to this height."""
    return np.pad(picture, ((0, height - picture.shape[0]), (0, 0), (0, 0)), constant_values=BACKGROUND)
