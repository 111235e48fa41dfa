"""The warp stage as a whole: steps in depth, grid, forward warp, and which pixels it leaves to be traced."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import cast

import numpy as np
from numpy.typing import NDArray

from ..images.contrast import contrast_of, gradient_of
from ..images.effects import Effect
from ..images.effects_pass import shows
from ..images.lookup import touches
from ..images.masks import dilate
from ..images.passes import COLOUR_PASS, DEPTH_PASS, LENGTH_PASS, MASKED_PASS, Passes, known_depth, seen_in_mirrors
from ..images.reasons import Reason
from ..settings.accuracy import Accuracy
from ..views.camera import Camera, PerspectiveCamera, see_the_same
from ..views.frustum import Lens, covered_by
from ..warp.discontinuities import TEAR, DepthDiscontinuities, disparity_of, disparity_of_nearness, disparity_steps
from ..warp.forward import Warp, narrow
from ..warp.grid import Grid
from ..warp.mirrors import Images, images_in_mirrors, seen_in_both
from ..warp.motion import Moving
from ..warp.warper import Warper, warp_view
from .defocus import blurred_edges, circle_of_confusion, in_focus, nearer_side
from .silhouettes import differing, edge_band
from .thin import THRESHOLD, sparse, target_pixels, thin_things
from .transmission import transmission_parallax

PINHOLE = Lens()

TOUCHED = 0.02
"""Share of a looked-up colour that may come from a pixel that should not be looked up."""

FUR = 3
"""Pixels each way within which nothing but hair makes it fur: as far as an edge's sides are looked at."""


@dataclass(frozen=True)
class InMirrors:
    """What the target's mirrors show: shown (H, W) the pixels in which there is one, images what a warp of the images
    has there, strayed (H, W) where that has something else, or is right beside it."""

    shown: NDArray[np.bool_]
    images: Reprojection
    strayed: NDArray[np.bool_]

    def reasons_at(self, accuracy: Accuracy) -> NDArray[np.uint16]:
        """(H, W) flags of the pixels in which there is a mirror."""
        reasons = self.images.reasons_at(accuracy)
        reasons[(reasons == 0) & self.strayed] |= Reason.VIEW_DEPENDENT.bit
        return np.where(self.shown, reasons, np.uint16(0))


@dataclass(frozen=True)
class Reprojection:
    """The source's passes as the target sees them, and where they are not the answer. grid and warp are of surfaces;
    warped_by is numpy or gpu."""

    passes: Passes
    grid: Grid
    warp: Warp
    marking: HoleClassifier
    accuracy: Accuracy
    warped_by: str
    mirrors: InMirrors | None = None

    @cached_property
    def reasons(self) -> NDArray[np.uint16]:
        """(H, W) `Reason` flags."""
        return self.reasons_at(self.accuracy)

    def reasons_at(self, accuracy: Accuracy) -> NDArray[np.uint16]:
        """The flags that another accuracy would set, of the same warp."""
        reasons = self.marking.reasons(self.passes, self.warp, accuracy)
        return reasons if self.mirrors is None else reasons | self.mirrors.reasons_at(accuracy)

    def sampled(self, place: tuple[NDArray[np.intp], NDArray[np.intp]]) -> NDArray[np.float32]:
        """(N, C): the colours of the source's own pixels, of each the nearest to what is seen at rows and columns (N,),
        with the noise of a single one."""
        colour = self.marking.source[COLOUR_PASS]
        rows, columns = (
            np.clip(np.nan_to_num(at[place]), 0, size - 1).astype(np.intp)
            for at, size in zip((self.warp.y, self.warp.x), colour.shape, strict=False)
        )
        return colour[rows, columns]


def reproject(
    source: Passes,
    source_camera: Camera,
    target_camera: Camera,
    *,
    accuracy: Accuracy,
    invalid: NDArray[np.bool_],
    grid_threshold: float = 1.0,
    interpolation: str = "linear",
    colour_interpolation: str | None = None,
    lens: Lens = PINHOLE,
    volumes: Sequence[NDArray] = (),
    motion: tuple[Moving, Moving] | None = None,
    warp_view: Warper = warp_view,
) -> Reprojection:
    """Warp the source into the target and flag what is known beforehand to need tracing.

    source holds the colour (H, W, 4) and depth (H, W, 1) passes, and any other; invalid (H, W) marks source pixels
    whose colour is no number; grid_threshold is in arc minutes; lens is both eyes'. volumes are the corners (8, 3) of
    boxes in the world that hold the scene's volumes, infinite for one that is everywhere. motion and both
    interpolations are as for `warp_passes`. What flat mirrors show is warped by where its image stands. warp_view is
    numpy's or a GPU's.
    """

    source = {**source, DEPTH_PASS: known_depth(source[DEPTH_PASS])}

    def carried(passes: Passes) -> Reprojection:
        made = warp_view(
            passes,
            source_camera,
            target_camera,
            grid_threshold=grid_threshold,
            interpolation=interpolation,
            colour_interpolation=colour_interpolation,
            motion=motion,
        )
        disparity = disparity_of(passes[DEPTH_PASS][..., 0], source_camera, target_camera)
        steps = made.steps or disparity_steps(disparity)
        cubic = "cubic" in (interpolation, colour_interpolation)
        marking = HoleClassifier(
            passes, source_camera, target_camera, disparity, steps, made.empty, invalid, cubic, lens, volumes
        )
        return Reprojection(made.passes, made.grid, made.warp, marking, accuracy, made.by)

    seen = carried(source)
    if not (accuracy.silhouette_radius > 0 and _lengths_tell(source_camera, target_camera, lens, volumes)):
        return seen
    found = images_in_mirrors(source, cast("PerspectiveCamera", source_camera), clip_start=lens.near)
    if found is None:
        return seen
    in_mirrors = {name: image for name, image in source.items() if seen_in_mirrors(name)}
    return _with_mirrors(seen, carried({**in_mirrors, DEPTH_PASS: found.depth[..., None]}), found)


