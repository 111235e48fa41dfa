"""What probes say of a denoised picture: of the noise that they have, it has a fiftieth, and errors show beside that.

Three things together tell what one probe cannot. Slow changes have the same sign over many probes: they are told by
the mean of those and taken away (see `bias`). The probes of all tiles are a small picture of the target, and that too
can be denoised, with the same guides: what is left between it and the warped colours is an error, or a detail finer
than a tile. And materials of which much is off for their contrast are off elsewhere for theirs.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..images.contrast import box_sum
from ..images.denoising import Denoising, guided
from ..images.metrics import squared_error, tone, untone
from ..images.passes import COLOUR_PASS, NOISY_PASS, Passes
from .bias import SourceNoise, bias_of
from .probes import Probes, SelectionEvidence

BELIEVED = 0.5
"""Share of what a tile is taken to be off by that its own probe tells, the rest being told by its material."""

MOST = 0.75
"""Share of the tiles that are taken to be right."""

NOISE_REACH = (4, 4)
"""Pixels, down and across, over which the source's noise is averaged."""

NOISE_TILES = 2
"""Tiles each way over which all pixels tell what noise does to the probes'."""

NOISELESS = 1e-12


@dataclass(frozen=True)
class DenoisedEvidence:
    """The colour (H, W, C) with its bias taken away; what a trace of the probes is then expected to have (N, 3),
    as if their own had not been heard; and what the first traces tell."""

    colour: NDArray[np.float32]
    at_probes: NDArray[np.float32]
    first: SelectionEvidence


def look(
    probes: Probes,
    passes: Passes,
    warped: NDArray[np.bool_],
    traces: tuple[NDArray[np.float32], NDArray[np.float32]],
    before: NDArray[np.float32],
    *,
    noisy: NDArray[np.float32],
    risk: NDArray[np.float32],
    shown: NDArray[np.integer] | None,
    denoising: Denoising,
) -> DenoisedEvidence:
    """passes are the target's, with the traced pixels among them; warped (H, W) the pixels whose colour is not traced.

    traces are the scene-linear colours (N, 4) of each probe's two, before (N, C) what the warp had there, and noisy
    (H, W, 4) what it has of the source before that was denoised. risk (H, W)
    is what may be wrong, shown (H, W) a number for what each pixel shows, if that is known.
    """
    once, again = traces
    kinds = np.zeros(warped.shape, np.intp) if shown is None else shown
    noise_there = _source_noise(probes, passes[COLOUR_PASS], noisy, warped)
    bias = bias_of(probes, before, once, again, risk, kinds, noise=noise_there)
    colour = bias.corrected(passes[COLOUR_PASS], warped, kinds)
    target, source = _denoised_probes(probes, passes, (once, noisy[probes.rows, probes.columns]), denoising)
    # A detail finer than a tile shows in one of the two, an error in both.
    told = np.minimum(squared_error(target, bias.at_probes(before)), squared_error(target, bias.at_probes(source)))
    noise = probes.around_and_own(squared_error(once, again)) + NOISELESS
    # Most tiles are right: what they are told to be off by is the noise of the telling.
    error = np.maximum(told - np.quantile(told / noise, MOST) * noise, 0.0)
    own, by_material = error * probes.in_tiles(warped), _by_material(probes, error, np.where(warped, risk, 0.0), kinds)
    likely = BELIEVED * own + (1.0 - BELIEVED) * by_material
    expected = untone(tone(bias.at_probes(before, without_own=True)) + noise_there.shift).astype(np.float32)
    return DenoisedEvidence(colour, expected, SelectionEvidence(likely, _seen_noise(probes, passes, warped)))


def _source_noise(
    probes: Probes, colour: NDArray[np.float32], noisy: NDArray[np.float32], warped: NDArray[np.bool_]
) -> SourceNoise:
    """By the warped pixels (H, W) that are no probes, whose denoised colour (H, W, C) is known beside the noisy one."""
    known = warped & ~probes.mask
    change = np.where(known[..., None], tone(noisy).astype(np.float64) - tone(colour), 0.0)
    near = probes.rows, probes.columns
    reach = NOISE_TILES * probes.spacing, NOISE_TILES * probes.spacing
    pixels = np.maximum(box_sum(known, reach)[near], 1.0)
    shift = np.stack([box_sum(change[..., channel], reach)[near] / pixels for channel in range(3)], axis=-1)
    squares = box_sum(np.mean(change**2, axis=-1), reach)[near] / pixels
    return SourceNoise(shift, np.maximum(squares - np.mean(shift**2, axis=-1), 0.0))


def _seen_noise(probes: Probes, passes: Passes, warped: NDArray[np.bool_]) -> NDArray[np.float64]:
    """(N,): how far the source's pixels are from their denoised ones around each probe, in the mean of squares."""
    warped = warped & ~probes.mask
    squares = np.where(warped, squared_error(passes[NOISY_PASS], passes[COLOUR_PASS]), 0.0)
    near = probes.rows, probes.columns
    return box_sum(squares, NOISE_REACH)[near] / np.maximum(box_sum(warped, NOISE_REACH)[near], 1.0)


def _denoised_probes(
    probes: Probes, passes: Passes, colours: tuple[NDArray[np.float32], ...], denoising: Denoising
) -> list[NDArray[np.float32]]:
    """(N, 3) each: colours (N, 4) of the probes' pixels, denoised as a picture of one pixel a tile."""
    height, width = probes.shape
    rows, columns = (
        np.minimum(np.arange(count) * probes.spacing + probes.spacing // 2, size - 1)
        for count, size in zip(probes.tile_grid, (height, width), strict=True)
    )
    rows, columns = (places.copy() for places in np.meshgrid(rows, columns, indexing="ij"))
    # A tile without a probe is traced throughout.
    rows[probes.tiles], columns[probes.tiles] = probes.rows, probes.columns
    small = {name: image[rows, columns] for name, image in guided(passes).items()}
    pictures = []
    for colour in colours:
        noisy = small[NOISY_PASS].copy()
        noisy[probes.tiles] = colour
        pictures.append({**small, NOISY_PASS: noisy})
    return [clean[probes.tiles] for clean in denoising.denoise(pictures)]


def _by_material(probes: Probes, error: NDArray, risk: NDArray, shown: NDArray[np.integer]) -> NDArray[np.float64]:
    """(N,) what each tile is off by, were every pixel so for its risk as its material is at the probes."""
    of_probe = shown[probes.rows, probes.columns]
    count = int(shown.max(initial=0)) + 1
    at_risk = np.bincount(of_probe, weights=risk[probes.rows, probes.columns], minlength=count)
    off = np.bincount(of_probe, weights=error, minlength=count)
    per_risk = np.where(at_risk > 0.0, off / np.where(at_risk > 0.0, at_risk, 1.0), 0.0)
    return probes.in_tiles(per_risk[shown] * risk)
