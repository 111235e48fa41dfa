"""A copy of the user's scene to work in: the user's own is never touched, and nothing of the copy is left behind."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

import bpy

from ...errors import BadInputError
from ...settings.frame import SceneOverrides
from ...words import Words
from .rendered import camera_at, check_layers, engine_of
from .rig import check_camera, check_engine_shows, frame_region
from .setting_up import DRIVEN_SEED, apply_overrides, set_up
from .vr_cameras import check_vr, copy_of_camera

Block = TypeVar("Block", bound=bpy.types.ID)
Made = TypeVar("Made")

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
        raise BadInputError(Words("Blender cannot open {path}: {reason}", path=path, reason=reason)) from error
    if scene is None:
        return bpy.context.scene
    found = next((one for one in bpy.data.scenes if scene_key(one) == tuple(scene)), None)
    if found is None:
        raise BadInputError(
            Words(
                "{path} has no scene {scene}: its scenes are {scenes}",
                path=path,
                scene=repr(scene[0]),
                scenes=", ".join(bpy.data.scenes.keys()),
            )
        )
    return found


def scene_key(scene: bpy.types.Scene) -> tuple[str, str | None]:
    """Return the identity of a scene in a file: its name, and the name of the library that it is linked from (None: not
    linked).
    """
    return scene.name, scene.library.name if scene.library else None


@contextmanager
def working_scene(
    scene: bpy.types.Scene, overrides: SceneOverrides, *, layer: str | None = None
) -> Iterator[bpy.types.Scene]:
    """Have a copy of `scene` with a camera of its own, set up to render single stereo views without post-processing,
    for the time of a `with` block. The copy is removed afterwards, also after an error.

    overrides replace settings of the scene, its frame among them. The copy renders one view layer: the first of
    `layers_to_render`, or the one named. Raises BadInputError when the scene cannot be rendered as a pair.
    """
    engine = engine_of(scene, overrides)
    # As Blender has it, a frame that is asked for by its number has no subframe.
    frame, subframe = _standing(scene) if overrides.frame is None else (overrides.frame, 0.0)
    camera = check_camera(camera_at(scene, frame))
    check_engine_shows(camera, engine)
    check_vr(camera, scene.render, engine, overrides)
    rendered = check_layers(scene)[0] if layer is None else layer
    copy = scene.copy()
    eye = copy_of_camera(camera, overrides)
    names = (copy.name, eye.name, eye.data.name)
    try:
        _take_place(copy, eye)
        copy.render.engine = engine
        set_up(copy, rendered)
        apply_overrides(copy, eye.data, overrides)
        _check_region(copy.render)
        move_to(copy, frame, subframe=subframe)
        yield copy
    finally:
        left = bpy.data.scenes.get(names[0])
        last = (frame, subframe) if left is None else _standing(left)
        _remove(*names)
        return_to_own_frame(scene, *last)


def _take_place(copy: bpy.types.Scene, eye: bpy.types.Object) -> None:
    """Make a copy of the user's camera the camera of a copy of the user's scene, and keep it so in every frame."""
    # A marker would switch the camera back at the next render.
    copy.timeline_markers.clear()
    # A property of the user's own may have the name of ours.
    copy.pop(DRIVEN_SEED, None)
    eye.pop(KEPT_OBJECT, None)
    copy.collection.objects.link(eye)
    copy.camera = eye


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
        self._beside: list[Any] = []
        """That which `beside` has made for the scene that is kept, if anything."""

    def __enter__(self) -> WorkingScenes:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Remove the scene that is kept; a later frame gets a new one."""
        self._kept = None
        self._beside.clear()
        self._open.close()

    def beside(self, make: Callable[[bpy.types.Scene], AbstractContextManager[Made]]) -> Made:
        """Return what `make` has for the scene that is kept. It is asked once, and what it has stays as long as that
        scene: Cycles syncs everything again where an object comes or goes."""
        if not self._beside:
            assert self._kept is not None
            self._beside.append(self._open.enter_context(make(bpy.data.scenes[self._kept[1]])))
        return self._beside[0]

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


def evaluate_anew(scene: bpy.types.Scene) -> None:
    """Evaluate a scene again where it stands: of a datablock that is new in it, curves and drivers count from then on,
    and before, the values that it was copied with."""
    stand_at(scene, *_standing(scene))


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
            Words(
                "{width} x {height} pixels are to be rendered: at least {min_side_px} x {min_side_px} are needed;"
                " check resolution, percentage and render border",
                width=region.width,
                height=region.height,
                min_side_px=MIN_SIDE_PX,
            )
        )


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
        remove_kept(eye)
        bpy.data.objects.remove(eye)
    camera = bpy.data.cameras.get(camera_name)
    if camera is not None:
        bpy.data.cameras.remove(camera)


def remove_kept(eye: bpy.types.Object) -> None:
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
