"""The warp stage as a whole: the sources warped into the target, and which of its pixels are left to be traced."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import cast

import numpy as np
from numpy.typing import NDArray

from ..images.masks import dilate
from ..images.passes import COLOUR_PASS, DEPTH_PASS, Passes, known_depth, seen_in_mirrors
from ..images.reasons import Reason
from ..settings.accuracy import Accuracy
from ..views.camera import PerspectiveCamera
from ..views.view import View
from ..warp.forward import Warp
from ..warp.grid import Grid
from ..warp.merge import merge_views, merged_flags
from ..warp.mirrors import Images, images_in_mirrors, seen_in_both
from ..warp.options import WarpOptions
from ..warp.rendered_view import RenderedView
from ..warp.warped_view import WarpedView
from ..warp.warper import DEFAULTS, NUMPY, Warper
from .classifier import NO_OPTICS, HoleClassifier, Optics, ray_lengths_tell
from .seams import seams


@dataclass(frozen=True)
class InMirrors:
    """The view of a source in the target's flat mirrors.

    shown (H, W): target pixels that show a mirror. images: a warp of what mirrors show. strayed (H, W): pixels in
    which that warp shows something else, or which are right beside such a pixel.
    """

    shown: NDArray[np.bool_]
    images: JudgedView
    strayed: NDArray[np.bool_]

    def reasons_at(self, accuracy: Accuracy) -> NDArray[np.uint16]:
        """Return (H, W) `Reason` flags of the pixels that show a mirror, 0 elsewhere."""
        reasons = self.images.reasons_at(accuracy)
        reasons[(reasons == 0) & self.strayed] |= Reason.VIEW_DEPENDENT.bit
        return np.where(self.shown, reasons, np.uint16(0))


@dataclass(frozen=True)
class JudgedView:
    """The target as one source shows it, and the pixels for which that source does not answer."""

    warped: WarpedView
    classifier: HoleClassifier
    accuracy: Accuracy
    mirrors: InMirrors | None = None

    @cached_property
    def reasons(self) -> NDArray[np.uint16]:
        """The `Reason` flags (H, W) of the pixels to be traced; 0 elsewhere."""
        return self.reasons_at(self.accuracy)

    def reasons_at(self, accuracy: Accuracy) -> NDArray[np.uint16]:
        """Return (H, W) the flags that another accuracy would set in the same view."""
        reasons = self.classifier.reasons(self.warped, accuracy)
        return reasons if self.mirrors is None else reasons | self.mirrors.reasons_at(accuracy)


@dataclass(frozen=True)
class Reprojection:
    """The target as all sources together show it, and its pixels that must be traced. views: one for each source."""

    warped: WarpedView
    views: tuple[JudgedView, ...]

    @property
    def passes(self) -> Passes:
        """The passes (H, W, C) as the target sees them."""
        return self.warped.passes

    @property
    def grid(self) -> Grid:
        """The grid of the first source's surfaces."""
        return self.warped.grid

    @property
    def warp(self) -> Warp:
        """The map of the surfaces; what mirrors show was looked up elsewhere."""
        return self.warped.warp

    @property
    def warped_by(self) -> str:
        """ "numpy" or "gpu"."""
        return self.warped.by

    @cached_property
    def reasons(self) -> NDArray[np.uint16]:
        """The `Reason` flags (H, W) of the pixels to be traced; 0 elsewhere."""
        return self._merged([view.reasons for view in self.views], self.views[0].accuracy)

    def reasons_at(self, accuracy: Accuracy) -> NDArray[np.uint16]:
        """Return (H, W) the flags that another accuracy would set, of the same warp."""
        return self._merged([view.reasons_at(accuracy) for view in self.views], accuracy)

    def _merged(self, flags: Sequence[NDArray[np.uint16]], accuracy: Accuracy) -> NDArray[np.uint16]:
        """Return (H, W) the flags of each pixel's own source, and those of edges between two sources."""
        if len(flags) == 1:
            return flags[0]
        reasons = merged_flags(flags, self.warp)
        first = self.views[0].classifier
        cameras = [view.classifier.source.camera for view in self.views]
        reasons[seams(self.warped, cameras, first.target.camera, accuracy) & (reasons == 0)] |= Reason.SILHOUETTE.bit
        return reasons

    def sampled(self, place: tuple[NDArray[np.intp], NDArray[np.intp]]) -> NDArray[np.float32]:
        """Return (N, C) colours of the sources' own pixels, each with the noise of a single one.

        Of each target pixel, at rows and columns `place` (N,), it is the pixel nearest to what is seen there.
        """
        colours = [view.classifier.source.passes[COLOUR_PASS] for view in self.views]
        number = self.warp.source[place]
        result = np.empty((number.size, colours[0].shape[-1]), colours[0].dtype)
        for index, colour in enumerate(colours):
            chosen = number == index
            rows, columns = (
                np.clip(np.nan_to_num(at[place][chosen]), 0, size - 1).astype(np.intp)
                for at, size in zip((self.warp.y, self.warp.x), colour.shape, strict=False)
            )
            result[chosen] = colour[rows, columns]
        return result


def reproject(
    sources: Sequence[RenderedView],
    target: View,
    accuracy: Accuracy,
    *,
    optics: Optics = NO_OPTICS,
    options: WarpOptions = DEFAULTS,
    warper: Warper = NUMPY,
) -> Reprojection:
    """Warp the sources, one or more, into the target, and flag the pixels that are known to need tracing.

    What flat mirrors show is warped by where its image stands. `warp.merge` says which source answers for a pixel
    that several show.
    """
    views = tuple(_judged(source, target, accuracy, optics, options, warper) for source in sources)
    flags = [] if len(views) == 1 else [view.reasons for view in views]
    return Reprojection(merge_views([view.warped for view in views], flags, sources, target), views)


def _judged(
    source: RenderedView, target: View, accuracy: Accuracy, optics: Optics, options: WarpOptions, warper: Warper
) -> JudgedView:
    """Return the target as one source shows it, mirrors and all."""
    source = replace(source, passes={**source.passes, DEPTH_PASS: known_depth(source.passes[DEPTH_PASS])})

    def judged(source: RenderedView) -> JudgedView:
        warped = warper.warp([source], target, options)
        return JudgedView(warped, HoleClassifier.of_source(source, target, warped, optics, options), accuracy)

    seen = judged(source)
    if not (accuracy.silhouette_radius > 0 and ray_lengths_tell(source, target, optics)):
        return seen
    camera = cast("PerspectiveCamera", source.camera)
    found = images_in_mirrors(source.passes, camera, clip_start=optics.lens.near)
    if found is None:
        return seen
    in_mirrors = {name: image for name, image in source.passes.items() if seen_in_mirrors(name)}
    images = judged(replace(source, passes={**in_mirrors, DEPTH_PASS: found.depth[..., None]}))
    return _with_mirrors(seen, images, found)


def _with_mirrors(seen: JudgedView, images: JudgedView, found: Images) -> JudgedView:
    """Return the view warped by surfaces, with what the source's mirrors show warped by images."""
    shown, same = seen_in_both(seen.classifier.source.passes, found, seen.warped.warp, images.warped.warp)
    # Depth that is filtered as colours are has no sharp edge: along a mirror's, what is beside it may look alike.
    strayed = dilate(~same, 1)
    passes = {
        name: np.where(shown[..., None], images.warped.passes[name], image) if seen_in_mirrors(name) else image
        for name, image in seen.warped.passes.items()
    }
    return replace(seen, warped=replace(seen.warped, passes=passes), mirrors=InMirrors(shown, images, strayed))
