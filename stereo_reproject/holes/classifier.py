"""The hole classifier: which pixels of a warped view must be traced, and for what reason, by the rules of this room."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import cast

import numpy as np
from numpy.typing import NDArray

from ..images.contrast import contrast_of, gradient_of, window_reach
from ..images.effects import Effect
from ..images.effects_pass import shows
from ..images.lookup import lookup_without, touches
from ..images.masks import box_around, dilate, opened
from ..images.passes import COLOUR_PASS, DEPTH_PASS, LENGTH_PASS, MASKED_PASS, Passes, filtered
from ..images.reasons import Reason
from ..images.sides import mend_sides
from ..settings.accuracy import Accuracy
from ..views.camera import Camera, PerspectiveCamera, see_the_same
from ..views.frustum import Lens, covered_by
from ..views.view import View
from ..warp.discontinuities import DepthDiscontinuities, disparity_of, disparity_of_nearness, disparity_steps
from ..warp.forward import Warp, sub_pixel_features
from ..warp.options import WarpOptions
from ..warp.rendered_view import RenderedView
from ..warp.warped_view import WarpedView
from .behind_tears import behind_tears
from .defocus import blurred_edges, circle_of_confusion, in_focus, nearer_side
from .detail import fine_detail
from .silhouettes import differing, edge_band, mixed_and_contrasting
from .thin import isolated, target_pixels, thin_things
from .transmission import transmission_parallax
from .tuning import TUNING

PINHOLE = Lens()


@dataclass(frozen=True)
class Optics:
    """Facts of a scene that its passes do not tell: the lens of both views, and the places of volumes.

    volumes: for each volume the corners (8, 3), in the world, of a box around it; infinite for a volume that is
    everywhere.
    """

    lens: Lens = PINHOLE
    volumes: Sequence[NDArray] = ()


NO_OPTICS = Optics()
"""A pinhole, and no volume."""


def ray_lengths_tell(source: Camera, target: Camera, optics: Optics) -> bool:
    """Return whether the LENGTH_PASS of a source with this camera may be read, to find thin things and the images in
    flat mirrors: where it can be, if anything moves between source and target."""
    return has_ray_lengths(source, optics) and not see_the_same(source, target)


def has_ray_lengths(source: Camera, optics: Optics) -> bool:
    """Return whether the LENGTH_PASS of a source with this camera can be read for any target.

    It can for a perspective camera. It cannot where the lens blurs, since that mixes depths everywhere, nor where there
    is a volume, which has no depth.
    """
    mixed = optics.lens.aperture or len(optics.volumes)
    return isinstance(source, PerspectiveCamera) and not mixed


@dataclass(frozen=True)
class SourceEdges:
    """Source pixels at edges, by the thresholds of one accuracy.

    band (H, W): pixels so near a depth edge that their colour may mix its two sides. contrasting (H, W): those of them
    beside an edge of high contrast. unusable (H, W): those of them whose colour is mixed, and pixels with something
    thin before the surface that their depth tells of. max_weight: share of a lookup's weight that unusable pixels may
    have in a target pixel that is not traced. left_out: True where they are then left out of the lookup.
    """

    band: NDArray[np.bool_]
    contrasting: NDArray[np.bool_]
    unusable: NDArray[np.bool_]
    max_weight: float
    left_out: bool


@dataclass(frozen=True)
class HoleClassifier:
    """The rules by which target pixels are flagged to be traced, with all that they need to know of one source.

    steps are the discontinuities of the source's disparity towards the target. cubic: True where a pass was looked up
    with the cubic kernel.
    """

    source: RenderedView
    target: View
    steps: DepthDiscontinuities
    optics: Optics
    cubic: bool

    @classmethod
    def of_source(
        cls, source: RenderedView, target: View, warped: WarpedView, optics: Optics, options: WarpOptions
    ) -> HoleClassifier:
        """Return the classifier for a view that was warped from this source to this target with these options."""
        steps = warped.steps or disparity_steps(disparity_of(source.depth, source.camera, target.camera))
        return cls(source, target, steps, optics, options.cubic)

    def source_edges(self, accuracy: Accuracy) -> SourceEdges:
        """Return the source's pixels at edges by this accuracy. With a colour_tolerance of 0 no lookup leaves any
        out."""
        band, mixed, contrasting = found = self._at_edges(accuracy)
        mend_sides(found, lambda columns: self._of_columns(columns)._at_edges(accuracy), wraps=self.source.wraps)
        left_out = accuracy.colour_tolerance > 0.0
        max_weight = TUNING.max_left_out_weight if left_out else TUNING.max_flagged_weight
        return SourceEdges(band, contrasting, mixed | self._thin_things(accuracy), max_weight, left_out)

    def _at_edges(self, accuracy: Accuracy) -> tuple[NDArray[np.bool_], NDArray[np.bool_], NDArray[np.bool_]]:
        """Return three masks (H, W) of the source: pixels beside steps in depth, those of them whose colour is mixed,
        and those at edges of high contrast, as `SourceEdges` says."""
        blur = circle_of_confusion(self.source.depth, self.source.camera, self.optics.lens)
        steps = in_focus(self.steps, blur)
        band = edge_band(steps, threshold=accuracy.silhouette_step, radius=accuracy.silhouette_radius)
        disparity = disparity_of(self.source.depth, self.source.camera, self.target.camera)
        unknown = ~np.isfinite(disparity) | _strands(self.source.passes)
        if self.source.invalid is not None:
            unknown |= self.source.invalid
        colour = self.source.passes[COLOUR_PASS]
        return band, *mixed_and_contrasting(
            band, disparity, colour, tolerance=accuracy.colour_tolerance, unknown=unknown
        )

    def _of_columns(self, columns: NDArray[np.intp]) -> HoleClassifier:
        """Return the classifier of some columns of the source, whose indices are given, for what neighbours in the
        source tell alone."""
        source = self.source.of_columns(columns)
        steps = disparity_steps(disparity_of(source.depth, source.camera, self.target.camera))
        return replace(self, source=source, steps=steps)

    def without_unusable(self, warped: WarpedView, edges: SourceEdges) -> WarpedView:
        """Return the warped view with the pixels looked up anew whose lookup takes some of its weight, but no more than
        edges.max_weight, from unusable pixels: of the passes that may be mixed, they take the other pixels alone.

        Where a pass is looked up cubically, so are pixels beside these and beside edges of high contrast. The new
        lookups are linear. Where hair is around hair they stay: nothing there is traced for its edges, so nothing tells
        what is unusable. The passes are changed in place: no one else has them yet.
        """
        if not edges.left_out:
            return warped
        x, y = warped.warp.x, warped.warp.y
        # The cubic kernel reaches one pixel further, and takes colours of beyond the edge where no weight is theirs.
        reached, wraps = edges.unusable, self.source.wraps
        if self.cubic:
            reached = dilate(edges.unusable | edges.contrasting, 1, wraps=wraps)
        pixels = touches(reached, x, y, share=TUNING.max_flagged_weight, wraps=wraps) & ~_within_fur(warped, wraps)
        at = x[None, pixels], y[None, pixels]
        pixels[pixels] = ~touches(edges.unusable, *at, share=edges.max_weight, wraps=wraps)[0]
        if not pixels.any():
            return warped
        for name in filter(filtered, warped.passes):
            image = warped.passes[name]
            image[pixels] = lookup_without(self.source.passes[name], x[pixels], y[pixels], edges.unusable, wraps=wraps)
        if warped.sharpness is not None and warped.sharpness.single is not None:
            warped.sharpness.single[pixels] = False
        return warped

    def reasons(self, warped: WarpedView, accuracy: Accuracy, edges: SourceEdges) -> NDArray[np.uint16]:
        """Return (H, W) `Reason` flags of the pixels of a warped view; 0 for those that need no tracing.

        They include the view's own flags of empty pixels, which get no others. accuracy has the thresholds, and edges
        are the source's by the same accuracy.
        """
        warp, reasons, wraps = warped.warp, warped.empty.copy(), self.source.wraps
        hidden = behind_tears(self.source.depth, self.steps, self.source.camera, self.target.camera, warp)
        reasons[(reasons == 0) & hidden] = Reason.DISOCCLUDED.bit
        answered = reasons == 0
        target = _TargetEdges(self, warped, accuracy)
        silhouettes = target.silhouettes(edges)
        mend_sides(
            [silhouettes],
            lambda columns: [_TargetEdges(self, warped.of_columns(columns), accuracy).silhouettes(edges)],
            wraps=wraps,
        )
        silhouettes |= touches(edges.unusable, warp.x, warp.y, share=edges.max_weight, wraps=wraps)
        silhouettes |= self._sub_pixel_features(warp, edges.unusable, accuracy)
        if accuracy.promise is not None and accuracy.colour_tolerance > 0.0:
            silhouettes &= ~_within_fur(warped, wraps)
        reasons[answered & silhouettes] |= Reason.SILHOUETTE.bit
        if accuracy.promise is not None:
            fine = fine_detail(self.source, warped, answered & ~silhouettes, accuracy)
            reasons[answered & fine] |= Reason.DETAIL.bit
            for reason, pixels in (target.seen_through_or_blurred() | self._volumes(warped)).items():
                reasons[answered & pixels] |= reason.bit
        if MASKED_PASS in self.source.passes:
            masked = self.source.passes[MASKED_PASS][..., 0] > 0.0
            touched = touches(masked, warp.x, warp.y, share=TUNING.max_flagged_weight, wraps=wraps)
            reasons[answered & touched] |= Reason.VIEW_DEPENDENT.bit
        invalid = self.source.invalid
        if invalid is not None and invalid.any():
            # The cubic kernel reaches one pixel further, and no share of what is no number may be had.
            reached = dilate(invalid, 1, wraps=wraps) if self.cubic else invalid
            reasons[answered & touches(reached, warp.x, warp.y, share=0.0, wraps=wraps)] |= Reason.INVALID.bit
        return reasons

    def _sub_pixel_features(self, warp: Warp, unusable: NDArray[np.bool_], accuracy: Accuracy) -> NDArray[np.bool_]:
        """Return (H, W) target pixels on and beside which wires and other things about as thin as a pixel land.

        The grid draws next to nothing of such things. Only those count whose pixels are set in `unusable` (H, W), as
        `SourceEdges` has it.
        """
        depth, wraps, alone = self.source.depth, self.source.wraps, self._alone()
        mend_sides([alone], lambda columns: [self._of_columns(columns)._alone()], wraps=wraps)
        landed = target_pixels(alone & unusable, depth, self.source.camera, self.target.camera, warp)
        return dilate(landed, accuracy.silhouette_radius, wraps=wraps)

    def _alone(self) -> NDArray[np.bool_]:
        """Return (H, W) the source's pixels of wires and other things about as thin as a pixel."""
        cut_right, cut_down = self.steps.torn()
        return isolated(sub_pixel_features(self.source.depth, cut_right=cut_right, cut_down=cut_down))

    def _thin_things(self, accuracy: Accuracy) -> NDArray[np.bool_]:
        """Return (H, W) source pixels in which something thin stands before the surface that their depth tells of.

        With them come the pixels over which it moves in the target. No pixel is set where LENGTH_PASS is missing or may
        not be read.
        """
        length, depth = self.source.passes.get(LENGTH_PASS), self.source.depth
        tell = accuracy.silhouette_radius > 0 and ray_lengths_tell(self.source.camera, self.target.camera, self.optics)
        if length is None or not tell:
            return np.zeros(depth.shape, bool)
        camera = cast("PerspectiveCamera", self.source.camera)
        edges = self.steps.mask(min(accuracy.silhouette_step, TUNING.thin_step_pixels))
        near = self.optics.lens.near
        return thin_things(length[..., 0], depth, camera, self.target.camera, edges=edges, clip_start=near)

    def _volumes(self, warped: WarpedView) -> dict[Reason, NDArray[np.bool_]]:
        """Return, under the reason VOLUME, (H, W) target pixels of the sky that a volume may cover.

        The dictionary is empty without volumes, and where nothing moves between source and target.
        """
        if not len(self.optics.volumes) or see_the_same(self.source.camera, self.target.camera):
            return {}
        sky = np.isposinf(warped.passes[DEPTH_PASS][..., 0])
        return {Reason.VOLUME: sky & covered_by(self.optics.volumes, self.target.camera, self.optics.lens)}


