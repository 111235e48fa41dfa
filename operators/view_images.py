"""Images in which a pair is seen without glasses: one eye, or both beside each other. They are runtime data of the
file: they are never saved with it, and they are made anew from the pair whenever they are asked for.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import bpy
import numpy as np
from numpy.typing import NDArray

from ..stereo_reproject.blender.output.saved_views import linear_views
from ..stereo_reproject.errors import StereoReprojectError
from ..stereo_reproject.images.exr import VIEWS
from ..stereo_reproject.jobs.work_folder import work_folder
from .pictures import (
    KIND,
    NAME,
    PAIR,
    fit_editor,
    image_editors,
    kind_of,
    redraw_with_both_eyes,
    render_result,
    show_pair,
)
from .preferences import temporary_folder

ARRANGEMENTS: Mapping[str, tuple[str, ...]] = {
    "LEFT": VIEWS[:1],
    "RIGHT": VIEWS[1:],
    "SIDE_BY_SIDE": VIEWS,
    "CROSS_EYED": VIEWS[::-1],
}
"""Views that each kind of image shows, from left to right."""

NAMES = {"LEFT": "Left", "RIGHT": "Right", "SIDE_BY_SIDE": "Side by Side", "CROSS_EYED": "Cross-Eyed"}


def pair_shown_in(space: bpy.types.SpaceImageEditor) -> bpy.types.Image | None:
    """Return the image that holds the pair which an Image Editor shows, whole or in an image of ours: an image with two
    views, or else the Render Result; None if there is none.
    """
    image = space.image
    if kind_of(image) is not None:
        return bpy.data.images.get(image[PAIR]) or render_result()
    return image if image is not None and has_two_views(image) else render_result()


def has_two_views(image: bpy.types.Image) -> bool:
    """Return whether Blender knows an image to have two views: a file from its loading on, the Render Result once it
    was drawn.
    """
    return image.is_stereo_3d or image.is_multiview


def made_images(scene: bpy.types.Scene, pair: bpy.types.Image, kinds: Sequence[str]) -> dict[str, bpy.types.Image]:
    """Make an image of each of these kinds from the image that holds the pair, in place of the earlier ones, and return
    them by kind. Raises BadInputError where the image holds no pair.
    """
    with work_folder(temporary_folder(), ()) as folder:
        views = linear_views(scene, pair, folder)
    return {kind: _made(pair, kind, views) for kind in kinds}


def _made(pair: bpy.types.Image, kind: str, views: Mapping[str, NDArray[np.float32]]) -> bpy.types.Image:
    """Make an image of ours of the pair's views, (H, W, 4) scene-linear, in place of the earlier one of its kind: in
    the same datablock if it is as large, so that an editor that shows it keeps its zoom.
    """
    pixels = np.concatenate([views[view] for view in ARRANGEMENTS[kind]], axis=1)
    old = _found(pair.name, kind)
    height, width = pixels.shape[:2]
    if old is not None and tuple(old.size) == (width, height):
        old.pixels.foreach_set(np.ascontiguousarray(pixels[::-1]).ravel())
        old.update()
        old.pack()
        return old
    image = bpy.data.images.new(_name_of(pair, kind), width, height, alpha=True, float_buffer=True)
    image.pixels.foreach_set(np.ascontiguousarray(pixels[::-1]).ravel())
    image.use_view_as_render = pair.type == "RENDER_RESULT" or pair.use_view_as_render
    # Packed it has no unsaved changes, of which Blender would warn when it quits.
    image.pack()
    image.is_runtime_data = True
    image[KIND], image[PAIR] = kind, pair.name
    if old is not None:
        name = old.name
        old.user_remap(image)
        bpy.data.images.remove(old)
        image.name = name
    return image


def _name_of(pair: bpy.types.Image, kind: str) -> str:
    """Return the name of our image of this kind of a pair; that of another pair than the Render Result says which."""
    name = NAME.format(NAMES[kind])
    return name if pair.type == "RENDER_RESULT" else f"{name} of {pair.name}"


def turned_to(image: bpy.types.Image, pair: bpy.types.Image) -> bpy.types.Image:
    """Return our image of this pair that is of the kind of an image of ours; where there is none, that image becomes
    it, with the pixels that it has until it is made anew."""
    known = image_of(pair, image[KIND])
    if known is not None:
        return known
    image[PAIR], image.name = pair.name, _name_of(pair, image[KIND])
    return image


def _found(pair: str, kind: str) -> bpy.types.Image | None:
    """Return our image of this kind of the pair in the image named `pair`; None if there is none."""
    return next((image for image in bpy.data.images if kind_of(image) == kind and image[PAIR] == pair), None)


def image_of(pair: bpy.types.Image, kind: str) -> bpy.types.Image | None:
    """Return our image of this kind of a pair; None if there is none."""
    return _found(pair.name, kind)


def renew(scene: bpy.types.Scene) -> bool:
    """Make those of our images anew that Image Editors show of the Render Result. Return whether there are any. Raises
    BadInputError where the Render Result holds no pair.
    """
    result = render_result()
    shown = [area.spaces.active.image for _, area in image_editors()]
    kinds = {kind_of(image) for image in shown if kind_of(image) and result and image[PAIR] == result.name}
    if result is not None and kinds:
        made_images(scene, result, sorted(filter(None, kinds)))
    return bool(kinds)


def show_delivered(scene: bpy.types.Scene, *, fit: bool, opens: bool) -> None:
    """Show a pair that has just become the Render Result: in Image Editors that show images of ours, in the same kind,
    and else as `show_pair` does; without opens, only in those that show it already. With fit, the whole picture is
    fitted to the editors.
    """
    try:
        renewed = renew(scene)
    except (StereoReprojectError, OSError) as error:
        print(f"Stereo Reproject shows the Render Result alone: {error}")
        renewed = False
        remove_all()
    if not renewed:
        (show_pair if opens else redraw_with_both_eyes)(fit=fit)
    elif fit:
        for window, area in image_editors():
            if kind_of(area.spaces.active.image) is not None:
                fit_editor(window, area)


def remove_unused(*, keep: Sequence[str] = ()) -> None:
    """Remove our images that no Image Editor shows, but for those of the kinds `keep`."""
    shown = {area.spaces.active.image for _, area in image_editors()}
    for image in [image for image in bpy.data.images if kind_of(image) not in (None, *keep)]:
        if image not in shown:
            bpy.data.images.remove(image)


def remove_all() -> None:
    """Remove all images of ours. Image Editors show the pair itself again."""
    for _, area in image_editors():
        space = area.spaces.active
        if kind_of(space.image) is not None:
            space.image = pair_shown_in(space)
    for image in [image for image in bpy.data.images if kind_of(image) is not None]:
        bpy.data.images.remove(image)
