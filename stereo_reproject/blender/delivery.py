"""Blender gets the finished eyes back: a render engine that renders nothing, and hands them over.

After it, the Render Result holds both views as after a multiview render, and Blender's own view transform, stereo
formats and file naming do the rest.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import ClassVar

import bpy
import numpy as np
from numpy.typing import NDArray

from ..errors import StereoReprojectError
from .pictures import check_png
from .render import call_render, output_path
from .scene import return_to_own_frame

ENGINE = "STEREO_REPROJECT_DELIVERY"


class STEREO_REPROJECT_engine_delivery(bpy.types.RenderEngine):  # noqa: N801 - Blender's naming rule
    """Fills a render result with finished pictures; the scene is not looked at."""

    bl_idname = ENGINE
    bl_label = "Stereo Reproject Delivery"
    eyes: ClassVar[Mapping[str, NDArray[np.float32]]] = {}
    delivered: ClassVar[set[str]] = set()

    # The stubs say that there may be no depsgraph; Blender always hands one over.
    def render(self, depsgraph: bpy.types.Depsgraph) -> None:  # pyright: ignore[reportIncompatibleMethodOverride]
        layer = depsgraph.view_layer.name
        for view, picture in self.eyes.items():
            height, width = picture.shape[:2]
            result = self.begin_result(0, 0, width, height, layer=layer, view=view)
            combined = result.layers[0].passes.find_by_name("Combined", view)
            combined.rect.foreach_set(np.ascontiguousarray(picture[::-1], np.float32).ravel())
            self.end_result(result)
            self.delivered.add(view)


@contextmanager
def _registered() -> Iterator[None]:
    """Blender 4.5 does not come to its end while a Python engine is registered, so it is there only while needed."""
    bpy.utils.register_class(STEREO_REPROJECT_engine_delivery)
    try:
        yield
    finally:
        STEREO_REPROJECT_engine_delivery.eyes = {}
        bpy.utils.unregister_class(STEREO_REPROJECT_engine_delivery)


def deliver_side_by_side(
    scene: bpy.types.Scene, eyes: Mapping[str, NDArray[np.float32]], path: Path, *, frame: int | None = None
) -> None:
    """Write both eyes, (H, W, 4) scene-linear, as one PNG through the scene's view transform at `frame`.

    `scene` is the user's; a copy of it is what the engine is set on, so that the scene's own engine keeps its data.
    """
    height, width = eyes["left"].shape[:2]
    engine = STEREO_REPROJECT_engine_delivery
    engine.delivered.clear()
    frame = scene.frame_current if frame is None else frame
    copy = scene.copy()
    name = copy.name
    try:
        with _registered():
            _set_up(copy, width, height, path)
            copy.frame_set(frame)
            engine.eyes = eyes
            call_render(copy)
    except RuntimeError as error:
        raise StereoReprojectError(f"cannot write {path.name}: {' '.join(str(error).split())}") from error
    finally:
        bpy.data.scenes.remove(bpy.data.scenes[name])
        return_to_own_frame(scene, frame)
    if engine.delivered != set(eyes):
        raise StereoReprojectError(f"cannot write {path.name}: Blender did not take both eyes")
    check_png(path)


def _set_up(scene: bpy.types.Scene, width: int, height: int, path: Path) -> None:
    render = scene.render
    render.engine = ENGINE
    render.resolution_x, render.resolution_y, render.resolution_percentage = width, height, 100
    render.use_border = render.use_compositing = render.use_sequencer = render.use_stamp = False
    render.use_freestyle = False
    render.use_multiview, render.views_format = True, "STEREO_3D"
    for view in render.views:
        view.use = view.name in ("left", "right")
    used = next(layer.name for layer in scene.view_layers if layer.use)
    for layer in scene.view_layers:
        layer.use = layer.name == used
        # The eyes have it already, as far as they can.
        layer.use_grease_pencil = False
    render.filepath = output_path(path)
    settings = render.image_settings
    if hasattr(settings, "media_type"):
        settings.media_type = "IMAGE"
    settings.file_format = "PNG"
    settings.color_mode = "RGBA" if render.film_transparent else "RGB"
    settings.color_depth = "8"
    settings.color_management = "FOLLOW_SCENE"
    settings.views_format = "STEREO_3D"
    stereo = settings.stereo_3d_format
    stereo.display_mode = "SIDEBYSIDE"
    stereo.use_sidebyside_crosseyed = stereo.use_squeezed_frame = False
