"""One source warped into one target, from passes and two cameras. Not a test itself."""

from __future__ import annotations

from stereo_reproject.holes.classifier import NO_OPTICS
from stereo_reproject.holes.reprojection import reproject
from stereo_reproject.views.view import View
from stereo_reproject.warp.composite import warp_passes
from stereo_reproject.warp.options import WarpOptions
from stereo_reproject.warp.rendered_view import RenderedView
from stereo_reproject.warp.warper import Warper, warp_view


def views_of(passes, source, target, *, invalid=None, motion=None):
    """The rendered source and the target; motion is that of both, or None."""
    one, other = motion or (None, None)
    return RenderedView(View("source", source, one), passes, invalid), View("target", target, other)


def warp_pair(passes, source, target, *, how=warp_view, motion=None, **options):
    """The warped view; how is NumPy's `warp_view` or the GPU's."""
    return how(*views_of(passes, source, target, motion=motion), WarpOptions(**options))


def warp_passes_of_pair(passes, warp, source, target, *, motion=None, **options):
    """The passes alone, looked up by this map."""
    return warp_passes(*views_of(passes, source, target, motion=motion), warp, WarpOptions(**options)).passes


def reproject_pair(passes, source, target, *, accuracy, invalid, optics=NO_OPTICS, how=warp_view, **options):
    """The whole stage; how is NumPy's `warp_view` or the GPU's."""
    rendered, view = views_of(passes, source, target, invalid=invalid)
    return reproject([rendered], view, accuracy, optics=optics, options=WarpOptions(**options), warper=Warper(how))
