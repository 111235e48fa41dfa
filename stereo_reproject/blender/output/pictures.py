"""Pictures that explain a frame: holes by reason with a legend, and the grid over the source eye."""

from __future__ import annotations

from pathlib import Path

import blf
import bpy
import imbuf
import numpy as np
from numpy.typing import NDArray

from ...errors import BadInputError
from ...images.metrics import tone
from ...images.reasons import Reason
from ...jobs.plain_paths import plain_path
from ...warp.grid import CELL_QUADS, Grid

COLOURS: dict[Reason, tuple[int, int, int]] = {
    Reason.DISOCCLUDED: (230, 60, 50),
    Reason.OUTSIDE: (60, 120, 235),
    Reason.SILHOUETTE: (245, 200, 40),
    Reason.TRANSPARENT: (80, 200, 220),
    Reason.VIEW_DEPENDENT: (200, 90, 220),
    Reason.VOLUME: (150, 150, 255),
    Reason.DEFOCUS: (120, 220, 110),
    Reason.REFINED: (255, 255, 255),
    Reason.PROBE: (255, 150, 190),
    Reason.INVALID: (255, 0, 255),
}
"""A pixel with several reasons shows the first of these."""

ABOVE: tuple[tuple[float, tuple[int, int, int]], ...] = (
    (1.1, (250, 225, 110)),
    (1.25, (250, 165, 50)),
    (1.5, (235, 85, 45)),
    (2.0, (225, 30, 120)),
)
"""Noise ratios that a tile may be above, and their colours in the picture of the estimate."""

WITHOUT_PROBES = (95, 95, 105)

DIFFERENCE_GAIN = 4
"""Times that a difference is brightened."""

PNG_END = b"IEND\xaeB`\x82"

GRID_COLOUR = (60, 230, 120)
GRID_WIDTH_PIXELS = 2880
"""Pixels up to which the picture of the grid is enlarged."""
FONT = 0


