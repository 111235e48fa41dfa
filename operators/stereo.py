"""Help for stereo itself: how far things stand before and behind the screen, and where the screen is."""

from typing import Any

import bpy

from ..stereo_reproject.blender.scene.rig import check_camera, frame_region, stereo_cameras
from ..stereo_reproject.errors import BadInputError
from ..stereo_reproject.views.parallax import ScreenParallax, is_wider_than_eyes, parallax_at
from .results import result_of


class STEREO_REPROJECT_OT_set_convergence(bpy.types.Operator):
    """Set the camera's convergence plane, which is seen at the depth of the screen"""

    bl_idname = "stereo_reproject.set_convergence"
    bl_label = "Set Convergence to"
    bl_options = {"REGISTER", "UNDO"}

    target: bpy.props.EnumProperty(
        name="Target",
        items=[
            ("OBJECT", "Active Object", "The depth of the active object's origin, seen from the scene's camera"),
            ("FOCUS", "Focus Distance", "The depth that the camera is focused on"),
        ],
        default="OBJECT",
    )

    @classmethod
    def description(cls, _context: bpy.types.Context, properties: bpy.types.OperatorProperties) -> str:
        """Return the button's tooltip, which names its target."""
        where = "of the active object" if properties.target == "OBJECT" else "that the camera is focused on"
        return f"Set the camera's convergence, and so the screen, to the depth {where}"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Return whether the scene has a camera for stereo that can be edited here."""
        try:
            camera = check_camera(context.scene.camera)
        except BadInputError as error:
            cls.poll_message_set(str(error))
            return False
        if camera.data.library is not None:
            cls.poll_message_set("The camera is linked from another file: set it there")
            return False
        return True

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Set the camera's convergence distance to the depth of the target."""
        scene = context.scene
        stereo = scene.camera.data.stereo
        try:
            stereo.convergence_distance = _depth_of(context, self.target)
        except BadInputError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        if stereo.convergence_mode == "PARALLEL":
            self.report({"WARNING"}, "The camera is parallel: the convergence distance has no effect in that mode")
        return {"FINISHED"}


def _depth_of(context: bpy.types.Context, target: str) -> float:
    """Return the depth of the active object ("OBJECT") or of the focus ("FOCUS") from the scene's camera, in scene
    units. Raises BadInputError if there is none, or if it is not in front of the camera.
    """
    depsgraph = context.evaluated_depsgraph_get()
    camera = context.scene.camera.evaluated_get(depsgraph)
    focus = camera.data.dof.focus_object
    if target == "FOCUS" and focus is None:
        depth, what = camera.data.dof.focus_distance, "The focus distance"
    else:
        item = focus if target == "FOCUS" else context.active_object
        if item is None:
            raise BadInputError("No object is active: click the one that the screen is to cut")
        if item.original == context.scene.camera:
            raise BadInputError("The camera itself is active: click the object that the screen is to cut")
        world = item.evaluated_get(depsgraph).matrix_world
        depth, what = -(camera.matrix_world.normalized().inverted() @ world.translation).z, f"{item.name!r}"
    if depth <= 0.0:
        raise BadInputError(f"{what} is not in front of the camera")
    return depth


def parallax_now(scene: bpy.types.Scene) -> list[tuple[str, ScreenParallax]]:
    """Return names and parallax of the nearest and the farthest point, by the camera's present stereo settings. Their
    depths are those that the last pair or check found; empty before either, or without a camera for stereo.
    """
    seen = result_of(scene).parallax
    if seen is None:
        return []
    try:
        eyes, width = stereo_cameras(check_camera(scene.camera), scene.render), frame_region(scene.render).full_width
    except BadInputError:
        return []
    return [(name.capitalize(), parallax_at(eyes["left"], eyes["right"], _depth(seen[name]), width)) for name in seen]


def _depth(seen: Any) -> float:
    """Return the depth of a point that a report has, in scene units; JSON's None stands for an infinite one."""
    return float("inf") if seen["depth"] is None else seen["depth"]


def is_comfortable(scene: bpy.types.Scene, parallax: ScreenParallax) -> bool:
    """Return whether viewers can look at a point with this parallax without turning their eyes apart, on the screen and
    with the eye distance that are set in the panel.
    """
    chosen = scene.stereo_reproject
    return not is_wider_than_eyes(parallax, chosen.screen_width, chosen.eye_distance)
