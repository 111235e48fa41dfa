"""A copy of the user's scene to work in: the user's own is never touched, and nothing of the copy is left behind."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

import bpy

from ...errors import BadInputError
from ...settings.frame import SceneOverrides
from .rig import MODES, check_camera, frame_region

CYCLES = "CYCLES"
EEVEE = ("BLENDER_EEVEE", "BLENDER_EEVEE_NEXT")

Block = TypeVar("Block", bound=bpy.types.ID)

DRIVEN_SEED = "stereo_reproject_seed"
"""A working scene's property that has the driver of its seed."""

KEPT_OBJECT = "stereo_reproject_kept_object"
"""Property of a working camera that names an object of ours in its scene: it is removed together with the scene, since
Cycles syncs everything again where an object comes or goes. All datablocks of the object have it too."""

MIN_SIDE_PX = 4
"""Least pixels along a side: Blender renders nothing smaller."""


def open_blend(path: Path, scene: tuple[str, str | None] | None = None, *, scripts: bool = False) -> bpy.types.Scene:
    """Load a .blend without its user interface; its Python scripts run only with `scripts`. Return its scene of this
    name, from the library of this name if it is linked (None: not linked); without `scene`, the active one. Raises
    BadInputError.
    """
    try:
        bpy.ops.wm.open_mainfile(filepath=str(path), load_ui=False, use_scripts=scripts)
    except RuntimeError as error:
        reason = " ".join(str(error).split()).removeprefix("Error: ")
        raise BadInputError(f"Blender cannot open {path}: {reason}") from error
    if scene is None:
        return bpy.context.scene
    found = next((one for one in bpy.data.scenes if scene_key(one) == tuple(scene)), None)
    if found is None:
        raise BadInputError(f"{path} has no scene {scene[0]!r}: its scenes are {', '.join(bpy.data.scenes.keys())}")
    return found


def scene_key(scene: bpy.types.Scene) -> tuple[str, str | None]:
    """Return the identity of a scene in a file: its name, and the name of the library that it is linked from (None: not
    linked).
    """
    return scene.name, scene.library.name if scene.library else None


def check_engine(scene: bpy.types.Scene) -> None:
    """Raise BadInputError unless the scene renders with Cycles or EEVEE."""
    if scene.render.engine != CYCLES and scene.render.engine not in EEVEE:
        raise BadInputError(
            f"scene {scene.name!r} renders with {scene.render.engine}: set Cycles or EEVEE in Render properties"
        )


def scene_frames(scene: bpy.types.Scene) -> range:
    """Return the frames that Blender would render as an animation. Raises BadInputError when there are none."""
    frames = range(scene.frame_start, scene.frame_end + 1, scene.frame_step)
    if not frames:
        raise BadInputError(f"the frame range {scene.frame_start} to {scene.frame_end} is empty: set it in Output")
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
        raise BadInputError(f"no view layer of scene {scene.name!r} is used for rendering: switch one on")
    return layers


@contextmanager
def working_scene(
    scene: bpy.types.Scene, overrides: SceneOverrides, *, layer: str | None = None
) -> Iterator[bpy.types.Scene]:
    """Have a copy of `scene` with a camera of its own, set up to render single stereo views without post-processing,
    for the time of a `with` block. The copy is removed afterwards, also after an error.

    overrides replace settings of the scene, its frame among them. The copy renders one view layer: the first of
    `layers_to_render`, or the one named. Raises BadInputError when the scene cannot be rendered as a pair.
    """
    engine = _engine(scene, overrides)
    # As Blender has it, a frame that is asked for by its number has no subframe.
    frame, subframe = _standing(scene) if overrides.frame is None else (overrides.frame, 0.0)
    camera = check_camera(camera_at(scene, frame))
    rendered = check_layers(scene)[0] if layer is None else layer
    copy = scene.copy()
    eye = camera.copy()
    eye.data = camera.data.copy()
    names = (copy.name, eye.name, eye.data.name)
    try:
        # A marker would switch the camera back at the next render.
        copy.timeline_markers.clear()
        # A property of the user's own may have the name of ours.
        copy.pop(DRIVEN_SEED, None)
        eye.pop(KEPT_OBJECT, None)
        copy.collection.objects.link(eye)
        copy.camera = eye
        copy.render.engine = engine
        _set_up(copy, rendered)
        _apply(copy, eye.data, overrides)
        _check_region(copy.render)
        move_to(copy, frame, subframe=subframe)
        yield copy
    finally:
        left = bpy.data.scenes.get(names[0])
        last = (frame, subframe) if left is None else _standing(left)
        _remove(*names)
        return_to_own_frame(scene, *last)


def move_to(working: bpy.types.Scene, frame: int, *, subframe: float = 0.0) -> None:
    """Have a working scene stand at a frame, with the seed and the filter width that are animated for it."""
    stand_at(working, frame, subframe)
    # The fills look at it, and the copy's own value may be that of another frame.
    working.cycles.filter_width = evaluated(working, working).cycles.filter_width
    if DRIVEN_SEED in working:
        working.cycles.seed = int(evaluated(working, working)[DRIVEN_SEED])


