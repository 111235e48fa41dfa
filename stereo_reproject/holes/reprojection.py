"""The warp stage as a whole: the sources warped into the target, and which of its pixels are left to be traced."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import cast

import numpy as np
from numpy.typing import NDArray

from ..images.lookup import lookup, variance_share
from ..images.masks import dilate
from ..images.passes import COLOUR_PASS, DEPTH_PASS, Passes, known_depth, seen_in_mirrors
from ..images.reasons import Reason
from ..images.sharpness import mixed_variance_share
from ..settings.accuracy import Accuracy
from ..views.camera import PerspectiveCamera
from ..views.view import View
from ..warp.forward import Warp
from ..warp.grid import Grid
from ..warp.merge import merge_views, merged_flags, of_chosen
from ..warp.mirrors import Images, images_in_mirrors, seen_in_both
from ..warp.options import WarpOptions
from ..warp.rendered_view import RenderedView
from ..warp.warped_view import WarpedView
from ..warp.warper import DEFAULTS, NUMPY, Warper
from .classifier import NO_OPTICS, HoleClassifier, Optics, SourceEdges, ray_lengths_tell
from .moved import Movers
from .seams import seams


@dataclass(frozen=True)
class InMirrors:
    """The target's flat mirrors as one source shows them.

    shown (H, W): target pixels that show a mirror. images: a second warp, by the places of the images that the mirrors
    show. strayed (H, W): pixels for which that warp shows something else than the mirror, and those right beside them.
    """

    shown: NDArray[np.bool_]
    images: JudgedView
    strayed: NDArray[np.bool_]

    def reasons_at(self, accuracy: Accuracy) -> NDArray[np.uint16]:
        """Return (H, W) `Reason` flags, at this accuracy, of the pixels that show a mirror; 0 elsewhere."""
        reasons = self.images.reasons_at(accuracy)
        reasons[(reasons == 0) & self.strayed] |= Reason.VIEW_DEPENDENT.bit
        return np.where(self.shown, reasons, np.uint16(0))


@dataclass(frozen=True)
class JudgedView:
    """The target as one source shows it, with the rules that tell for which pixels that source does not answer.

    options are those of the warp. edges are the source's by this accuracy; the lookups of the warped view leave out
    the pixels that are unusable by them. mirrors is None where no flat mirror is seen. moved (H, W) are the target's
    pixels that cannot be warped from this source because something has moved since; None where nothing has.
    """

    warped: WarpedView
    classifier: HoleClassifier
    accuracy: Accuracy
    options: WarpOptions
    edges: SourceEdges
    mirrors: InMirrors | None = None
    moved: NDArray[np.bool_] | None = None

    @cached_property
    def reasons(self) -> NDArray[np.uint16]:
        """The `Reason` flags (H, W) of the pixels to be traced; 0 elsewhere. They are computed when first asked for."""
        return self.reasons_at(self.accuracy)

    def reasons_at(self, accuracy: Accuracy) -> NDArray[np.uint16]:
        """Return (H, W) the `Reason` flags that another accuracy would set in the same warped view.

        Its thresholds decide which pixels of the source are unusable, and so which target pixels a frame of that
        accuracy would trace or look up without them. The view itself keeps the lookups of its own accuracy: the flags
        tell how many pixels would be traced, and not how wrong the others would be.
        """
        edges = self.edges if accuracy == self.accuracy else self.classifier.source_edges(accuracy)
        reasons = self.classifier.reasons(self.warped, accuracy, edges)
        if self.moved is not None:
            reasons |= self.moved * Reason.MOVED.bit
        return reasons if self.mirrors is None else reasons | self.mirrors.reasons_at(accuracy)

    @cached_property
    def variance_share(self) -> NDArray[np.float32]:
        """Share (H, W), 0 to 1, of a source pixel's variance that the lookup of the colour has kept: what is shown in
        flat mirrors was looked up by a map of its own."""
        warp, sharpness = self.warped.warp, self.warped.sharpness
        if sharpness is None:
            share = variance_share(warp.x, warp.y, interpolation=self.options.interpolation_of(COLOUR_PASS))
        else:
            share = mixed_variance_share(warp.x, warp.y, sharpness.cubic)
            if sharpness.single is not None:
                share[sharpness.single] = 1.0
        return (
            share if self.mirrors is None else np.where(self.mirrors.shown, self.mirrors.images.variance_share, share)
        )

    @cached_property
    def single(self) -> NDArray[np.bool_] | None:
        """Pixels (H, W) whose light is that of a single pixel of the source (`images.grain`); None where that was not
        asked for."""
        sharpness = self.warped.sharpness
        if sharpness is None or sharpness.single is None or self.mirrors is None:
            return None if sharpness is None else sharpness.single
        images = self.mirrors.images.single
        return sharpness.single if images is None else np.where(self.mirrors.shown, images, sharpness.single)

    @property
    def samples(self) -> SourceSamples:
        """Single pixels of the source that the target's pixels show."""
        mirrors = None if self.mirrors is None else (self.mirrors.shown, self.mirrors.images.warped.warp)
        return SourceSamples(self.classifier.source.passes[COLOUR_PASS], self.warped.warp, mirrors)


