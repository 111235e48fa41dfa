"""From rendered sources to the target: grid, forward warp, lookup of the passes, and where nothing landed.

`warp_view` warps one source with NumPy; `blender.gpu.warp` has another that does it on a GPU. A `Warper` is either of
them, and takes any number of sources.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from ..images.lookup import touches
from ..images.masks import dilate
from ..images.reasons import Reason
from ..views.view import View
from .composite import warp_passes
from .discontinuities import disparity_of, disparity_steps
from .empty import empty_reasons
from .forward import forward_warp
from .grid import build_grid
from .merge import merge_views
from .options import WarpOptions
from .rendered_view import RenderedView
from .tuning import TUNING
from .warped_view import WarpedView

DEFAULTS = WarpOptions()


@dataclass(frozen=True)
class Warper:
    """A way to warp views: with NumPy, or on a GPU.

    warp_view: the function that warps one source into the target. device: the GPU's name; None for NumPy.
    """

    warp_view: Callable[[RenderedView, View, WarpOptions], WarpedView]
    device: str | None = None

    def warp(self, sources: Sequence[RenderedView], target: View, options: WarpOptions = DEFAULTS) -> WarpedView:
        """Return the target as one or more sources show it; `merge` says which of several answers for a pixel.

        Only empty pixels count as unanswered here. A frame's pixels are judged by all hole rules: `holes.reprojection`.
        """
        views = [_with_untraced(self.warp_view(source, target, options), source, options) for source in sources]
        return merge_views(views, [view.empty for view in views], sources, target)


def _with_untraced(view: WarpedView, source: RenderedView, options: WarpOptions) -> WarpedView:
    """Return the view with pixels flagged DISOCCLUDED whose lookup takes any share of pixels that the source did not
    trace.

    `RenderedView.traced` says why.
    """
    if source.traced is None or source.traced.all():
        return view
    untraced = ~source.traced
    reached = dilate(untraced, 1, wraps=source.wraps) if options.cubic else untraced
    touched = touches(reached, view.warp.x, view.warp.y, share=0.0, wraps=source.wraps) & (view.empty == 0)
    return replace(view, empty=view.empty | touched * Reason.DISOCCLUDED.bit)


def warp_view(source: RenderedView, target: View, options: WarpOptions = DEFAULTS) -> WarpedView:
    """Return the target as one source shows it, warped with NumPy: grid, map, passes and the flags of empty pixels."""
    depth, camera = source.depth, source.camera
    grid = build_grid(depth, camera, target.camera, threshold=options.grid_threshold, most=TUNING.tear_pixels)
    steps = disparity_steps(disparity_of(depth, camera, target.camera))
    cut_right, cut_down = steps.torn()
    warp = forward_warp(depth, camera, target.camera, grid, cut_right=cut_right, cut_down=cut_down)
    seen = warp_passes(source, target, warp, options)
    return WarpedView(seen.passes, grid, warp, empty_reasons(warp, camera, target.camera), steps, seen.sharpness)


NUMPY = Warper(warp_view)
