"""The sheet of a panorama's cut-outs: both eyes and the traced pixels as a headset shows them, in perspective."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from ...images.cutouts import CutoutPixels, block_mean, cutout_pixels
from ...images.exr import VIEWS
from ...images.png import write_png
from ...images.reasons import Reason
from ...pipeline.stereo_frame import StereoFrame, colour
from ...views.cutouts import Cutout, cutouts_of, natural_size
from ...views.panorama import PanoramicCamera
from .delivery import deliver_side_by_side
from .pictures import display, drawn, holes_by_reason, legend_of_holes, read_png

SIZES_PX = (192, 640)
"""Least and greatest width of a cut-out in the sheet: of less its title has no room, and five of more are wider than
a screen can be."""

MAX_TIMES = 6
"""Places in a row, at most, whose mean is a pixel of the sheet."""

Eyes = Mapping[str, NDArray[np.float32]]
"""Scene-linear pictures (h, w, 4) of both eyes, by view."""

Shown = Mapping[str, NDArray[np.uint8]]
"""Pictures (h, w, 3) of both eyes in bytes, by view."""

GAP_PX = 6
BACKGROUND = 24


@dataclass(frozen=True)
class SheetCutout:
    """A cut-out of the sheet: its places in the panorama, times x times of them for each pixel of the sheet."""

    cutout: Cutout
    pixels: CutoutPixels
    times: int

    def seen(self, picture: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return the cut-out (S, S, C) of a panorama's picture (H, W, C)."""
        return block_mean(self.pixels.linear(picture), self.times)

    def holes(
        self, target: NDArray[np.float32], reasons: NDArray[np.uint16]
    ) -> tuple[NDArray[np.uint8], dict[Reason, float]]:
        """Return the cut-out (S, S, 3) of the picture of traced pixels, as bytes, and the share of the cut-out that has
        each reason. target (H, W, 4) and reasons (H, W) are the panorama's."""
        picture, shares = holes_by_reason(self.pixels.nearest(target), self.pixels.nearest(reasons))
        picture[~self.pixels.shown] = 0
        return block_mean(picture, self.times).astype(np.uint8), shares


def sheet_cutouts(camera: PanoramicCamera) -> list[SheetCutout]:
    """Return the cut-outs of a panorama, all of one size; empty where there are none."""
    cutouts = cutouts_of(camera)
    if not cutouts:
        return []
    natural = natural_size(camera, cutouts[0])
    size = int(np.clip(natural, *SIZES_PX))
    times = min(math.ceil(natural / size), MAX_TIMES)
    return [SheetCutout(cutout, cutout_pixels(camera, cutout, size * times), times) for cutout in cutouts]


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
    eyes = {view: [cutout.seen(colour(frame.eyes[view])) for cutout in cutouts] for view in VIEWS}
    in_a_row = shown({view: np.concatenate(pictures, axis=1) for view, pictures in eyes.items()})
    rendered = colour(frame.eyes[target])
    traced = [cutout.holes(rendered, frame.reasons) for cutout in cutouts]
    rows = {f"{view.capitalize()} eye": np.split(in_a_row[view], len(cutouts), axis=1) for view in VIEWS}
    rows[f"Traced pixels of the {target} eye"] = [picture for picture, _ in traced]
    sheet = _sheet(path, [cutout.cutout.title for cutout in cutouts], rows)
    if with_legend:
        legend = legend_of_holes(_mean_shares([shares for _, shares in traced]))
        sheet = np.concatenate([sheet, drawn(path, legend, sheet.shape[1])])
    write_png(path, sheet)


def _sheet(path: Path, titles: Sequence[str], rows: Mapping[str, list[NDArray[np.uint8]]]) -> NDArray[np.uint8]:
    """Return rows of pictures (S, S, 3) below each other, each below its name, with the titles of the columns above
    them. path takes texts meanwhile. Raises BadInputError."""
    size = next(iter(rows.values()))[0].shape[1]
    heads = [drawn(path, [(title.capitalize(), None)], size) for title in titles]
    height = max(head.shape[0] for head in heads)
    parts = [_side_by_side([_padded(head, height) for head in heads])]
    for name, pictures in rows.items():
        parts += [drawn(path, [(name, None)], parts[0].shape[1]), _side_by_side(pictures)]
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