class WorkingScenes:
    """Working scenes for one frame after the other. The scene of the last frame stays where it fits the next one too,
    so that what Cycles has synced is used again.

    With several view layers, each layer's scene is made anew, and removed before the next layer's is synced. A camera
    that a timeline marker switches to needs a scene of its own, too.
    """

    def __init__(self, scene: bpy.types.Scene) -> None:
        self._scene = scene
        self._open = ExitStack()
        self._kept: tuple[tuple[object, ...], str] | None = None

    def __enter__(self) -> WorkingScenes:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Remove the scene that is kept; a later frame gets a new one."""
        self._kept = None
        self._open.close()

    def at(self, overrides: SceneOverrides, layer: str) -> bpy.types.Scene:
        """Return a working scene for this view layer, which stands at the frame of the overrides. The rest of the
        overrides should always be the same, else a new scene is made. Raises BadInputError.
        """
        frame = self._scene.frame_current if overrides.frame is None else overrides.frame
        camera = camera_at(self._scene, frame)
        key = (layer, camera and camera.session_uid, replace(overrides, frame=None))
        if self._kept is not None and self._kept[0] == key:
            working = bpy.data.scenes[self._kept[1]]
            move_to(working, frame)
            return working
        self.close()
        working = self._open.enter_context(working_scene(self._scene, overrides, layer=layer))
        # By name: a reference does not survive everything that a render may do.
        self._kept = key, working.name
        return working


def _engine(scene: bpy.types.Scene, overrides: SceneOverrides) -> str:
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
            f"scene {scene.name!r} renders its samples from number {scene.cycles.sample_offset} on, and Cycles gives"
            " depth with the first alone: set Sample Subset's Offset to 0"
        )
    if overrides.denoise and engine != CYCLES:
        raise BadInputError("EEVEE's pictures are not denoised: leave --denoise out, or choose Cycles as source engine")
    return engine


def evaluated(item: Block, scene: bpy.types.Scene) -> Block:
    """Return a datablock as it is in the present frame of a working scene: animated, driven and constrained."""
    layer = rendered_layer(scene)
    # What was set since then, for a packed render or a frame, counts.
    layer.update()
    return item.evaluated_get(layer.depsgraph)


@contextmanager
def changed(owner: bpy.types.bpy_struct, **values: Any) -> Iterator[None]:
    """Have properties of a scene, or of something in it, set to these values, for the time of a `with` block; the
    earlier values are restored afterwards, also after an error.
    """
    kept = {name: getattr(owner, name) for name in values}
    try:
        for name, value in values.items():
            setattr(owner, name, value)
        yield
    finally:
        with ExitStack() as restored:
            for name, value in kept.items():
                restored.callback(setattr, owner, name, value)


def rendered_layer(scene: bpy.types.Scene) -> bpy.types.ViewLayer:
    """Return the one view layer that a working scene renders."""
    return next(layer for layer in scene.view_layers if layer.use)


def is_kept(block: bpy.types.ID) -> bool:
    """Return whether a datablock belongs to the object of ours in a working scene, which is in no plain render."""
    return KEPT_OBJECT in block


def main_layer(scene: bpy.types.Scene) -> str:
    """Return the name of the first view layer that is used for rendering; the first of all where none is."""
    return next((layer.name for layer in scene.view_layers if layer.use), scene.view_layers[0].name)


def focus_distance(scene: bpy.types.Scene) -> float:
    """Return the depth in focus of a working scene's camera, in scene units."""
    camera = evaluated(scene.camera, scene)
    focus = camera.data.dof.focus_object
    if focus is None:
        return camera.data.dof.focus_distance
    place = camera.matrix_world.normalized().inverted() @ evaluated(focus, scene).matrix_world.translation
    return abs(place.z)


def make_small(working: bpy.types.Scene, width: int) -> float:
    """Lower the resolution of a working scene to about this width in pixels, but to no more than half of what it was,
    and return the new width over the old one. Neither side becomes smaller than Blender can render, even where that is
    more than half.
    """
    render = working.render
    region = frame_region(render)
    scale = max(min(width / region.width, 0.5), min(MIN_SIDE_PX / min(region.width, region.height), 1.0))
    percentage = render.resolution_percentage / 100.0
    # Rounded up: a border must not lose its last pixels.
    render.resolution_x, render.resolution_y = (
        math.ceil(side * percentage * scale) for side in (render.resolution_x, render.resolution_y)
    )
    render.resolution_percentage = 100
    return scale


def return_to_own_frame(scene: bpy.types.Scene, frame: int, subframe: float = 0.0) -> None:
    """Evaluate the scene at its own frame again, if (frame, subframe), at which a copy of it was rendered, is another:
    what is animated is shared with copies, and moved with them.
    """
    own = _standing(scene)
    if own != (frame, subframe):
        stand_at(scene, *own)


def stand_at(scene: bpy.types.Scene, frame: int, subframe: float) -> None:
    """Have a scene stand at a frame and subframe. Before frame 0 Blender's own subframes are negative, which its
    function does not take: they are counted from the frame before.
    """
    before = 1 if subframe < 0.0 else 0
    scene.frame_set(frame - before, subframe=subframe + before)


