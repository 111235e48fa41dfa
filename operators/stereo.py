"""Help for stereo itself: how far things stand before and behind the screen, and where the screen is."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import bpy

from ..stereo_reproject.blender.scene.panoramas import is_panorama
from ..stereo_reproject.blender.scene.rig import (
    check_camera,
    convergence_of_screen,
    frame_region,
    stereo_cameras,
)
from ..stereo_reproject.errors import BadInputError
from ..stereo_reproject.views.camera import Camera
from ..stereo_reproject.views.comfort import Viewing, depth_at_parallax
from ..stereo_reproject.views.depth_range import MIN_CUT_PERCENT
from ..stereo_reproject.views.parallax import ScreenParallax, is_wider_than_eyes, parallax_at
from ..stereo_reproject.words import Words
from .headset import asked_panorama, is_for_headset, stereo_settings_that_count
from .results import result_of
from .text import reported, sentence, shown

CAMERA_SET_ANEW = "The camera's stereo settings were changed since: render again to see their effect."
HEADSET_SET_ANEW = "The headset setting was changed since: render again to see its effect."


class EditsCamera:
    """Mixin of operators that set the stereo settings of the scene's camera."""

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Return whether the scene has a camera for stereo that can be edited here."""
        try:
            check_editable(context.scene)
        except BadInputError as error:
            cls.poll_message_set(sentence(shown(error)))
            return False
        return True


def check_editable(scene: bpy.types.Scene) -> bpy.types.Object:
    """Return the scene's camera if it is one for stereo with a screen, whose settings can be edited here. Raises
    BadInputError.
    """
    camera = check_screen(scene)
    if camera.data.library is not None:
        raise BadInputError("the camera is linked from another file: set it there")
    return camera


def check_screen(scene: bpy.types.Scene) -> bpy.types.Object:
    """Return the scene's camera if its pair is seen on a screen. Raises BadInputError; also for panoramas, whose eyes
    look in every direction alike, and where the panel asks for one.
    """
    checked = check_camera(scene.camera)
    if is_for_headset(scene):
        raise BadInputError("a panorama has no screen: its eyes converge at the same distance all around")
    return checked


class STEREO_REPROJECT_OT_set_convergence(EditsCamera, bpy.types.Operator):
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

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Set the camera's convergence distance so that the screen is at the depth of the target."""
        try:
            set_screen_depth(context.scene, _depth_of(context, self.target))
        except BadInputError as error:
            self.report({"ERROR"}, sentence(reported(error)))
            return {"CANCELLED"}
        warn_if_parallel(self, context.scene)
        return {"FINISHED"}


def set_screen_depth(scene: bpy.types.Scene, depth: float) -> None:
    """Set the camera's convergence distance so that what is at this depth, in scene units, is seen at the screen."""
    data = scene.camera.data
    data.stereo.convergence_distance = convergence_of_screen(data, depth)


def warn_if_parallel(operator: bpy.types.Operator, scene: bpy.types.Scene) -> None:
    """Report that the convergence distance, which the operator has set, has no effect if the camera is parallel."""
    if scene.camera.data.stereo.convergence_mode == "PARALLEL":
        what = "The camera is parallel: the convergence distance has no effect in that mode"
        operator.report({"WARNING"}, reported(what))


def _depth_of(context: bpy.types.Context, target: str) -> float:
    """Return the depth of the active object ("OBJECT") or of the focus ("FOCUS") from the scene's camera, in scene
    units. Raises BadInputError if there is none, or if it is not in front of the camera.
    """
    depsgraph = context.evaluated_depsgraph_get()
    camera = context.scene.camera.evaluated_get(depsgraph)
    focus = camera.data.dof.focus_object
    if target == "FOCUS" and focus is None:
        depth, what = camera.data.dof.focus_distance, Words("The focus distance")
    else:
        item = focus if target == "FOCUS" else context.active_object
        if item is None:
            raise BadInputError("No object is active: click the one that the screen is to cut")
        if item.original == context.scene.camera:
            raise BadInputError("The camera itself is active: click the object that the screen is to cut")
        world = item.evaluated_get(depsgraph).matrix_world
        depth, what = -(camera.matrix_world.normalized().inverted() @ world.translation).z, repr(item.name)
    if depth <= 0.0:
        raise BadInputError(Words("{what} is not in front of the camera", what=what))
    return depth


def viewing_conditions(scene: bpy.types.Scene) -> Viewing:
    """Return the screen and the viewer that the scene's pair is made for."""
    chosen = scene.stereo_reproject
    return Viewing(chosen.screen_width, chosen.eye_distance, chosen.viewing_distance)


def eyes_of(scene: bpy.types.Scene) -> tuple[Camera, Camera, int] | None:
    """Return the left and the right eye of the scene's camera as it stands, and the whole frame's width in pixels; None
    where the scene has no camera for stereo.
    """
    try:
        eyes = stereo_cameras(check_screen(scene), scene.render)
    except BadInputError:
        return None
    return eyes["left"], eyes["right"], frame_region(scene.render).full_width


def parallax_now(scene: bpy.types.Scene) -> list[tuple[str, ScreenParallax]]:
    """Return names and parallax of the nearest and the farthest point, by the camera's present stereo settings. Their
    depths are those that were measured or rendered last; empty before that, or without a camera for stereo.
    """
    known, eyes = result_of(scene).depth, eyes_of(scene)
    if known is None or eyes is None:
        return []
    left, right, width = eyes
    return [(name, parallax_at(left, right, depth, width)) for name, depth in known.ends]


def depth_of_cuts(scene: bpy.types.Scene) -> float | None:
    """Return the depth, in scene units, up to which viewers notice that the frame's edge cuts a thing in front of the
    screen; None where the scene has no camera for stereo, or no depth is that near.
    """
    eyes = eyes_of(scene)
    if eyes is None:
        return None
    left, right, width = eyes
    return depth_at_parallax(left, right, -MIN_CUT_PERCENT, width)


def set_anew_words(scene: bpy.types.Scene, report: Mapping[str, Any]) -> str | None:
    """Return a sentence about what of the stereo settings was changed since the pair with this report was rendered, at
    the scene's present frame; None where nothing was that has an effect.
    """
    try:
        camera = check_camera(scene.camera)
    except BadInputError:
        return None
    if not is_panorama(camera) and asked_panorama(scene) != report.get("panorama"):
        return HEADSET_SET_ANEW
    now, then = camera.data.stereo, report["stereo"]
    names = stereo_settings_that_count(scene)
    texts = names & {"convergence_mode", "pivot"}
    if any(getattr(now, name) != then[name] for name in texts):
        return CAMERA_SET_ANEW
    numbers = names - texts
    is_same = all(math.isclose(getattr(now, name), then[name], rel_tol=1e-5) for name in numbers)
    return None if is_same else CAMERA_SET_ANEW


def is_comfortable(scene: bpy.types.Scene, parallax: ScreenParallax) -> bool:
    """Return whether viewers can look at a point with this parallax without turning their eyes apart, on the screen and
    with the eye distance that are set in the panel.
    """
    viewing = viewing_conditions(scene)
    return not is_wider_than_eyes(parallax, viewing.screen_width, viewing.eye_distance)
