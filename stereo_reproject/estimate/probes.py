"""Probes: a sparse set of pixels, traced twice, that tell how far the warped pixels are off beyond noise.

With w the warped value of a pixel and a, b two independent traces of it, all after tone mapping,

    error  = (w - a)(w - b)      has the mean   bias^2 + var(w),
    noise  = (a - b)^2 / 2       has the mean   var(a), the variance of one traced pixel,
    excess = error - noise       is what tracing the pixel would save: negative where the warp is the less noisy.

There is one probe in each tile. Half of the chance where in the tile is spread evenly, half of it over the picture's
contrast, where an error would show; a probe stands for as many pixels as its chance was small.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..images.contrast import Contrast, box_sum
from ..images.metrics import squared_error, tone
from .shown_materials import ShownMaterials, materials_by_tile

EVEN = 0.5
"""Share of a probe's chance that is spread evenly over its tile: no pixel stands for more than the rest allows."""

LOUDEST = 25.0
"""How many times the mean noise of those around it, or of all others, a probe's may be. One firefly in one trace is
more than the noise of a whole frame: taken as it is, nothing would seem wrong beside it."""

MISJUDGED = 3.0
"""Times that what a tile is likely to have may be put up or down because of those around it."""

NOISE_AS_RISK = 0.5
"""Weight of noise beside contrast in a tile's risk: where nothing is to be seen, tiles differ by little else."""