@dataclass(frozen=True)
class SourceSamples:
    """Single pixels of one source that target pixels show.

    colour (H, W, C) is the source's; warp is the map of surfaces. mirrors are a mask (h, w) of the target pixels that
    show a flat mirror, and the map by the places of the images in those; None where no flat mirror is seen.
    """

    colour: NDArray[np.float32]
    warp: Warp
    mirrors: tuple[NDArray[np.bool_], Warp] | None

    def at(self, place: tuple[NDArray[np.intp], NDArray[np.intp]]) -> NDArray[np.float32]:
        """Return the colours (N, C) of the source's pixels nearest to those places in it that N target pixels show.

        place is rows and columns (N,) of the target pixels. In those that show a flat mirror, the place is that of the
        image that it shows.
        """
        x, y = self.places(place)
        rows, columns = (
            np.clip(np.nan_to_num(at), 0, size - 1).astype(np.intp)
            for at, size in zip((y, x), self.colour.shape, strict=False)
        )
        return self.colour[rows, columns]

    def places(self, place: tuple[NDArray[np.intp], NDArray[np.intp]]) -> tuple[NDArray, NDArray]:
        """Return the positions x, y (N,), in pixels of the source, that N target pixels show. place is as for `at`."""
        x, y = self.warp.x[place], self.warp.y[place]
        if self.mirrors is None:
            return x, y
        shown, images = self.mirrors
        return np.where(shown[place], images.x[place], x), np.where(shown[place], images.y[place], y)


