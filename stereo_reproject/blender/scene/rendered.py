"""The engine, frames, view layers and camera with which Blender renders a scene."""

from __future__ import annotations

import bpy

from ...errors import BadInputError
from ...settings.frame import SceneOverrides
from ...words import Words

CYCLES = "CYCLES"
EEVEE = ("BLENDER_EEVEE", "BLENDER_EEVEE_NEXT")


def check_engine(scene: bpy.types.Scene) -> None:
    """Raise BadInputError unless the scene renders with Cycles or EEVEE."""
    if scene.render.engine != CYCLES and scene.render.engine not in EEVEE:
        raise BadInputError(
            Words(
                "scene {scene} renders with {engine}: set Cycles or EEVEE in Render properties",
                scene=repr(scene.name),
                engine=scene.render.engine,
            )
        )


def engine_of(scene: bpy.types.Scene, overrides: SceneOverrides) -> str:
    """Return Blender's name of the engine that is to render the scene. Raises BadInputError where engine or settings
    cannot be used.
    """
    if overrides.source_engine is None:
        check_engine(scene)
        engine = scene.render.engine
    else:
        # EEVEE's name is not the same in every Blender.
        eevee = EEVEE[1] if bpy.app.version < (5, 0) else EEVEE[0]
        engine = CYCLES if overrides.source_engine == "cycles" else eevee
    if engine == CYCLES and scene.cycles.use_sample_subset and scene.cycles.sample_offset > 0:
        raise BadInputError(
            Words(
                "scene {scene} renders its samples from number {offset} on, and Cycles gives depth with the first"
                " alone: set Sample Subset's Offset to 0",
                scene=repr(scene.name),
                offset=scene.cycles.sample_offset,
            )
        )
    if overrides.denoise and engine != CYCLES:
        raise BadInputError("EEVEE's pictures are not denoised: leave --denoise out, or choose Cycles as source engine")
    return engine


def scene_frames(scene: bpy.types.Scene) -> range:
    """Return the frames that Blender would render as an animation. Raises BadInputError when there are none."""
    frames = range(scene.frame_start, scene.frame_end + 1, scene.frame_step)
    if not frames:
        raise BadInputError(
            Words(
                "the frame range {first} to {last} is empty: set it in Output",
                first=scene.frame_start,
                last=scene.frame_end,
            )
        )
    return frames


def layers_to_render(scene: bpy.types.Scene) -> list[str]:
    """Return the names of the view layers that Blender renders, in the scene's order; there may be none. Render Single
    Layer is a setting of windows: without one it is ignored, as by Blender itself.
    """
    if scene.render.use_single_layer and not bpy.app.background and bpy.context.scene == scene:
        return [bpy.context.view_layer.name]
    return [layer.name for layer in scene.view_layers if layer.use]


def check_layers(scene: bpy.types.Scene) -> list[str]:
    """Return the view layers that Blender renders, in the scene's order. Raises BadInputError without any."""
    layers = layers_to_render(scene)
    if not layers:
        raise BadInputError(
            Words("no view layer of scene {scene} is used for rendering: switch one on", scene=repr(scene.name))
        )
    return layers


def main_layer(scene: bpy.types.Scene) -> str:
    """Return the name of the first view layer that is used for rendering; the first of all where none is."""
    return next((layer.name for layer in scene.view_layers if layer.use), scene.view_layers[0].name)


def camera_at(scene: bpy.types.Scene, frame: int) -> bpy.types.Object | None:
    """Return the camera that Blender renders a frame with: one that a timeline marker binds, or else the scene's. None
    where there is neither.
    """
    return _camera_by_marker(scene, frame) or scene.camera


def _camera_by_marker(scene: bpy.types.Scene, frame: int) -> bpy.types.Object | None:
    """Return the camera that a timeline marker binds at a frame, as Blender switches cameras: by the last marker up to
    it, or else by the first. None where no marker binds one.
    """
    bound = [marker for marker in scene.timeline_markers if marker.camera and not marker.camera.hide_render]
    if not bound:
        return None
    passed = [marker for marker in bound if marker.frame <= frame]
    return max(passed, key=lambda m: m.frame).camera if passed else min(bound, key=lambda m: m.frame).camera