def _standing(scene: bpy.types.Scene) -> tuple[int, float]:
    """Return the frame and the subframe that the scene stands at."""
    return scene.frame_current, scene.frame_subframe


def _check_region(render: bpy.types.RenderSettings) -> None:
    """Raise BadInputError if fewer pixels are to be rendered than Blender can."""
    region = frame_region(render)
    if min(region.width, region.height) < MIN_SIDE_PX:
        raise BadInputError(
            f"{region.width} x {region.height} pixels are to be rendered: at least {MIN_SIDE_PX} x {MIN_SIDE_PX} are"
            " needed; check resolution, percentage and render border"
        )


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


def _set_up(scene: bpy.types.Scene, layer: str) -> None:
    """Set a working scene up to render one view layer for stereo: with colour and depth, and without compositor or
    sequencer.
    """
    render = scene.render
    render.use_persistent_data = True
    render.use_compositing = False
    render.use_sequencer = False
    render.use_stamp = False
    render.use_single_layer = False
    render.use_freestyle = False
    render.use_crop_to_border = render.use_border
    render.use_multiview = True
    render.views_format = "STEREO_3D"
    for view in render.views:
        view.use = view.name in ("left", "right")
    for view_layer in scene.view_layers:
        view_layer.use = view_layer.name == layer
    scene.view_layers[layer].use_pass_combined = True
    scene.view_layers[layer].use_pass_z = True


def _apply_to_cycles(scene: bpy.types.Scene, overrides: SceneOverrides) -> None:
    """Set seed and denoising of a working scene that Cycles renders as the overrides say."""
    _take_over_seed(scene)
    if overrides.seed is not None:
        scene.pop(DRIVEN_SEED, None)
        scene.cycles.seed = overrides.seed
    if overrides.denoise is not None:
        scene.cycles.use_denoising = overrides.denoise
        for layer in scene.view_layers:
            layer.cycles.use_denoising = overrides.denoise


def _take_over_seed(scene: bpy.types.Scene) -> None:
    """Move a driver of the scene's seed to another property, from which `move_to` reads it: each render of a frame
    needs a seed of its own, which the driver would overwrite.
    """
    drivers = scene.animation_data.drivers if scene.animation_data else ()
    driver = next((curve for curve in drivers if curve.data_path == "cycles.seed"), None)
    if driver is not None:
        scene[DRIVEN_SEED] = 0
        scene.animation_data.drivers.from_existing(src_driver=driver).data_path = f'["{DRIVEN_SEED}"]'
        scene.driver_remove("cycles.seed")


def _apply(scene: bpy.types.Scene, camera: bpy.types.Camera, overrides: SceneOverrides) -> None:
    """Set a working scene and its camera's stereo settings as the overrides say."""
    if overrides.size is not None:
        scene.render.resolution_x, scene.render.resolution_y = overrides.size
        scene.render.resolution_percentage = 100
    if overrides.samples is not None:
        if scene.render.engine == CYCLES:
            scene.cycles.samples = overrides.samples
            for layer in scene.view_layers:
                # A layer's own number would win.
                layer.samples = 0
        else:
            scene.eevee.taa_render_samples = overrides.samples
    if scene.render.engine == CYCLES:
        _apply_to_cycles(scene, overrides)
    stereo = camera.stereo
    if overrides.interocular_distance is not None:
        stereo.interocular_distance = overrides.interocular_distance
    if overrides.convergence_distance is not None:
        stereo.convergence_distance = overrides.convergence_distance
    if overrides.convergence_mode is not None:
        stereo.convergence_mode = MODES[overrides.convergence_mode]


def _remove(scene_name: str, object_name: str, camera_name: str) -> None:
    """Remove the copies of scene, camera object and camera data that `working_scene` has made. They are found by name,
    since a reference may not survive a render.
    """
    scene = bpy.data.scenes.get(scene_name)
    if scene is not None:
        # Frees what Cycles keeps between renders.
        scene.render.use_persistent_data = False
        bpy.data.scenes.remove(scene)
    eye = bpy.data.objects.get(object_name)
    if eye is not None:
        _remove_kept(eye)
        bpy.data.objects.remove(eye)
    camera = bpy.data.cameras.get(camera_name)
    if camera is not None:
        bpy.data.cameras.remove(camera)


def _remove_kept(eye: bpy.types.Object) -> None:
    """Remove the object that a working camera names as ours, with its mesh and materials."""
    kept = bpy.data.objects.get(eye.get(KEPT_OBJECT, ""))
    if kept is None:
        return
    mesh: bpy.types.Mesh = kept.data  # pyright: ignore[reportAssignmentType] - of ours, all are meshes
    materials = [mesh.materials[index] for index in range(len(mesh.materials))]
    trees: list[bpy.types.NodeTree] = [
        material.node_tree for material in materials if material is not None and material.node_tree is not None
    ]
    nodes = (node for tree in trees for node in tree.nodes)
    images = {node.image for node in nodes if isinstance(node, bpy.types.ShaderNodeTexImage) and node.image}
    bpy.data.batch_remove([kept, mesh, *filter(None, materials), *images])
