"""Both views of an image that Blender shows, as arrays: of the Render Result, whose pixels Blender hands to no script,
and of image files with two views.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, nullcontext
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ...delivery.anaglyph import light_of_srgb
from ...errors import BadInputError
from ...images.exr import VIEWS, read_channels
from ...words import Words
from ..engines.render import output_path
from ..scene.working import changed
from .image_settings import FORMAT, format_kept, set_changed
from .pictures import read_pixels

LINEAR = {"media_type": "IMAGE", "file_format": "OPEN_EXR", "color_mode": "RGBA", "color_depth": "32"}
SHOWN = {"media_type": "IMAGE", "file_format": "PNG", "color_mode": "RGBA", "color_depth": "8"}
SRGB = "sRGB"
STORED_VIEW = {"look": "None", "exposure": 0.0, "gamma": 1.0, "use_curve_mapping": False, "view_transform": "Standard"}
"""View settings by which, on an sRGB display, what is stored in sRGB is shown as it is. The view transform is the last
to be set and the first to be restored: only with its own does Blender take a look."""


def linear_views(scene: bpy.types.Scene, image: bpy.types.Image, folder: Path) -> dict[str, NDArray[np.float32]]:
    """Return both views of an image, (H, W, 4) scene-linear, by name; of the Render Result they are those of the active
    render slot. folder takes files meanwhile. Raises BadInputError where the image has not both views.
    """
    of_bytes = image.type == "IMAGE" and not image.is_float and image.colorspace_settings.name == SRGB
    if of_bytes and _knows_stored_view(scene):
        # Blender 5.2 forgets the colour space of bytes as it takes the eyes of one file apart, and converts nothing.
        with _stored_view(scene):
            pixels = _pixels(scene, image, folder)
        return {
            view: np.concatenate([light_of_srgb(of_view[..., :3]), of_view[..., 3:]], axis=-1)
            for view, of_view in pixels.items()
        }
    paths = _saved(scene, image, folder / "view.exr", {**LINEAR, "exr_codec": "NONE"})
    channels = {view: read_channels(path) for view, path in paths.items()}
    return {view: np.stack([of_view[letter] for letter in "RGBA"], axis=-1) for view, of_view in channels.items()}


def shown_views(scene: bpy.types.Scene, image: bpy.types.Image, folder: Path) -> dict[str, NDArray[np.float32]]:
    """Return both views of an image as a screen shows them, (H, W, 3) from 0 to 1, over black where they are
    transparent: through the scene's view transform, but for an image that Blender shows without it. All else is as for
    `linear_views`.
    """
    as_it_is = image.type == "IMAGE" and not image.use_view_as_render and _knows_stored_view(scene)
    with _stored_view(scene) if as_it_is else nullcontext():
        pixels = _pixels(scene, image, folder)
    return {view: of_view[..., :3] * of_view[..., 3:] for view, of_view in pixels.items()}


@contextmanager
def _stored_view(scene: bpy.types.Scene) -> Iterator[None]:
    """Have the scene's pictures shown by `STORED_VIEW` for the time of a `with` block."""
    # The display last and first: not each has the view transforms of the others.
    with changed(scene.view_settings, **STORED_VIEW), changed(scene.display_settings, display_device=SRGB):
        yield


def _knows_stored_view(scene: bpy.types.Scene) -> bool:
    """Return whether the configuration of colours that Blender uses, which may be a studio's own, has `STORED_VIEW`."""
    try:
        with _stored_view(scene):
            return True
    except TypeError:
        return False


def _pixels(scene: bpy.types.Scene, image: bpy.types.Image, folder: Path) -> dict[str, NDArray[np.float32]]:
    """Return both views of an image as bytes show them through the scene's view transform, (H, W, 4) from 0 to 1; all
    else is as for `linear_views`.
    """
    paths = _saved(scene, image, folder / "view.png", SHOWN)
    return {view: read_pixels(path) for view, path in paths.items()}


def _saved(scene: bpy.types.Scene, image: bpy.types.Image, path: Path, values: dict[str, Any]) -> dict[str, Path]:
    """Save each view of the image as a file beside `path` in the format that `values` say, and return the files by
    view. Raises BadInputError where there are not two.
    """
    paths = {view: path.with_stem(f"{path.stem}{_suffix(view)}") for view in VIEWS}
    with _individual_views(scene, values):
        try:
            image.save_render(output_path(path), scene=scene)
            reason: str = Words("it has one view")
        except RuntimeError as error:
            # Of a Render Result with two views Blender says so each time, also when it has saved both: the files tell.
            reason = " ".join(str(error).removeprefix("Error: ").split())
    if not all(path.exists() for path in paths.values()):
        raise BadInputError(
            Words(
                "{image} is no stereo pair ({reason}): render one, or open one", image=repr(image.name), reason=reason
            )
        )
    return paths


def _suffix(view: str) -> str:
    """Return the ending of a view's file name."""
    return f"-{view}"


@contextmanager
def _individual_views(scene: bpy.types.Scene, values: dict[str, Any]) -> Iterator[None]:
    """Have the scene's output set to this format with a file for each view, in the scene's own colours, for the time of
    a `with` block; the settings are restored afterwards.
    """
    render, settings = scene.render, scene.render.image_settings
    with ExitStack() as changes:
        changes.enter_context(format_kept(settings))
        # A dither is random: what stands still would flicker where the views alternate.
        changes.enter_context(changed(render, use_multiview=True, use_stamp=False, dither_intensity=0.0))
        for view in render.views:
            changes.enter_context(changed(view, file_suffix=_suffix(view.name)))
        set_changed(settings, {name: values[name] for name in FORMAT if name in values and hasattr(settings, name)})
        set_changed(settings, {"views_format": "INDIVIDUAL", "color_management": "FOLLOW_SCENE"})
        yield
