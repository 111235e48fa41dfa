"""The estimator for a denoised picture, which has a fiftieth of the probes' noise: errors show beside that.

Three things together tell what one probe cannot. Slow changes have the same sign over many probes: they are told by
the mean of those and taken away (see `bias`). The probes of all tiles are a small picture of the target, and that too
can be denoised, with the same guides: what is left between it and the warped colours is an error, or a detail finer
than a tile. And materials of which much is off for their contrast are off elsewhere for theirs.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..images.contrast import Contrast, box_sum
from ..images.denoising import Denoising, denoiser_inputs
from ..images.effects_pass import materials_of
from ..images.metrics import squared_error, tone, untone
from ..images.passes import COLOUR_PASS, NOISY_PASS, Passes
from .bias import SourceNoise, bias_of
from .evidence import ProbeTraces, SelectionEvidence, TileEvidence, measure_tiles
from .probes import Probes, place_regular_probes
from .target import Provenance, Target
from .tuning import TUNING

MIN_NOISE = 1e-12
"""Variance that is added to the probes' own, so that a picture without noise divides by something."""


@dataclass(frozen=True)
class DenoisedEvidence:
    """Evidence of the probes of a denoised picture.

    colour (H, W, C) is the target's with its slow errors taken away. at_probes (N, 4) are the warped colours at the
    probes to be compared with their traces, corrected by what the other probes tell and shifted as noise shifts a
    trace. selection is what the probes' first traces tell, by which tiles are chosen.
    """

    colour: NDArray[np.float32]
    at_probes: NDArray[np.float32]
    selection: SelectionEvidence


@dataclass(frozen=True)
class DenoisedEstimator:
    """The `Estimator` for a denoised picture.

    contrast is that of the warped picture. noisy (H, W, 4) is the scene-linear colour that was warped from the source
    before that was denoised.
    """

    contrast: Contrast
    noisy: NDArray[np.float32]
    denoising: Denoising

    def place(self, warped: NDArray[np.bool_], *, spacing: int, seed: int) -> Probes:
        """Return probes at the same place in each tile of `spacing` pixels: together they are a small picture."""
        return place_regular_probes(warped, spacing=spacing, seed=seed)

    def measure(self, target: Target, probes: Probes, traces: ProbeTraces) -> tuple[Target, TileEvidence]:
        """Return the target with its slow errors corrected, and the evidence of its tiles, as `Estimator` says.

        The noisy colour of warped pixels is moved as the denoised one is, so that traced pixels are denoised among
        neighbours of their own brightness.
        """
        colour = target.colour.copy()
        colour[probes.mask] = traces.warped
        materials = materials_of(target.passes)
        # A pilot's probes keep the warped colour too.
        warped = target.warped | target.any_of(Provenance.PROBE)
        seen = self.analyse(probes, {**target.passes, COLOUR_PASS: colour}, warped, traces, materials)
        # The traced pixels are to be denoised among neighbours that are as bright as theirs.
        moved = np.where(target.warped[..., None], seen.colour - colour, 0.0)
        noisy = np.maximum(target.passes[NOISY_PASS] + moved, 0.0).astype(np.float32)
        target = replace(target, passes={**target.passes, COLOUR_PASS: seen.colour, NOISY_PASS: noisy})
        evidence = measure_tiles(
            probes,
            target.warped | probes.mask,
            self.contrast,
            replace(traces, warped=seen.at_probes),
            materials=materials,
            remaining_noise=self.denoising.remaining_noise,
            selection=seen.selection,
        )
        return target, evidence

    def analyse(
        self,
        probes: Probes,
        passes: Passes,
        warped: NDArray[np.bool_],
        traces: ProbeTraces,
        materials: NDArray[np.integer] | None,
    ) -> DenoisedEvidence:
        """Return what the probes tell of a target whose pixels in `warped` (H, W) have the warped, denoised colour.

        passes are the target's; materials (H, W) is a number for what each pixel shows, None where it is not known.
        """
        contrast, noisy = self.contrast.signal, self.noisy
        kinds = np.zeros(warped.shape, np.intp) if materials is None else materials
        noise_there = source_noise(probes, passes[COLOUR_PASS], noisy, warped)
        bias = bias_of(probes, traces, contrast, kinds, noise=noise_there)
        colour = bias.corrected(passes[COLOUR_PASS], warped, kinds)
        both = traces.once, noisy[probes.rows, probes.columns]
        target, source = _denoised_probes(probes, passes, both, self.denoising)
        before = traces.warped
        # A detail finer than a tile shows in one of the two, an error in both.
        told = np.minimum(squared_error(target, bias.at_probes(before)), squared_error(target, bias.at_probes(source)))
        noise = probes.neighbourhood_mean(squared_error(traces.once, traces.again)) + MIN_NOISE
        # Most tiles are right: what they are told to be off by is the noise of the telling.
        error = np.maximum(told - np.quantile(told / noise, TUNING.right_tiles_share) * noise, 0.0)
        own = error * probes.tile_sum(warped)
        by_material = _error_by_material(probes, error, np.where(warped, contrast, 0.0), kinds)
        share = TUNING.own_probe_share
        excess = share * own + (1.0 - share) * by_material
        light = untone(tone(bias.at_probes(before, without_own=True)) + noise_there.shift).astype(np.float32)
        expected = np.concatenate([light, before[:, 3:]], axis=-1)
        return DenoisedEvidence(colour, expected, SelectionEvidence(excess, _seen_noise(probes, passes, warped)))