def _lengths_tell(camera: Camera, other: Camera, lens: Lens, volumes: Sequence[NDArray]) -> bool:
    """Whether the lengths of a perspective camera's rays tell what moves otherwise than its depth says: what is out of
    focus mixes depths everywhere, and a volume has none."""
    mixed = lens.aperture or len(volumes)
    return isinstance(camera, PerspectiveCamera) and not mixed and not see_the_same(camera, other)


def _with_mirrors(seen: Reprojection, images: Reprojection, found: Images) -> Reprojection:
    """The view warped by surfaces, with what the source's mirrors show warped by images."""
    shown, same = seen_in_both(seen.marking.source, found, seen.warp, images.warp)
    # Depth that is filtered as colours are has no sharp edge: along a mirror's, what is beside it may look alike.
    strayed = dilate(~same, 1)
    passes = {
        name: np.where(shown[..., None], images.passes[name], image) if seen_in_mirrors(name) else image
        for name, image in seen.passes.items()
    }
    return replace(seen, passes=passes, mirrors=InMirrors(shown, images, strayed))


@dataclass(frozen=True)
class HoleClassifier:
    """All that flagging pixels needs, but for what was warped and how accurate it is to be."""

    source: Passes
    source_camera: Camera
    target_camera: Camera
    disparity: NDArray[np.float32]
    steps: DepthDiscontinuities
    empty: NDArray[np.uint16]
    """(H, W) flags of the target's pixels on which nothing landed."""
    invalid: NDArray[np.bool_]
    cubic: bool
    """Whether a pass was looked up so."""
    lens: Lens
    volumes: Sequence[NDArray]

    def reasons(self, warped: Passes, warp: Warp, accuracy: Accuracy) -> NDArray[np.uint16]:
        """(H, W) `Reason` flags of the target's pixels."""
        reasons = self.empty.copy()
        answered = reasons == 0
        blurred = _source_silhouettes(self, accuracy) | self._thin_things(accuracy)
        target = _TargetEdges(self, warped, warp)
        edges = target.silhouettes(reasons, accuracy) | touches(blurred, warp.x, warp.y, share=TOUCHED)
        edges |= self._one_pixel_wide(warp, blurred, accuracy)
        if accuracy.promise is not None and accuracy.colour_tolerance > 0.0:
            edges &= ~_within_fur(warped, warp)
        reasons[answered & edges] |= Reason.SILHOUETTE.bit
        if accuracy.promise is not None:
            known = target.known_beforehand(accuracy)
            if len(self.volumes) and not see_the_same(self.source_camera, self.target_camera):
                empty = np.isposinf(warped[DEPTH_PASS][..., 0])
                known[Reason.VOLUME] = empty & covered_by(self.volumes, self.target_camera, self.lens)
            for reason, pixels in known.items():
                reasons[answered & pixels] |= reason.bit
        if MASKED_PASS in self.source:
            masked = self.source[MASKED_PASS][..., 0] > 0.0
            reasons[answered & touches(masked, warp.x, warp.y, share=TOUCHED)] |= Reason.VIEW_DEPENDENT.bit
        if self.invalid.any():
            # The cubic kernel reaches one pixel further, and no share of what is no number may be had.
            spoilt = dilate(self.invalid, 1) if self.cubic else self.invalid
            reasons[answered & touches(spoilt, warp.x, warp.y, share=0.0)] |= Reason.INVALID.bit
        return reasons

    def _one_pixel_wide(self, warp: Warp, blurred: NDArray[np.bool_], accuracy: Accuracy) -> NDArray[np.bool_]:
        """(H, W) target pixels: what has next to no area in the grid shows on either side of where it lands."""
        depth = self.source[DEPTH_PASS][..., 0]
        alone = narrow(depth, cut_right=self.steps.right > TEAR, cut_down=self.steps.down > TEAR)
        landed = target_pixels(sparse(alone) & blurred, depth, self.source_camera, self.target_camera, warp)
        return dilate(landed, accuracy.silhouette_radius)

    def _thin_things(self, accuracy: Accuracy) -> NDArray[np.bool_]:
        """(H, W) source pixels: what their depth misses shows, where it moves, as a silhouette would."""
        length, depth = self.source.get(LENGTH_PASS), self.source[DEPTH_PASS][..., 0]
        camera, other = self.source_camera, self.target_camera
        tell = accuracy.silhouette_radius > 0 and _lengths_tell(camera, other, self.lens, self.volumes)
        if length is None or not tell:
            return np.zeros(depth.shape, bool)
        camera = cast("PerspectiveCamera", camera)
        edges = self.steps.beside(min(accuracy.silhouette_step, THRESHOLD))
        return thin_things(length[..., 0], depth, camera, other, edges=edges, clip_start=self.lens.near)