def _strands(passes: Passes) -> NDArray[np.bool_]:
    """Return (H, W) the pixels that are known to show hair, by the effects pass; none without that pass.

    Silhouettes take their depth and colours for unknown: a strand may be thinner than a pixel, whose one depth then
    does not tell which side of an edge it is on.
    """
    return shows(passes, Effect.HAIR)


def _within_fur(warped: WarpedView, wraps: bool) -> NDArray[np.bool_]:
    """Return (H, W) target pixels that show hair and around which everything that was warped is hair too. A view that
    wraps goes on at its left beyond its right side.

    There every pixel has an edge beside it, and most have hair of the same look on both sides. So they are not traced
    as silhouettes, and probes find those that are wrong.
    """
    strands = _strands(warped.passes)
    if not strands.any():
        return strands
    return strands & ~dilate(warped.warp.covered & ~strands, TUNING.fur_pixels, wraps=wraps)


class _TargetEdges:
    """Edges of the target, found by the warped depth: a plain render would filter or blur its colours over them.

    accuracy has the thresholds by which all of its pixels are found.
    """

    def __init__(self, classifier: HoleClassifier, warped: WarpedView, accuracy: Accuracy) -> None:
        self._accuracy = accuracy
        self._passes, self._warp, self._empty = warped.passes, warped.warp, warped.empty
        self._wraps = classifier.source.wraps
        source, target = classifier.source.camera, classifier.target.camera
        self._lens, self._is_perspective = classifier.optics.lens, isinstance(target, PerspectiveCamera)
        self._disparity = disparity_of_nearness(warped.warp.nearness, target, source)
        np.copyto(self._disparity, np.nan, where=~warped.warp.covered)
        steps = disparity_steps(self._disparity)
        self._blur = circle_of_confusion(warped.passes[DEPTH_PASS][..., 0], target, self._lens)
        self._band = edge_band(
            in_focus(steps, self._blur), threshold=accuracy.silhouette_step, radius=accuracy.silhouette_radius
        )
        # Of a picture that is sharp all over, the steps tell nothing more.
        self._steps = steps if self._lens.aperture else None

    def silhouettes(self, edges: SourceEdges) -> NDArray[np.bool_]:
        """Return (H, W) target pixels whose colour mixes the two sides of a depth edge that look different.

        Where a lookup takes min_band_weight (a quarter) of its weight from the band of the source, the target shows an
        edge that the source has too, and the source's colours have been judged there; but it lies elsewhere within the
        pixel, and so counts where its contrast is high. Beside other pixels stands something that does not in the
        source: there the sides are compared. Pixels right beside disoccluded ones are set where fragments of surfaces
        lie between those, as their depth is noise. With a colour_tolerance of 0 all pixels at edges are set, and all
        beside a disoccluded one.
        """
        band, accuracy = self._band, self._accuracy
        disoccluded = (self._empty & Reason.DISOCCLUDED.bit) > 0
        ring = dilate(disoccluded, accuracy.silhouette_radius)
        if accuracy.colour_tolerance <= 0.0:
            return band | ring
        fragments = ~disoccluded & ~opened(~disoccluded, TUNING.surface_reach_pixels)
        ring &= dilate(fragments, TUNING.isolated_reach_pixels)
        place = np.nonzero(band)
        x, y = self._warp.x[place][None], self._warp.y[place][None]
        in_source, contrasting = np.zeros_like(band), np.zeros_like(band)
        for found, pixels in ((in_source, edges.band), (contrasting, edges.contrasting)):
            found[place] = touches(pixels, x, y, share=TUNING.min_band_weight, wraps=self._wraps)[0]
        unknown = ~self._warp.covered | _strands(self._passes)
        colour, tolerance = self._passes[COLOUR_PASS], accuracy.colour_tolerance
        new_edges = differing(band & ~in_source, self._disparity, colour, tolerance=tolerance, unknown=unknown)
        return contrasting | ring | new_edges

    def seen_through_or_blurred(self) -> dict[Reason, NDArray[np.bool_]]:
        """Return (H, W) target pixels of edges out of focus (DEFOCUS) and of surfaces seen through others
        (TRANSPARENT), by reason.

        A reason is left out where the scene has no depth of field, or the view no transmissive surface.
        """
        glass = shows(self._passes, Effect.TRANSMISSION)
        steps, through, accuracy = self._steps, bool(glass.any()), self._accuracy
        if steps is None and not through:
            return {}
        # Of a picture that is sharp all over, what is around glass is enough to know.
        box = np.s_[:, :] if steps is not None else box_around(glass, window_reach())
        colour, covered = self._passes[COLOUR_PASS][box], self._warp.covered[box]
        gradient, contrast = gradient_of(colour, covered), contrast_of(colour, covered)
        result = {}
        if steps is not None:
            radius = nearer_side(self._blur, self._disparity)
            step, tolerance = accuracy.silhouette_step, TUNING.indirect_tolerance_share * accuracy.colour_tolerance
            result[Reason.DEFOCUS] = blurred_edges(
                steps, radius, gradient, contrast, threshold=step, tolerance=tolerance
            )
        if through and self._is_perspective:
            known = np.isfinite(self._disparity)
            farthest = float(np.min(self._disparity, where=known, initial=np.inf))
            limit, unseen = accuracy.tile_limit, accuracy.unseen
            off = np.zeros_like(glass)
            off[box] = transmission_parallax(
                glass[box], self._disparity[box] - farthest, gradient, contrast, limit=limit, unseen=unseen
            )
            result[Reason.TRANSPARENT] = off
        return result