def source_noise(
    probes: Probes, colour: NDArray[np.float32], noisy: NDArray[np.float32], warped: NDArray[np.bool_]
) -> SourceNoise:
    """Return the noise of the source's single pixels around each probe, by the difference of their noisy and denoised
    colours.

    colour is denoised, noisy is not, both (H, W, C). Only the pixels of warped (H, W) that are no probes count: they
    have both colours from the source.
    """
    known = warped & ~probes.mask
    change = np.where(known[..., None], tone(noisy).astype(np.float64) - tone(colour), 0.0)
    near = probes.rows, probes.columns
    side = TUNING.source_noise_reach_tiles * probes.spacing
    reach = side, side
    pixels = np.maximum(box_sum(known, reach)[near], 1.0)
    shift = np.stack([box_sum(change[..., channel], reach)[near] / pixels for channel in range(3)], axis=-1)
    squares = box_sum(np.mean(change**2, axis=-1), reach)[near] / pixels
    return SourceNoise(shift, np.maximum(squares - np.mean(shift**2, axis=-1), 0.0))


def _seen_noise(probes: Probes, passes: Passes, warped: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Return the variance (N,) of the source's noise close around each probe: of NOISY_PASS about the denoised colour.

    Only the pixels of warped (H, W) that are no probes count. It is 0 where there is none.
    """
    warped = warped & ~probes.mask
    squares = np.where(warped, squared_error(passes[NOISY_PASS], passes[COLOUR_PASS]), 0.0)
    near = probes.rows, probes.columns
    return box_sum(squares, TUNING.source_noise_reach_px)[near] / np.maximum(
        box_sum(warped, TUNING.source_noise_reach_px)[near], 1.0
    )


def _denoised_probes(
    probes: Probes, passes: Passes, colours: tuple[NDArray[np.float32], ...], denoising: Denoising
) -> list[NDArray[np.float32]]:
    """Return the probes' colours denoised, (N, 4) for each of the noisy `colours` (N, 4); alpha stays as it is.

    For this, each of these is made into a small picture of one pixel a tile. Tiles without a probe, and the passes that
    guide the denoiser, are filled from the target's `passes`.
    """
    height, width = probes.shape
    rows, columns = (
        np.minimum(np.arange(count) * probes.spacing + probes.spacing // 2, size - 1)
        for count, size in zip(probes.tile_grid, (height, width), strict=True)
    )
    rows, columns = (places.copy() for places in np.meshgrid(rows, columns, indexing="ij"))
    # A tile without a probe is traced throughout.
    rows[probes.tiles], columns[probes.tiles] = probes.rows, probes.columns
    small = {name: image[rows, columns] for name, image in denoiser_inputs(passes).items()}
    pictures = []
    for colour in colours:
        noisy = small[NOISY_PASS].copy()
        noisy[probes.tiles] = colour
        pictures.append({**small, NOISY_PASS: noisy})
    return [
        np.concatenate([clean[probes.tiles], colour[:, 3:]], axis=-1)
        for clean, colour in zip(denoising.denoise(pictures), colours, strict=True)
    ]


def _error_by_material(
    probes: Probes, error: NDArray, contrast: NDArray, shown: NDArray[np.integer]
) -> NDArray[np.float64]:
    """Return the squared error (N,), summed over each tile, if its pixels were as wrong as their materials are at the
    probes.

    error (N,) is what was found at each probe. It is summed by material and divided by the contrast there; each pixel
    of a tile then has its own contrast (H, W) times that of its material, shown (H, W). A material without a probe
    counts as right.
    """
    of_probe = shown[probes.rows, probes.columns]
    count = int(shown.max(initial=0)) + 1
    at_probes = np.bincount(of_probe, weights=contrast[probes.rows, probes.columns], minlength=count)
    off = np.bincount(of_probe, weights=error, minlength=count)
    per_contrast = np.where(at_probes > 0.0, off / np.where(at_probes > 0.0, at_probes, 1.0), 0.0)
    return probes.tile_sum(per_contrast[shown] * contrast)