@dataclass(frozen=True)
class Reprojection:
    """The target as all sources together show it, with its pixels that must be traced.

    warped is the merged view; views has the judged view of each source.
    """

    warped: WarpedView
    views: tuple[JudgedView, ...]

    @property
    def passes(self) -> Passes:
        """The passes (H, W, C) as the target sees them."""
        return self.warped.passes

    @property
    def grid(self) -> Grid:
        """The grid of the first source."""
        return self.warped.grid

    @property
    def warp(self) -> Warp:
        """The map by which surfaces were looked up; the images in flat mirrors were looked up by another map."""
        return self.warped.warp

    @property
    def warped_by(self) -> str:
        """The kind of warper that was used, numpy or gpu."""
        return self.warped.by

    @cached_property
    def reasons(self) -> NDArray[np.uint16]:
        """The `Reason` flags (H, W) of the pixels to be traced; 0 elsewhere. They are computed when first asked for."""
        return self._merged([view.reasons for view in self.views], self.views[0].accuracy)

    @cached_property
    def variance_share(self) -> NDArray[np.float32]:
        """Share (H, W), 0 to 1, of a source pixel's variance that the lookup of the colour has kept; 1 where nothing
        was looked up."""
        if len(self.views) == 1:
            return self.views[0].variance_share
        return of_chosen(self.warp.source, [view.variance_share for view in self.views])

    def reasons_at(self, accuracy: Accuracy) -> NDArray[np.uint16]:
        """Return (H, W) the `Reason` flags that another accuracy would set for the same warp, as in `JudgedView`."""
        return self._merged([view.reasons_at(accuracy) for view in self.views], accuracy)

    def _merged(self, flags: Sequence[NDArray[np.uint16]], accuracy: Accuracy) -> NDArray[np.uint16]:
        """Return (H, W) the flags of each pixel's own source, with SILHOUETTE added along edges between two sources.

        flags (H, W) are those of each source. Of one source they are returned as they are.
        """
        if len(flags) == 1:
            return flags[0]
        reasons = merged_flags(flags, self.warp)
        first = self.views[0].classifier
        cameras = [view.classifier.source.camera for view in self.views]
        reasons[seams(self.warped, cameras, first.target.camera, accuracy) & (reasons == 0)] |= Reason.SILHOUETTE.bit
        return reasons

    def _single(self) -> NDArray[np.bool_] | None:
        """Return the pixels (H, W) whose light is that of a single pixel of their source; None as in `JudgedView`."""
        single = [view.single for view in self.views]
        if any(mask is None for mask in single):
            return None
        return (
            single[0]
            if len(single) == 1
            else of_chosen(self.warp.source, [mask for mask in single if mask is not None])
        )

    def answered(self) -> WarpedHoles:
        """Return the passes and their holes, without all that only told the holes."""
        return WarpedHoles(
            self.passes,
            self.warp,
            self.reasons,
            self.variance_share,
            self.grid,
            self.warped_by,
            tuple(view.samples for view in self.views),
            self._single(),
        )


@dataclass(frozen=True)
class WarpedHoles:
    """The target as all sources together show it, with its holes, as tracing and the report need it: a third of what a
    `Reprojection` holds in memory.

    passes (H, W, C), warp, reasons (H, W), variance_share (H, W), grid and warped_by are those of `Reprojection`.
    samples has an entry for each source. single (H, W) are the pixels whose light is that of a single pixel of their
    source, None where that was not asked for. The passes are handed on to the target, which traces its pixels into
    them.
    """

    passes: Passes
    warp: Warp
    reasons: NDArray[np.uint16]
    variance_share: NDArray[np.float32]
    grid: Grid
    warped_by: str
    samples: tuple[SourceSamples, ...]
    single: NDArray[np.bool_] | None = None

    def sampled(self, place: tuple[NDArray[np.intp], NDArray[np.intp]]) -> NDArray[np.float32]:
        """Return the colours (N, C) of single source pixels: for each of N target pixels, the one nearest to its place
        in its source.

        place is rows and columns (N,) of the target pixels. The colours have the noise of a single pixel, where
        interpolated ones have less.
        """
        number = self.warp.source[place]
        return np.stack([samples.at(place) for samples in self.samples])[number, np.arange(number.size)]

    def between(self, place: tuple[NDArray[np.intp], NDArray[np.intp]]) -> NDArray[np.float32]:
        """Return the colours (N, C) of the sources, looked up linearly at the places that N target pixels show; place
        is as for `sampled`."""
        x, y = self.places(place)
        looked_up = [lookup(samples.colour, x[None], y[None])[0] for samples in self.samples]
        return np.stack(looked_up)[self.warp.source[place], np.arange(x.size)]

    def places(self, place: tuple[NDArray[np.intp], NDArray[np.intp]]) -> tuple[NDArray, NDArray]:
        """Return the positions x, y (N,), in pixels, that N target pixels show, each in its own source; place is as for
        `sampled`."""
        number = self.warp.source[place]
        x, y = np.stack([samples.places(place) for samples in self.samples])[number, :, np.arange(number.size)].T
        return x, y


