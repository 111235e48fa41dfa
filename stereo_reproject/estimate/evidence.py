"""Evidence of the probes: how far the warped pixels are off beyond noise, tile by tile.

With w the warped value of a pixel and a, b two independent traces of it, all after tone mapping, and with c the share
of a pixel's variance that the lookup keeps (`images.lookup.variance_share`),

    error  = (w - a)(w - b)      has the mean   bias^2 + c var(a), because var(w) = c var(a),
    noise  = (a - b)^2 / 2       has the mean   var(a), the variance of one traced pixel,
    excess = error - c noise     has the mean   bias^2: what is wrong, however little noise is left.

So noise that the lookup has smoothed away is no merit that a wrong pixel could be excused with. In a denoised picture a
and b are what `denoised` hears of the traces, and c is the share of their variance that the warped colour has too.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..images.contrast import Contrast
from ..images.metrics import channel_mean, judged, squared_error
from ..settings.accuracy import ROUNDING_VARIANCE
from .probes import Probes
from .shown_materials import ShownMaterials, materials_by_tile
from .tuning import TUNING

MIN_CONTRAST = 1e-9
"""Variance, after tone mapping, that every warped pixel has at least as its contrast: far less than can be seen. Flat
tiles of a picture without noise then differ by their number of pixels alone, and none divides by 0."""


@dataclass(frozen=True)
class ReflectedLight:
    """Reflected and transmitted light of the probes' pixels (`passes.VIEW_DEPENDENT_PASS`), scene-linear (N, 3): as it
    was warped, and as it was traced once and once again.

    variance_share (N,) is the share of a pixel's variance that its lookup has kept. tells (N,) are the probes whose
    pixels are known to look different from each eye in nothing else.
    """

    warped: NDArray
    once: NDArray
    again: NDArray
    variance_share: NDArray
    tells: NDArray[np.bool_]


@dataclass(frozen=True)
class ProbeTraces:
    """Scene-linear colours (N, >= 3) of the probes' pixels: as they were warped, and as they were traced once and once
    again.

    A probe with NaN or infinity in any of them tells nothing. variance_share, (N,) or one for all, is the
    share of a trace's variance that the warped colour has. uncorrected (N, >= 3) are the warped colours as
    they were before a pilot's slow errors were taken away; None where there was no pilot. reflected is the reflected
    light alone, None where the renders do not tell it. heard are what the two traces tell, (N, 3 or 4) each as they are
    judged, where that is not their colours themselves.
    """

    warped: NDArray
    once: NDArray
    again: NDArray
    variance_share: NDArray | float = 1.0
    uncorrected: NDArray | None = None
    reflected: ReflectedLight | None = None
    heard: tuple[NDArray[np.float64], NDArray[np.float64]] | None = None

    @property
    def finite(self) -> NDArray[np.bool_]:
        """The probes (N,) whose three colours are all finite."""
        w, a, b = (np.isfinite(colour).all(axis=-1) for colour in (self.warped, self.once, self.again))
        return w & a & b

    def toned(self, known: NDArray[np.bool_]) -> tuple[NDArray[np.float64], ...]:
        """Return the three colours, (N, 4) with alpha or (N, 3) without, as `metrics.judged` has them: warped, once,
        again; of the latter two what is heard. They are 0 where `known` (N,) is not set."""
        w, a, b = (
            judged(np.where(known[:, None], colour, 0.0)).astype(np.float64)
            for colour in (self.warped, self.once, self.again)
        )
        if self.heard is not None:
            a, b = (np.where(known[:, None], trace, 0.0) for trace in self.heard)
        return w, a, b


@dataclass(frozen=True)
class TileEvidence:
    """Evidence of the probes, for each of the N tiles that has one. Squares and variances are of tone-mapped colour.

    excess: squared bias, summed over the tile's warped pixels, each by its weight; from its probe, or, for a tile that
    was traced since (`refined`), from all its pixels. remaining: the excess that the frame still has in this tile, on
    average. smoothed_noise: variance that the lookup has taken from the tile's pixels that are still warped, summed.
    noise: variance of one pixel of the delivered picture. seen_noise: variance that the warped picture's own noise
    shows; in a denoised picture that is all that tells noise, and so the same. pixels: number of the tile's warped
    pixels, which tracing it costs. area: their summed weight; at most their number, and less where pixels are smaller
    than elsewhere. contrast: their contrast, summed by weight, above 0, to which an unknown excess is taken to be
    proportional. frame_area: summed weight of the whole picture. materials: those that the tiles show, None if unknown.
    The others are None where nothing is denoised. traced_noise: variance (N,) of a traced pixel, which is not denoised
    yet. told_noise: variance (N,) of what each trace of a probe tells, averaged over the probes around it. whole_noise:
    variance of a pixel of the delivered picture, averaged over all of the frame.
    """

    probes: Probes
    excess: NDArray[np.float64]
    remaining: NDArray[np.float64]
    smoothed_noise: NDArray[np.float64]
    noise: NDArray[np.float64]
    seen_noise: NDArray[np.float64]
    pixels: NDArray[np.float64]
    area: NDArray[np.float64]
    contrast: NDArray[np.float64]
    refined: NDArray[np.bool_]
    frame_area: float
    materials: ShownMaterials | None = None
    traced_noise: NDArray[np.float64] | None = None
    told_noise: NDArray[np.float64] | None = None
    whole_noise: float | None = None

    @property
    def mean_noise(self) -> float:
        """Variance of one pixel of the delivered picture, averaged over the warped part of the frame."""
        weight = self.probes.weight
        return float((weight * self.noise).sum() / weight.sum()) if weight.size else 0.0

    @property
    def neighbourhood_noise(self) -> NDArray[np.float64]:
        """Variance (N,) of one pixel of the delivered picture, averaged over each tile and those within two tiles of
        it."""
        weight = self.probes.weight
        noise = weight * self.noise
        return (self.probes.neighbour_sum(noise) + noise) / (self.probes.neighbour_sum(weight) + weight)

    @property
    def remaining_beyond_render(self) -> NDArray[np.float64]:
        """Squared error beyond that of a plain render (N,) that the frame still has in each tile: `remaining`, less the
        noise that was smoothed away. It is negative where the warp is less noisy than it is wrong."""
        return self.remaining - self.smoothed_noise

    @property
    def whole_frame_noise(self) -> float:
        """Variance of one pixel of the delivered picture, averaged over all of the frame: where only the probes tell
        it, holes count as being as noisy as the warped part."""
        return self.mean_noise if self.whole_noise is None else self.whole_noise

    @property
    def frame_noise(self) -> float:
        """Sum by weight, over all pixels of the frame, of the squared difference to be expected between two plain
        renders of it: 0 without any noise, else at least what rounding for a display makes it."""
        noise = self.whole_frame_noise
        return 2.0 * max(noise, ROUNDING_VARIANCE) * self.frame_area if noise else 0.0


def measure_tiles(
    probes: Probes,
    warped: NDArray[np.bool_],
    contrast: Contrast,
    traces: ProbeTraces,
    *,
    materials: NDArray[np.integer] | None = None,
    delivered: DeliveredNoise | None = None,
) -> TileEvidence:
    """Return the evidence of the probes for the pixels of `warped` (H, W), among which the probes' own pixels must be.

    contrast is that of the warped picture. materials (H, W) is a number for the materials that each pixel shows, None
    if unknown. delivered is the noise of a denoised picture; None where nothing is denoised, and the picture has that
    of the traces.
    """
    w, a, b = traces.toned(traces.finite)
    told = channel_mean((a - b) ** 2) / 2.0
    noise = told if delivered is None else delivered.light + delivered.alpha
    share = _heard_share(probes, told)
    expected = np.where(warped, contrast.signal + TUNING.noise_weight * contrast.noise + MIN_CONTRAST, 0.0)
    expected *= probes.of_pixels
    kept = traces.variance_share
    excess = probes.weight * share * (channel_mean((w - a) * (w - b)) - kept * told)
    smoothed = 1.0 - kept if delivered is None else 0.0
    return TileEvidence(
        probes=probes,
        excess=excess,
        remaining=excess,
        smoothed_noise=probes.weight * share * smoothed * told,
        noise=_heard_share(probes, noise) * noise,
        seen_noise=probes.tile_mean(contrast.noise, warped) if delivered is None else noise,
        pixels=probes.tile_sum(warped),
        area=probes.weighted_sum(warped),
        contrast=probes.tile_sum(expected),
        refined=np.zeros(w.shape[0], bool),
        frame_area=probes.frame_weight,
        materials=None if materials is None else _materials_in(probes, materials, expected, excess),
        traced_noise=None if delivered is None else delivered.traced,
        told_noise=None if delivered is None else probes.neighbourhood_mean(told),
        whole_noise=None if delivered is None else delivered.whole,
    )


@dataclass(frozen=True)
class DeliveredNoise:
    """Noise of a denoised picture: the variance of a pixel's light and of its alpha around each of N probes, of both as
    a mean over all of the frame (whole), and of both in a traced pixel around each probe."""

    light: NDArray[np.float64]
    alpha: NDArray[np.float64]
    whole: float
    traced: NDArray[np.float64]


def _materials_in(
    probes: Probes, materials: NDArray[np.integer], contrast: NDArray, found: NDArray[np.float64]
) -> ShownMaterials:
    """Return which of the materials (H, W) each tile shows, with the contrast (H, W) of the pixels of each.

    found (N,) is the excess that the probes found, which goes into the result as it is.
    """
    numbers = probes.on_grid(np.arange(probes.rows.size), 0)
    side = probes.spacing

    def row_of_tiles(row: int) -> tuple[NDArray, NDArray, NDArray]:
        band = slice(row * side, (row + 1) * side)
        rows, columns = np.nonzero(contrast[band] > 0.0)
        return numbers[row, columns // side], materials[band][rows, columns], contrast[band][rows, columns]

    pairs = materials_by_tile(row_of_tiles(row) for row in range(probes.tile_grid[0]))
    return ShownMaterials(*pairs, of_probe=materials[probes.rows, probes.columns].astype(np.intp), found=found)


def _heard_share(probes: Probes, noise: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the share (N,), 0 to 1, of each probe's evidence that counts, so that a single bright spark does not
    outweigh all.

    noise (N,) is what each probe measured. It is less than 1 where that is far above the noise of the probes around and
    of all others; where those have none, above that of rounding for a display.
    """
    everywhere = (noise.sum() - noise) / max(noise.size - 1, 1)
    nearby = probes.neighbour_sum(noise) / np.maximum(probes.neighbour_sum(np.ones_like(noise)), 1.0)
    others = np.maximum(nearby, everywhere)
    allowed = TUNING.max_probe_noise_ratio * np.where(others > 0.0, others, ROUNDING_VARIANCE)
    return allowed / np.maximum(noise, allowed)


