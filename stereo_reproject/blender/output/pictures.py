"""Pictures that explain a frame: holes by reason with a legend, and the grid over the source eye."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import blf
import bpy
import imbuf
import numpy as np
from numpy.typing import NDArray

from ...errors import BadInputError
from ...images.bands import by_bands
from ...images.metrics import COLOUR_CHANNELS, judged, tone
from ...images.png import write_png
from ...images.reasons import Reason
from ...jobs.plain_paths import plain_path
from ...warp.grid import CELL_QUADS, Grid
from ...words import Words

COLOURS: dict[Reason, tuple[int, int, int]] = {
    Reason.DISOCCLUDED: (230, 60, 50),
    Reason.OUTSIDE: (60, 120, 235),
    Reason.SILHOUETTE: (245, 200, 40),
    Reason.TRANSPARENT: (80, 200, 220),
    Reason.VIEW_DEPENDENT: (200, 90, 220),
    Reason.VOLUME: (150, 150, 255),
    Reason.DEFOCUS: (120, 220, 110),
    Reason.DETAIL: (190, 130, 70),
    Reason.REFINED: (255, 255, 255),
    Reason.PROBE: (255, 150, 190),
    Reason.INVALID: (255, 0, 255),
    Reason.MOVED: (40, 170, 160),
}
"""A pixel with several reasons shows the first of these."""

ABOVE: tuple[tuple[float, str, tuple[int, int, int]], ...] = (
    (1.1, "Barely off", (250, 225, 110)),
    (1.25, "Slightly off", (250, 165, 50)),
    (1.5, "Clearly off", (235, 85, 45)),
    (2.0, "Far off", (225, 30, 120)),
)
"""Honest ratios that a tile may be above, with their words and colours in the picture of the estimate."""

NOTHING_LEFT = "None: no area is off by more than noise, or it was rendered again"
"""Legend of the picture of the estimate where no tile has a colour."""

WITHOUT_PROBES = (95, 95, 105)

DIFFERENCE_GAIN = 4
"""Times that a difference is brightened."""

PNG_END = b"IEND\xaeB`\x82"

Legend = Sequence[tuple[str, tuple[int, int, int] | None]]
"""Texts of a legend, each with the colour of the square before it, or None."""

GRID_COLOUR = (60, 230, 120)
GRID_WIDTH_PIXELS = 2880
"""Pixels up to which the picture of the grid is enlarged."""
FONT = 0
TEXT_PX = 16.0
"""Size of a legend's text."""

MAX_USUAL_WIDTH_PX = 1280
"""Width of a picture up to which that is its text's size; that of a wider one grows with it, since an Image Editor
fits it to a window."""