def reproject(
    sources: Sequence[RenderedView],
    target: View,
    accuracy: Accuracy,
    *,
    optics: Optics = NO_OPTICS,
    options: WarpOptions = DEFAULTS,
    warper: Warper = NUMPY,
    movers: Sequence[Movers | None] = (),
) -> Reprojection:
    """Warp the sources, one or more, into the target, and flag the pixels that are known to need tracing.

    optics tells of lens and volumes, warper whether NumPy or a GPU warps. Things that flat mirrors show are warped by
    where their image stands. movers has, for each source, what has moved since it was rendered; it is empty where
    nothing has. `warp.merge` says which source answers for a pixel that several show.
    """
    views = tuple(
        _moved(_judged(source, target, accuracy, optics, options, warper), target, moved)
        for source, moved in zip(sources, movers or [None] * len(sources), strict=True)
    )
    flags = [] if len(views) == 1 else [view.reasons for view in views]
    return Reprojection(merge_views([view.warped for view in views], flags, sources, target), views)


def _moved(view: JudgedView, target: View, movers: Movers | None) -> JudgedView:
    """Return the target as one source shows it, with what has moved since then flagged."""
    return view if movers is None else replace(view, moved=movers.pixels(view.warped.warp, target.camera))


def _judged(
    source: RenderedView, target: View, accuracy: Accuracy, optics: Optics, options: WarpOptions, warper: Warper
) -> JudgedView:
    """Return the target as one source shows it, with the things in flat mirrors warped by where their image stands."""
    depth = known_depth(source.passes[DEPTH_PASS])
    if source.traced is not None:
        # What is not looked up hides nothing either: another source shows it, or it has moved.
        depth = np.where(source.traced[..., None], depth, np.float32(np.nan))
    source = replace(source, passes={**source.passes, DEPTH_PASS: depth})

    def judged(source: RenderedView) -> JudgedView:
        warped = warper.warp([source], target, options)
        classifier = HoleClassifier.of_source(source, target, warped, optics, options)
        edges = classifier.source_edges(accuracy)
        return JudgedView(classifier.without_unusable(warped, edges), classifier, accuracy, options, edges)

    seen = judged(source)
    if not (accuracy.silhouette_radius > 0 and ray_lengths_tell(source.camera, target.camera, optics)):
        return seen
    camera = cast("PerspectiveCamera", source.camera)
    found = images_in_mirrors(source.passes, camera, clip_start=optics.lens.near)
    if found is None:
        return seen
    in_mirrors = {name: image for name, image in source.passes.items() if seen_in_mirrors(name)}
    images = judged(replace(source, passes={**in_mirrors, DEPTH_PASS: found.depth[..., None]}))
    return _with_mirrors(seen, images, found)


def _with_mirrors(seen: JudgedView, images: JudgedView, found: Images) -> JudgedView:
    """Return the view `seen`, with the passes replaced in its mirrors' pixels by those of the warp `images`.

    seen was warped by the depth of surfaces, images by that of the images that mirrors show; found are those of the
    source.
    """
    shown, same = seen_in_both(seen.classifier.source.passes, found, seen.warped.warp, images.warped.warp)
    # Depth that is filtered as colours are has no sharp edge: along a mirror's, what is beside it may look alike.
    strayed = dilate(~same, 1)
    passes = {
        name: np.where(shown[..., None], images.warped.passes[name], image) if seen_in_mirrors(name) else image
        for name, image in seen.warped.passes.items()
    }
    sharpness = seen.warped.sharpness
    if sharpness is not None:
        # Of what mirrors show, the images' own lookup tells what is lost.
        sharpness = replace(sharpness, lost=np.where(shown, np.float32(0.0), sharpness.lost))
    warped = replace(seen.warped, passes=passes, sharpness=sharpness)
    return replace(seen, warped=warped, mirrors=InMirrors(shown, images, strayed))