@dataclass(frozen=True)
class RefinedTiles:
    """Tiles that were traced as a whole, because probes asked for it.

    tiles (N,) are set for them; P pixels were traced, those of `pixels` (H, W); warped and traced (P, >= 3) are their
    scene-linear colours before and after, row by row. variance_share, (H, W) or one for all, is the share of a pixel's
    variance that the lookup had kept. outliers (N,) are those of the tiles for which their own probe was a reason;
    None without any.
    """

    tiles: NDArray[np.bool_]
    pixels: NDArray[np.bool_]
    warped: NDArray
    traced: NDArray
    outliers: NDArray[np.bool_] | None = None
    variance_share: NDArray | float = 1.0


def with_refined(evidence: TileEvidence, done: RefinedTiles, noise: NDArray[np.float64]) -> TileEvidence:
    """Return the evidence after some tiles were traced: their excess is then known from all their pixels, and is gone
    from `remaining`.

    noise (N,) is the variance of one pixel of a plain render. For a tile that its own probe helped to choose, only as
    much is gone as all its pixels show. Such a probe stood out, so it may have told too much, as the probes of the
    tiles that stay have then told too little.

    The difference of a warped and a traced pixel has the mean square bias^2 + (1 + c) var, with c the variance_share of
    `done` and var the noise of a plain render.
    """
    refined = done.tiles
    finite = np.isfinite(done.warped).all(axis=-1) & np.isfinite(done.traced).all(axis=-1)
    known = done.pixels.copy()
    known[done.pixels] = finite
    error = np.zeros(known.shape)
    error[known] = squared_error(done.warped[finite], done.traced[finite])
    warped, traced = (evidence.probes.weighted_sum(known * share) for share in (done.variance_share, 1.0))
    off = evidence.probes.weighted_sum(error)
    excess, found = (
        off - here * warped - (here if evidence.traced_noise is None else evidence.traced_noise) * traced
        for here in (noise, evidence.neighbourhood_noise)
    )
    taken = evidence.remaining if done.outliers is None else np.where(done.outliers, found, evidence.remaining)
    return replace(
        evidence,
        excess=np.where(refined, excess, evidence.excess),
        remaining=np.where(refined, evidence.remaining - taken, evidence.remaining),
        smoothed_noise=np.where(refined, 0.0, evidence.smoothed_noise),
        refined=evidence.refined | refined,
    )