def display(colour: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Return a scene-linear picture (H, W, 4) as bytes (H, W, 3) to look at. The tone mapping is a plain one, not the
    scene's view transform.
    """

    def shown(colour: NDArray) -> NDArray[np.uint8]:
        return (255.0 * np.sqrt(tone(colour))).astype(np.uint8)

    return by_bands(shown, colour)


def _backdrop(colour: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Return a scene-linear picture (H, W, 4) as `display` does, dimmed."""
    return (np.arange(256) * 0.35 + 20).astype(np.uint8)[display(colour)]


def write_holes(path: Path, target: NDArray[np.float32], reasons: NDArray[np.uint16]) -> None:
    """Write a PNG of the target eye, dimmed, in which every traced pixel has the colour of its reason, with a legend
    below. target (H, W, 4) is scene-linear; reasons (H, W) are `Reason` flags.
    """
    _write_with_legend(path, coloured_holes(target, reasons), legend_of_holes(shares_by_reason(reasons)))


def legend_of_holes(shares: Mapping[Reason, float]) -> Legend:
    """Return the legend of a picture of traced pixels, by the share of all pixels that has each reason."""
    return [(f"{reason.words} {100.0 * share:.1f} %", COLOURS[reason]) for reason, share in shares.items()]


def write_hole_mask(path: Path, target: NDArray[np.float32], reasons: NDArray[np.uint16]) -> None:
    """Write the picture of `write_holes` without its legend: as a frame of an animation it has the target's size."""
    write_png(path, coloured_holes(target, reasons))


def coloured_holes(target: NDArray[np.float32], reasons: NDArray[np.uint16]) -> NDArray[np.uint8]:
    """Return the picture (H, W, 3) of traced pixels, as bytes; the parameters are those of `write_holes`."""
    picture = _backdrop(target)
    shown = np.zeros(reasons.shape, bool)
    for reason, colour in COLOURS.items():
        has_reason = (reasons & reason.bit) > 0
        picture[has_reason & ~shown] = colour
        shown |= has_reason
    return picture


def shares_by_reason(reasons: NDArray[np.uint16]) -> dict[Reason, float]:
    """Return the share of all pixels that have each reason; reasons that none has are left out, but for a few."""
    shares = {reason: float(np.mean((reasons & reason.bit) > 0)) for reason in COLOURS}
    always = (Reason.DISOCCLUDED, Reason.OUTSIDE, Reason.SILHOUETTE)
    return {reason: share for reason, share in shares.items() if share > 0.0 or reason in always}


def write_estimate(
    path: Path, target: NDArray[np.float32], estimates: NDArray[np.float32], *, why_none: str | None = None
) -> None:
    """Write a PNG of the target eye, dimmed, in which tiles are coloured whose honest ratio is above 1 beyond chance,
    with a legend below.

    target (H, W, 4) is scene-linear; estimates (H, W, 3) are those of `estimates.estimate_map`. why_none says in words
    why there is no estimate, if there is none.
    """
    backdrop = _backdrop(target)
    picture = backdrop.copy()
    ratio, low = estimates[..., 0], estimates[..., 1]
    unknown = np.isnan(ratio)
    words = f"Not checked: {why_none}" if why_none else f"Not checked {100.0 * np.mean(unknown):.1f} %"
    shown = [(words, WITHOUT_PROBES, unknown)] if unknown.any() else []
    nothing: Legend = [] if shown else [("All of it was rendered", ABOVE[0][2])]
    if (~unknown & (ratio != 1.0)).any():
        ends = [*(limit for limit, _, _ in ABOVE[1:]), np.inf]
        off = [(ratio > limit) & (ratio <= end) & (low > 1.0) for (limit, _, _), end in zip(ABOVE, ends, strict=True)]
        for (_, words, colour), band in zip(ABOVE, off if np.any(off) else (), strict=False):
            shown.append((f"{words} {100.0 * np.mean(band):.1f} %", colour, band))
        nothing = [] if np.any(off) else [(NOTHING_LEFT, None)]
    for _, colour, where in shown:
        picture[where] = np.array(colour) // 2 + backdrop[where] // 2
    _write_with_legend(path, picture, [*((text, colour) for text, colour, _ in shown), *nothing])


def write_difference(path: Path, target: NDArray[np.float32], reference: NDArray[np.float32]) -> None:
    """Write a PNG of the difference between the target eye and multiview's, both (H, W, 4) scene-linear, tone-mapped
    and brightened; a difference of alpha shows as grey. Two renders always differ by their noise; only what stands out
    of that is wrong.
    """
    difference = np.abs(judged(target) - judged(reference))
    difference = np.maximum(difference[..., :COLOUR_CHANNELS], difference[..., COLOUR_CHANNELS:])
    picture = (255.0 * np.minimum(DIFFERENCE_GAIN * difference, 1.0)).astype(np.uint8)
    words = f"Difference from multiview, {DIFFERENCE_GAIN} times as bright; even speckle is noise"
    _write_with_legend(path, picture, [(words, (255, 255, 255))])


def write_grid(path: Path, source: NDArray[np.float32], grid: Grid) -> None:
    """Write a PNG of the warp's grid as a wireframe over the source eye (H, W, 4), enlarged where that is small (paper,
    figure 4), with a legend below. Subdivided cells show single pixels, coarse ones their two triangles.
    """
    scale = max(1, min(3, GRID_WIDTH_PIXELS // grid.width))
    picture = np.repeat(np.repeat(display(source), scale, axis=0), scale, axis=1)
    strength = np.full(picture.shape[:2], 0, np.uint8)
    fine = _cells_in_pixels(grid, scale)
    for native, weight in ((True, 64), (False, 204)):
        strength[
            _lines(picture.shape[:2], scale, 1 if native else CELL_QUADS, diagonals=not native) & (fine == native)
        ] = weight
    for k, value in enumerate(GRID_COLOUR):
        dimmed = picture[..., k].astype(np.uint16) * 3 // 5
        picture[..., k] = (dimmed * (255 - strength) + np.uint16(value) * strength) // 255
    share = 100.0 * np.mean(fine)
    words = (
        f"Wide cells, {CELL_QUADS} x {CELL_QUADS} pixels of one surface, are warped as one; in the fine grid,"
        f" {share:.0f} % of the picture, each pixel is warped by itself"
    )
    _write_with_legend(path, picture, [(words, GRID_COLOUR)])


def _cells_in_pixels(grid: Grid, scale: int) -> NDArray[np.bool_]:
    """Return the pixels (H, W) of the picture enlarged by `scale` that lie in a subdivided cell. The grid's vertices
    stand at the centres of source pixels.
    """
    rows = (np.arange(grid.height * scale) / scale + 0.5).astype(np.intp) // CELL_QUADS
    columns = (np.arange(grid.width * scale) / scale + 0.5).astype(np.intp) // CELL_QUADS
    return grid.subdivided[np.ix_(rows, columns)]


def _lines(shape: tuple[int, int], scale: int, step: int, *, diagonals: bool) -> NDArray[np.bool_]:
    """Return the pixels (H, W) of an enlarged picture that lie on a side of a quad, `step` source pixels long; with
    diagonals also those on the diagonals that cut quads into triangles.
    """
    period = step * scale
    y, x = (np.arange(size) + scale // 2 for size in shape)
    lines = (y % period == 0)[:, None] | (x % period == 0)[None, :]
    if diagonals:
        lines |= (y[:, None] + x[None, :]) % period == 0
    return lines


def _write_with_legend(path: Path, picture: NDArray[np.uint8], legend: Legend) -> None:
    """Write a PNG of the picture (H, W, 3), in bytes, with a legend below. Raises BadInputError."""
    write_png(path, np.concatenate([picture, legend_below(path, legend, picture.shape[1])]))


def legend_below(path: Path, legend: Legend, width: int) -> NDArray[np.uint8]:
    """Return a legend as `drawn` does, for a picture of this width in pixels, with text that can be read where the
    picture is fitted to a window."""
    return drawn(path, legend, width, scale=text_scale(width))


def text_scale(width: int) -> float:
    """Return how many times as large as usual the text of a picture is, whose width is in pixels."""
    return max(width / MAX_USUAL_WIDTH_PX, 1.0)


def drawn(path: Path, legend: Legend, width: int, *, scale: float = 1.0) -> NDArray[np.uint8]:
    """Return a legend as a picture (h, width, 3) in bytes: texts, each after a square in its colour where it has one,
    all of it so many times as large as usual as scale says.

    path is that of the PNG that it is for, and takes the legend meanwhile: Blender draws into files alone. Raises
    BadInputError.
    """
    blf.size(FONT, TEXT_PX * scale)
    line, margin, square, gap, above = (round(pixels * scale) for pixels in (26, 10, 14, 8, 9))
    places: list[tuple[str, tuple[int, int, int] | None, int, int]] = []
    x, y = margin, 0
    for text, colour in legend:
        for part, words in enumerate(_wrapped(text, width - square - gap - 2 * margin)):
            needed = square + gap + int(_length(words)) + 2 * margin
            if part or (x + needed > width and x > margin):
                x, y = margin, y + line
            places.append((words, None if part else colour, x if colour is not None else x - square - gap, y))
            x += needed
    canvas = np.full((y + line + margin // 2 + 1, width, 3), 24, np.uint8)
    for _, colour, x, y in places:
        if colour is not None:
            canvas[y + above : y + above + square, x : x + square] = colour
    write_png(path, canvas)
    image = imbuf.load(str(path))
    blf.color(FONT, 0.92, 0.92, 0.92, 1.0)
    # The stubs do not know that this is a context manager.
    with blf.bind_imbuf(FONT, image):  # pyright: ignore[reportGeneralTypeIssues]
        for text, _, x, y in places:
            blf.position(FONT, x + square + gap, canvas.shape[0] - (y + above + square) + round(2 * scale), 0)
            blf.draw_buffer(FONT, text)
    imbuf.write(image, filepath=str(path))
    image.free()
    check_png(path)
    return np.round(255.0 * read_png(path)).astype(np.uint8)


def _wrapped(text: str, room: int) -> list[str]:
    """Return the text in lines of at most `room` pixels; a single word that is longer has a line of its own."""
    lines = [""]
    for word in text.split():
        longer = f"{lines[-1]} {word}".lstrip()
        if lines[-1] and _length(longer) > room:
            lines.append(word)
        else:
            lines[-1] = longer
    return lines


def _length(text: str) -> float:
    """Return the width of a text in pixels, in the font and size that are set."""
    return blf.dimensions(FONT, text)[0]


def check_png(path: Path) -> None:
    """Raise BadInputError unless the PNG is there to its end: Blender says nothing when a full disk cuts a file off."""
    if not path.exists() or not path.read_bytes().endswith(PNG_END):
        raise BadInputError(Words("cannot write {name}: is the disk full?", name=path.name))


def read_png(path: Path) -> NDArray[np.float32]:
    """Return the values (H, W, 3) of a PNG as a screen shows them, from 0 to 1."""
    return read_pixels(path)[..., :3]


def read_pixels(path: Path, *, linear: bool = False) -> NDArray[np.float32]:
    """Return the pixels (H, W, channels) of a picture file, row 0 at the top: scene-linear, or without linear the
    values that the file holds. Empty (0, 0, 4) where it cannot be read.
    """
    with plain_path(path.parent) as folder:
        try:
            image = bpy.data.images.load(str(folder / path.name))
        except RuntimeError:
            return np.empty((0, 0, 4), np.float32)
        return _pixels(image, linear=linear)


def _pixels(image: bpy.types.Image, *, linear: bool) -> NDArray[np.float32]:
    """Return the values of an image (H, W, channels), as `read_pixels` says, and remove the image from the open
    file.
    """
    try:
        if not linear:
            image.colorspace_settings.name = "Non-Color"
        # The stubs do not know that an array property can be iterated over.
        width, height = image.size  # pyright: ignore[reportGeneralTypeIssues]
        values = np.empty((height, width, image.channels), np.float32)
        if values.size:
            image.pixels.foreach_get(values.reshape(-1))
        return values[::-1]
    finally:
        bpy.data.images.remove(image)