@dataclass(frozen=True)
class Probes:
    """Where the probes are: one in each tile of `spacing` pixels that has a warped pixel.

    rows, columns (N,) are in the order in which a mask of the probes would name them; weight (N,) is the number of
    warped pixels of its tile that each stands for, on average over the places it may have: one over its chance.
    """

    rows: NDArray[np.intp]
    columns: NDArray[np.intp]
    weight: NDArray[np.float64]
    spacing: int
    shape: tuple[int, int]

    @property
    def mask(self) -> NDArray[np.bool_]:
        result = np.zeros(self.shape, bool)
        result[self.rows, self.columns] = True
        return result

    @property
    def tiles(self) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Row and column (N,) of each probe's tile."""
        return self.rows // self.spacing, self.columns // self.spacing

    @property
    def tile_grid(self) -> tuple[int, int]:
        """Rows and columns of tiles."""
        height, width = self.shape
        return -(-height // self.spacing), -(-width // self.spacing)

    def in_tiles(self, image: NDArray) -> NDArray[np.float64]:
        """(N,): the sum of an image (H, W) over each probe's tile."""
        return _tile_sums(image, self.spacing)[self.tiles]

    def mean_in_tiles(self, image: NDArray, pixels: NDArray[np.bool_]) -> NDArray[np.float64]:
        """(N,): the mean of an image (H, W) over the pixels (H, W) in each probe's tile, 0 where there is none."""
        return self.in_tiles(np.where(pixels, image, 0.0)) / np.maximum(self.in_tiles(pixels), 1.0)

    def on_grid(self, values: NDArray, elsewhere: float) -> NDArray:
        """The values (N, ...) as rows and columns of tiles, and `elsewhere` in tiles without a probe."""
        grid = np.full((*self.tile_grid, *values.shape[1:]), elsewhere, values.dtype)
        grid[self.tiles] = values
        return grid

    def around(self, values: NDArray, reach: int = 2) -> NDArray[np.float64]:
        """(N,): the sum of values (N,) over the tiles within `reach` of each, without its own."""
        grid = self.on_grid(values, 0.0)
        return box_sum(grid, (reach, reach))[self.tiles] - values

    def around_and_own(self, values: NDArray) -> NDArray[np.float64]:
        """(N,): the mean of values (N,) over the tiles within 2 of each that have a probe."""
        count = self.around(np.ones_like(values, np.float64)) + 1.0
        return (self.around(values) + values) / count

    def over_tiles(self, values: NDArray, elsewhere: float) -> NDArray:
        """(H, W, ...): the values (N, ...) over the pixels of each probe's tile, and `elsewhere` in tiles without."""
        tiles = self.on_grid(values, elsewhere)
        height, width = self.shape
        return np.repeat(np.repeat(tiles, self.spacing, axis=0), self.spacing, axis=1)[:height, :width]

    def pixels_of(self, chosen: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """(H, W): the pixels of the tiles of the probes that are set in chosen (N,)."""
        return self.over_tiles(chosen, False)


def place_probes(warped: NDArray[np.bool_], contrast: Contrast, *, spacing: int, seed: int) -> Probes:
    """One probe in each tile, so that no part of the picture is left out, at a random warped pixel.

    warped (H, W): the pixels that are not traced anyway.
    """
    rng = np.random.default_rng(seed)
    rows, columns = np.nonzero(warped)
    tiles = rows // spacing, columns // spacing
    signal = np.where(warped, contrast.signal, 0.0)
    even = 1.0 / _tile_sums(warped, spacing)[tiles] if rows.size else np.zeros(0)
    total = _tile_sums(signal, spacing)[tiles]
    uneven = signal[rows, columns] / np.where(total > 0.0, total, 1.0)
    chance = np.where(total > 0.0, EVEN * even + (1.0 - EVEN) * uneven, even)
    # The largest of log(chance) + Gumbel noise falls on each pixel with its chance.
    order = np.argsort(-(np.log(chance) + rng.gumbel(size=chance.size)), kind="stable")
    names = tiles[0] * -(-warped.shape[1] // spacing) + tiles[1]
    _, first = np.unique(names[order], return_index=True)
    chosen = np.sort(order[first])
    return Probes(rows[chosen], columns[chosen], 1.0 / chance[chosen], spacing, (warped.shape[0], warped.shape[1]))


def place_regular_probes(warped: NDArray[np.bool_], *, spacing: int, seed: int) -> Probes:
    """The same, as a picture wants them: in each tile as near as may be to one place, which chance gives them all."""
    height, width = warped.shape
    place = np.random.default_rng(seed).integers(0, spacing, 2)
    rows, columns = np.nonzero(warped)
    apart = (rows % spacing - place[0]) ** 2 + (columns % spacing - place[1]) ** 2
    names = rows // spacing * -(-width // spacing) + columns // spacing
    order = np.lexsort((apart, names))
    _, first, pixels = np.unique(names[order], return_index=True, return_counts=True)
    chosen = order[first]
    in_order = np.argsort(chosen)
    chosen = chosen[in_order]
    return Probes(rows[chosen], columns[chosen], pixels[in_order].astype(np.float64), spacing, (height, width))


def _tile_sums(image: NDArray, spacing: int) -> NDArray[np.float64]:
    edges = [np.arange(0, size, spacing) for size in image.shape]
    return np.add.reduceat(np.add.reduceat(image.astype(np.float64), edges[0], axis=0), edges[1], axis=1)


@dataclass(frozen=True)
class TileEvidence:
    """What the probes say, per tile (N,) that has one.

    excess: as above, summed over the tile's warped pixels: from its probe, or, of a tile that was traced since
    (`refined`), from all of them. left: what of that counts as left in the frame, on average. noise: as above, of one
    pixel. seen_noise: the variance that the warped picture shows there. pixels: warped pixels of the tile. risk: what
    the excess of tiles is taken to be proportional to, where nothing else is known. frame_pixels: of the whole picture.
    materials: what the tiles show, None where that is not known. denoised: that variance over the one of a pixel as it
    is traced, which is more where the picture is denoised. likely: the excess of each tile as `denoised_probes` tells
    it by its own first trace, and left_by_second what its second tells, None where a tile's own have no say in that.
    """

    probes: Probes
    excess: NDArray[np.float64]
    left: NDArray[np.float64]
    noise: NDArray[np.float64]
    seen_noise: NDArray[np.float64]
    pixels: NDArray[np.float64]
    risk: NDArray[np.float64]
    refined: NDArray[np.bool_]
    frame_pixels: int
    materials: ShownMaterials | None = None
    denoised: float = 1.0
    likely: NDArray[np.float64] | None = None
    left_by_second: NDArray[np.float64] | None = None

    @property
    def mean_noise(self) -> float:
        """Variance of one traced pixel, averaged over the warped part of the frame; holes are taken to be as noisy."""
        weight = self.probes.weight
        return float((weight * self.noise).sum() / weight.sum()) if weight.size else 0.0

    @property
    def noise_around(self) -> NDArray[np.float64]:
        """(N,): variance of one traced pixel, averaged over the tiles around each and itself."""
        weight = self.probes.weight
        noise = weight * self.noise
        return (self.probes.around(noise) + noise) / (self.probes.around(weight) + weight)

    @property
    def traced_noise(self) -> float:
        """The variance of one pixel as it is traced, over that of one of the picture that is delivered."""
        return 1.0 / self.denoised

    @property
    def frame_noise(self) -> float:
        """Sum over the frame's pixels of the squared difference between two plain renders."""
        return 2.0 * self.mean_noise * self.frame_pixels


@dataclass(frozen=True)
class SelectionEvidence:
    """What the first traces tell of a denoised picture: the excess that each tile (N,) is likely to have. source_noise
    (N,) is in proportion to the variance of a traced pixel, as the source shows it."""

    likely: NDArray[np.float64]
    source_noise: NDArray[np.float64]


def measure(
    probes: Probes,
    warped: NDArray[np.bool_],
    contrast: Contrast,
    w: NDArray,
    a: NDArray,
    b: NDArray,
    *,
    shown: NDArray[np.integer] | None = None,
    denoised: float = 1.0,
    first: SelectionEvidence | None = None,
) -> TileEvidence:
    """w, a, b (N, >= 3) are the scene-linear colours of the probes' pixels; warped (H, W) as in `place_probes`.

    shown (H, W) is a number for the materials that each pixel shows, if that is known. denoised is the variance that is
    left of a traced pixel's in the picture that the warped one is to equal, 1 where that is not denoised. first is
    what the a alone have told, so that tiles may be chosen by it: what is then left, the b alone tell.

    A probe with a value that is no number says nothing: it counts as neither error nor noise.
    """
    known = np.isfinite(w).all(axis=-1) & np.isfinite(a).all(axis=-1) & np.isfinite(b).all(axis=-1)
    w, a, b = (tone(np.where(known[:, None], colour, 0.0)).astype(np.float64) for colour in (w, a, b))
    noise = denoised * np.mean((a - b) ** 2, axis=-1) / 2.0
    share = _heard(probes, noise)
    risk = np.where(warped, contrast.signal + NOISE_AS_RISK * contrast.noise, 0.0)
    excess = probes.weight * share * (np.mean((w - a) * (w - b), axis=-1) - noise)
    return TileEvidence(
        probes=probes,
        excess=excess,
        left=excess,
        noise=share * noise,
        seen_noise=probes.mean_in_tiles(contrast.noise, warped),
        pixels=probes.in_tiles(warped),
        risk=probes.in_tiles(risk),
        refined=np.zeros(w.shape[0], bool),
        frame_pixels=warped.size,
        materials=None if shown is None else _materials_in(probes, shown, risk, excess),
        denoised=denoised,
        likely=None if first is None else first.likely,
        left_by_second=None if first is None else probes.weight * _by_second(probes, w - b, noise, first, denoised),
    )


def _by_second(
    probes: Probes, residual: NDArray, noise: NDArray[np.float64], first: SelectionEvidence, denoised: float
) -> NDArray[np.float64]:
    """(N,) excess of the probes' pixels as b tells it. A tile's own a must have no part in it: the noise is the local
    one of the source, at the scale that all probes give it."""
    local = first.source_noise
    scale = (probes.weight * noise).sum() / max((probes.weight * local).sum(), 1e-30)
    error = np.mean(residual**2, axis=-1)
    heard = np.minimum(1.0, LOUDEST * scale * local / denoised / np.maximum(error, 1e-30))
    return heard * error - (1.0 + 1.0 / denoised) * scale * local


def _materials_in(
    probes: Probes, shown: NDArray[np.integer], risk: NDArray, found: NDArray[np.float64]
) -> ShownMaterials:
    numbers = probes.on_grid(np.arange(probes.rows.size), 0)
    side = probes.spacing

    def row_of_tiles(row: int) -> tuple[NDArray, NDArray, NDArray]:
        band = slice(row * side, (row + 1) * side)
        rows, columns = np.nonzero(risk[band] > 0.0)
        return numbers[row, columns // side], shown[band][rows, columns], risk[band][rows, columns]

    pairs = materials_by_tile(row_of_tiles(row) for row in range(probes.tile_grid[0]))
    return ShownMaterials(*pairs, of_probe=shown[probes.rows, probes.columns].astype(np.intp), found=found)


def _heard(probes: Probes, noise: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N,): the share of what each probe says that counts, so that none is louder than LOUDEST allows."""
    everywhere = (noise.sum() - noise) / max(noise.size - 1, 1)
    nearby = probes.around(noise) / np.maximum(probes.around(np.ones_like(noise)), 1.0)
    allowed = LOUDEST * np.maximum(nearby, everywhere)
    return np.where((noise > allowed) & (allowed > 0.0), allowed / np.where(noise > 0.0, noise, 1.0), 1.0)


def with_refined(
    measured: TileEvidence,
    refined: NDArray[np.bool_],
    pixels: NDArray[np.bool_],
    noise: NDArray[np.float64],
    *,
    warped: NDArray,
    traced: NDArray,
    by_own: NDArray[np.bool_] | None = None,
) -> TileEvidence:
    """The same when the tiles set in refined (N,) have been traced: their excess is known from every pixel now.

    pixels (H, W) are those that were traced, warped and traced (H, W, >= 3) the colours before and after; noise (N,) is
    the variance of one pixel of a plain render there. Tiles of by_own (N,) were chosen because of what their own probe
    said: it may have said too much, as those of the tiles that stay have then said too little. So no more is taken off
    than is known now to have been there.
    """
    known = pixels & np.isfinite(warped[..., :3]).all(axis=-1) & np.isfinite(traced[..., :3]).all(axis=-1)
    error = np.zeros(known.shape)
    error[known] = squared_error(warped[known], traced[known])
    counted = (1.0 + measured.traced_noise) * measured.probes.in_tiles(known)
    excess = measured.probes.in_tiles(error) - noise * counted
    found = measured.probes.in_tiles(error) - measured.noise_around * counted
    taken = measured.left if by_own is None else np.where(by_own, found, measured.left)
    likely = None if measured.likely is None else _likely_after(measured, refined, excess)
    return replace(
        measured,
        likely=likely,
        excess=np.where(refined, excess, measured.excess),
        left=np.where(refined, measured.left - taken, measured.left),
        refined=measured.refined | refined,
    )


def _likely_after(
    measured: TileEvidence, refined: NDArray[np.bool_], excess: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(N,): what tiles are likely to have, now that some are known: more around those that had more."""
    assert measured.likely is not None
    had, foretold = (
        measured.probes.around(np.where(refined, a, 0.0)) for a in (np.maximum(excess, 0.0), measured.likely)
    )
    usual = max(float(measured.likely.mean()), 1e-12)
    factor = np.clip((had + usual) / (foretold + usual), 1.0 / MISJUDGED, MISJUDGED)
    return np.where(refined | measured.refined, 0.0, measured.likely * factor)