def _strands(passes: Passes) -> NDArray[np.bool_]:
    """(H, W): hair, which may be thinner than a pixel: its one depth does not tell which side a pixel's colour is."""
    return shows(passes, Effect.HAIR)


def _within_fur(warped: Passes, warp: Warp) -> NDArray[np.bool_]:
    """(H, W): pixels around which all that was warped is hair.

    There every pixel has an edge beside it, and most have hair of the same look on both sides: probes tell where not.
    """
    strands = _strands(warped)
    return strands & ~dilate(warp.covered & ~strands, FUR) if strands.any() else strands


def _source_silhouettes(marking: HoleClassifier, accuracy: Accuracy) -> NDArray[np.bool_]:
    """(H, W) source pixels that mix what the two sides of an edge show."""
    blur = circle_of_confusion(marking.source[DEPTH_PASS][..., 0], marking.source_camera, marking.lens)
    steps = in_focus(marking.steps, blur)
    band = edge_band(steps, threshold=accuracy.silhouette_step, radius=accuracy.silhouette_radius)
    unknown = marking.invalid | ~np.isfinite(marking.disparity) | _strands(marking.source)
    colour = marking.source[COLOUR_PASS]
    return differing(band, marking.disparity, colour, tolerance=accuracy.colour_tolerance, unknown=unknown)


class _TargetEdges:
    """Edges of the target eye, judged by the warped depth: what a plain render would filter or blur over them."""

    def __init__(self, marking: HoleClassifier, warped: Passes, warp: Warp) -> None:
        self._marking, self._warped, self._warp = marking, warped, warp
        source, target = marking.source_camera, marking.target_camera
        self._disparity = disparity_of_nearness(warp.nearness, target, source)
        np.copyto(self._disparity, np.nan, where=~warp.covered)
        self._steps = disparity_steps(self._disparity)
        depth = warped[DEPTH_PASS][..., 0]
        self._blur = circle_of_confusion(depth, target, marking.lens)

    def silhouettes(self, empty: NDArray[np.uint16], accuracy: Accuracy) -> NDArray[np.bool_]:
        """(H, W). Beside a disoccluded pixel the other side's colour is not known yet: there the band is always
        traced."""
        steps = in_focus(self._steps, self._blur)
        band = edge_band(steps, threshold=accuracy.silhouette_step, radius=accuracy.silhouette_radius)
        unknown = ~self._warp.covered | _strands(self._warped)
        colour = self._warped[COLOUR_PASS]
        edges = differing(band, self._disparity, colour, tolerance=accuracy.colour_tolerance, unknown=unknown)
        return edges | dilate((empty & Reason.DISOCCLUDED.bit) > 0, accuracy.silhouette_radius)

    def known_beforehand(self, accuracy: Accuracy) -> dict[Reason, NDArray[np.bool_]]:
        """(H, W) by reason: what cannot be warped, as far as that shows; no probe need tell."""
        glass = shows(self._warped, Effect.TRANSMISSION)
        blurred, through = bool(self._marking.lens.aperture), bool(glass.any())
        if not (blurred or through):
            return {}
        colour, covered = self._warped[COLOUR_PASS], self._warp.covered
        gradient, contrast = gradient_of(colour, covered), contrast_of(colour, covered)
        result = {}
        if blurred:
            radius = nearer_side(self._blur, self._disparity)
            step, tolerance = accuracy.silhouette_step, accuracy.colour_tolerance
            result[Reason.DEFOCUS] = blurred_edges(
                self._steps, radius, gradient, contrast, threshold=step, tolerance=tolerance
            )
        if through and isinstance(self._marking.target_camera, PerspectiveCamera):
            limit, unseen = accuracy.tile_limit, accuracy.unseen
            result[Reason.TRANSPARENT] = transmission_parallax(
                glass, self._disparity, gradient, contrast, limit=limit, unseen=unseen
            )
        return result