def display(colour: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Scene-linear (H, W, 4) as (H, W, 3) bytes, tone-mapped plainly: a backdrop, not the scene's view transform."""
    return (255.0 * np.sqrt(tone(colour))).astype(np.uint8)


def write_holes(path: Path, target: NDArray[np.float32], reasons: NDArray[np.uint16]) -> None:
    """The target eye, dimmed, with every traced pixel in the colour of its reason and a legend below."""
    picture, shares = _holes(target, reasons)
    _write_with_legend(
        path, picture, [(f"{reason.label} {100.0 * share:.1f} %", COLOURS[reason]) for reason, share in shares.items()]
    )


def write_hole_mask(path: Path, target: NDArray[np.float32], reasons: NDArray[np.uint16]) -> None:
    """Write the picture of traced pixels without its legend, as one of a sequence: of the target's size."""
    _write_png(path, _holes(target, reasons)[0])


def _holes(target: NDArray[np.float32], reasons: NDArray[np.uint16]) -> tuple[NDArray[np.uint8], dict[Reason, float]]:
    """The picture, (H, W, 3), and the share of the pixels that have each reason shown in it."""
    picture = (display(target) * 0.35 + 20).astype(np.uint8)
    shown = np.zeros(reasons.shape, bool)
    shares: dict[Reason, float] = {}
    for reason, colour in COLOURS.items():
        has_reason = (reasons & reason.bit) > 0
        if not has_reason.any() and reason not in (Reason.DISOCCLUDED, Reason.OUTSIDE, Reason.SILHOUETTE):
            continue
        picture[has_reason & ~shown] = colour
        shown |= has_reason
        shares[reason] = float(np.mean(has_reason))
    return picture, shares


def write_estimate(
    path: Path, target: NDArray[np.float32], estimates: NDArray[np.float32], *, why_none: str | None = None
) -> None:
    """The target eye, dimmed, with the tiles in colour whose noise ratio is above 1 beyond chance, and how far.

    estimates (H, W, 3) as `estimates.estimate_map` gives them; why_none is why there are none, if so.
    """
    backdrop = (display(target) * 0.35 + 20).astype(np.uint8)
    picture = backdrop.copy()
    ratio, low = estimates[..., 0], estimates[..., 1]
    unknown = np.isnan(ratio)
    words = f"no estimate: {why_none}" if why_none else f"no probe tells: {100.0 * np.mean(unknown):.1f} %"
    shown = [(words, WITHOUT_PROBES, unknown)] if unknown.any() else []
    if (~unknown & (ratio != 1.0)).any():
        ends = [*(limit for limit, _ in ABOVE[1:]), np.inf]
        for (limit, colour), end in zip(ABOVE, ends, strict=True):
            band = (ratio > limit) & (ratio <= end) & (low > 1.0)
            words = f"noise ratio {limit:g} to {end:g}" if np.isfinite(end) else f"above {limit:g}"
            shown.append((f"{words}: {100.0 * np.mean(band):.1f} %", colour, band))
    if not shown:
        shown = [("all of it was traced", ABOVE[0][1], unknown)]
    for _, colour, where in shown:
        picture[where] = np.array(colour) // 2 + backdrop[where] // 2
    _write_with_legend(path, picture, [(text, colour) for text, colour, _ in shown])


def write_difference(path: Path, target: NDArray[np.float32], reference: NDArray[np.float32]) -> None:
    """Write the difference of the target eye to multiview's, both (H, W, 4), tone-mapped and brightened.

    Two renders differ by their noise already; what stands out of that is wrong.
    """
    difference = np.abs(tone(target) - tone(reference))
    picture = (255.0 * np.minimum(DIFFERENCE_GAIN * difference, 1.0)).astype(np.uint8)
    words = f"difference from multiview, {DIFFERENCE_GAIN} times; even speckle is noise"
    _write_with_legend(path, picture, [(words, (255, 255, 255))])


def write_grid(path: Path, source: NDArray[np.float32], grid: Grid) -> None:
    """The subdivided grid as a wireframe over the source eye (paper, figure 4), enlarged where that is small."""
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
    _write_png(path, picture)


def _cells_in_pixels(grid: Grid, scale: int) -> NDArray[np.bool_]:
    """Return the pixels (H, W) of the enlarged picture that lie in a subdivided cell. Vertices stand at pixel
    centres."""
    rows = (np.arange(grid.height * scale) / scale + 0.5).astype(np.intp) // CELL_QUADS
    columns = (np.arange(grid.width * scale) / scale + 0.5).astype(np.intp) // CELL_QUADS
    return grid.subdivided[np.ix_(rows, columns)]


def _lines(shape: tuple[int, int], scale: int, step: int, *, diagonals: bool) -> NDArray[np.bool_]:
    """Return the pixels (H, W) on the sides of quads of `step` source pixels, and the diagonals along which they are
    cut."""
    period = step * scale
    y, x = (np.arange(size) + scale // 2 for size in shape)
    lines = (y % period == 0)[:, None] | (x % period == 0)[None, :]
    if diagonals:
        lines |= (y[:, None] + x[None, :]) % period == 0
    return lines


def _write_with_legend(path: Path, picture: NDArray[np.uint8], legend: list[tuple[str, tuple[int, int, int]]]) -> None:
    size = 16.0
    blf.size(FONT, size)
    height, width = picture.shape[:2]
    line, margin, square = 26, 10, 14
    places = []
    x, y = margin, 0
    for text, colour in legend:
        for part, words in enumerate(_wrapped(text, width - square - 8 - 2 * margin)):
            needed = square + 8 + int(_length(words)) + 2 * margin
            if part or (x + needed > width and x > margin):
                x, y = margin, y + line
            places.append((words, None if part else colour, x, y))
            x += needed
    canvas = np.full((height + y + line + 6, width, 3), 24, np.uint8)
    canvas[:height] = picture
    for _, colour, x, y in places:
        if colour is not None:
            canvas[height + y + 9 : height + y + 9 + square, x : x + square] = colour
    _write_png(path, canvas)
    image = imbuf.load(str(path))
    blf.color(FONT, 0.92, 0.92, 0.92, 1.0)
    # The stubs do not know that this is a context manager.
    with blf.bind_imbuf(FONT, image):  # pyright: ignore[reportGeneralTypeIssues]
        for text, _, x, y in places:
            blf.position(FONT, x + square + 8, canvas.shape[0] - (height + y + 9 + square) + 2, 0)
            blf.draw_buffer(FONT, text)
    imbuf.write(image, filepath=str(path))
    image.free()
    check_png(path)


def _wrapped(text: str, room: int) -> list[str]:
    """The text in lines of at most so many pixels, as far as its words are short enough."""
    lines = [""]
    for word in text.split():
        longer = f"{lines[-1]} {word}".lstrip()
        if lines[-1] and _length(longer) > room:
            lines.append(word)
        else:
            lines[-1] = longer
    return lines


def _length(text: str) -> float:
    """In pixels, as the font is set."""
    return blf.dimensions(FONT, text)[0]


def _write_png(path: Path, picture: NDArray[np.uint8]) -> None:
    """Write bytes (H, W, 3) as they are. Raises BadInputError when Blender cannot write."""
    height, width = picture.shape[:2]
    image = bpy.data.images.new(path.stem, width, height, alpha=False)
    try:
        rgba = np.ones((height, width, 4), np.float32)
        rgba[..., :3] = picture[::-1] / 255.0
        image.pixels.foreach_set(rgba.ravel())
        image.file_format = "PNG"
        image.filepath_raw = str(path)
        image.save()
    except RuntimeError as error:
        raise BadInputError(f"cannot write {path.name}: {' '.join(str(error).split())}") from error
    finally:
        bpy.data.images.remove(image)
    check_png(path)


def check_png(path: Path) -> None:
    """Raises BadInputError unless the PNG is there to its end: Blender says nothing when a full disk cuts one off."""
    if not path.exists() or not path.read_bytes().endswith(PNG_END):
        raise BadInputError(f"cannot write {path.name}: is the disk full?")


def read_png(path: Path) -> NDArray[np.float32]:
    """A PNG's display values, (H, W, 3) from 0 to 1."""
    return read_pixels(path)[..., :3]


def read_pixels(path: Path, *, linear: bool = False) -> NDArray[np.float32]:
    """Return the pixels (H, W, channels) of a picture file: its values as they are, or scene-linear. Empty where it
    cannot be read."""
    with plain_path(path.parent) as folder:
        try:
            image = bpy.data.images.load(str(folder / path.name))
        except RuntimeError:
            return np.empty((0, 0, 4), np.float32)
        return _pixels(image, linear=linear)


def _pixels(image: bpy.types.Image, *, linear: bool) -> NDArray[np.float32]:
    """An image's values, which is removed then."""
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
