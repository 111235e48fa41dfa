"""The screen and the comfort zone in the 3D View: planes that are drawn, and an arrow that drags the convergence."""

from __future__ import annotations

import bpy
import numpy as np
from mathutils import Matrix, Vector

from ..stereo_reproject.blender.scene.depth import frame_pixels
from ..stereo_reproject.blender.scene.rig import convergence_of_screen, frame_region
from ..stereo_reproject.errors import BadInputError
from ..stereo_reproject.views.comfort import comfort_limits, depth_at_parallax
from ..stereo_reproject.views.depth_range import frame_corners
from .plane_drawing import Colour, Plane, draw_labels, draw_planes
from .stereo import check_editable, eyes_of, set_screen_depth, viewing_conditions

SCREEN_COLOUR: Colour = (1.0, 0.75, 0.2, 1.0)
LIMIT_COLOUR: Colour = (0.35, 0.75, 1.0, 1.0)

ARROW_LENGTH = 0.6
"""Length of the arrow's stem, in lengths of Blender's own arrows."""

DRAG_OPERATOR = "GIZMOGROUP_OT_gizmo_tweak"
"""Blender's operator that drags a gizmo."""

UNDO_DELAY_SECONDS = 0.1
"""Seconds between two looks whether a drag is over: an undo step made then is there before a hand reaches Ctrl Z."""

MIN_SCREEN_DEPTH = 1e-4
"""Depth, in scene units, nearer than which the arrow does not drag the screen."""

RIGHT_EYE_SHARE = {"LEFT": 0.0, "CENTER": 0.5, "RIGHT": 1.0}
"""Place of the camera between the left eye, 0, and the right one, 1, by its pivot."""

_handlers: list[object] = []


def planes_of(scene: bpy.types.Scene) -> list[Plane]:
    """Return the planes of the screen and of both ends of the comfort zone, as far as the scene's camera has them: as
    wide as the frame is there for the eye, or the place between both, that stands where the camera is. Eyes in the same
    place have the screen alone, where they would converge.
    """
    eyes = eyes_of(scene)
    if eyes is None:
        return []
    left, right, frame_width = eyes
    limits, frame = comfort_limits(viewing_conditions(scene)), frame_pixels(frame_region(scene.render))
    share_of_right = RIGHT_EYE_SHARE[scene.camera.data.stereo.pivot]
    planes = []
    for name, percent, colour, label_share in (
        ("Near", limits.near, LIMIT_COLOUR, 0.0),
        ("Screen", 0.0, SCREEN_COLOUR, 0.4),
        ("Far", limits.far, LIMIT_COLOUR, 0.9),
    ):
        depth = depth_at_parallax(left, right, percent, frame_width)
        if name == "Screen" and _eyes_coincide(scene.camera.data):
            depth = _screen_depth_of(scene.camera.data)
        if depth is not None and np.isfinite(depth):
            ends = [frame_corners(eye, frame, depth) for eye in (left, right)]
            corners = ends[0] + share_of_right * (ends[1] - ends[0])
            # Through the camera, the nearest plane would veil the whole picture.
            planes.append(Plane(name, corners, colour, label_share, fills_frame=name == "Screen"))
    return planes


def _eyes_coincide(data: bpy.types.Camera) -> bool:
    """Return whether a camera that converges has both eyes in the same place, so that nothing has a parallax."""
    return (
        data.stereo.interocular_distance == 0.0 and data.type == "PERSP" and data.stereo.convergence_mode != "PARALLEL"
    )


def _shown_planes() -> list[Plane]:
    """Return the planes to be drawn in the 3D View that is being drawn; none where they are switched off there."""
    context = bpy.context
    scene, space = context.scene, context.space_data
    if not scene.stereo_reproject.show_depth or not space.overlay.show_overlays:
        return []
    return planes_of(scene)


def _draw_planes() -> None:
    """Draw the planes among the objects of a 3D View."""
    draw_planes(_shown_planes())


def _draw_labels() -> None:
    """Draw the planes' names over a 3D View."""
    draw_labels(_shown_planes())


class STEREO_REPROJECT_GGT_screen(bpy.types.GizmoGroup):
    """An arrow at the screen's corner that drags the camera's convergence."""

    bl_idname = "STEREO_REPROJECT_GGT_screen"
    bl_label = "Stereo Screen"
    bl_space_type = "VIEW_3D"
    bl_region_type = "WINDOW"
    bl_options = {"3D", "PERSISTENT"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Return whether the planes are shown and the camera has a convergence that can be edited here."""
        if not context.scene.stereo_reproject.show_depth:
            return False
        try:
            data = check_editable(context.scene).data
        except BadInputError:
            return False
        return data.type == "PERSP" and data.stereo.convergence_mode != "PARALLEL"

    def setup(self, _context: bpy.types.Context) -> None:
        """Make the arrow. Blender calls this once for each 3D View."""
        self._arrow = arrow = self.gizmos.new("GIZMO_GT_arrow_3d")
        arrow.target_set_handler("offset", get=screen_depth, set=_drag_to)
        arrow.color, arrow.alpha = SCREEN_COLOUR[:3], 0.8
        arrow.color_highlight, arrow.alpha_highlight = (1.0, 1.0, 1.0), 1.0
        arrow.length = ARROW_LENGTH
        arrow.use_draw_value = True

    def draw_prepare(self, context: bpy.types.Context) -> None:
        """Put the arrow at the lower right corner of the screen; while it is dragged it stays on its line."""
        if self._arrow.is_modal:
            return
        base = arrow_base(context.scene)
        if base is not None:
            self._arrow.matrix_basis = base


def arrow_base(scene: bpy.types.Scene) -> Matrix | None:
    """Return the matrix of the line on which the arrow moves: in the camera's plane, with the z axis along its line of
    sight, beside the camera by as much as the screen's lower right corner. None without a screen.
    """
    screen = next((plane for plane in planes_of(scene) if plane.name == "Screen"), None)
    if screen is None:
        return None
    world = scene.camera.matrix_world.normalized()
    corner = world.inverted() @ Vector(screen.corners[1])
    turned = Matrix.Rotation(np.pi, 4, "X")
    return world @ Matrix.Translation((corner.x, corner.y, 0.0)) @ turned


def screen_depth() -> float:
    """Return the depth of the screen of the scene's camera, in scene units."""
    return _screen_depth_of(bpy.context.scene.camera.data)


def _screen_depth_of(data: bpy.types.Camera) -> float:
    """Return the depth of a camera's screen, in scene units."""
    return data.stereo.convergence_distance / convergence_of_screen(data, 1.0)


def _drag_to(depth: float) -> None:
    """Put the screen at the depth to which the arrow was dragged, and see to it that this can be undone."""
    set_screen_depth(bpy.context.scene, max(depth, MIN_SCREEN_DEPTH))
    if not bpy.app.timers.is_registered(_make_undo_step):
        bpy.app.timers.register(_make_undo_step, first_interval=UNDO_DELAY_SECONDS)


def _make_undo_step() -> float | None:
    """Make one step to undo of a drag that is over. Blender makes none where a gizmo calls Python for its value. Return
    the seconds after which Blender is to ask again while the drag goes on.
    """
    windows = bpy.context.window_manager.windows
    if any(operator.bl_idname == DRAG_OPERATOR for window in windows for operator in window.modal_operators):
        return UNDO_DELAY_SECONDS
    bpy.ops.ed.undo_push(message="Move Stereo Screen")
    return None


def add_drawing() -> None:
    """Have the planes drawn in all 3D Views, where they are switched on."""
    add = bpy.types.SpaceView3D.draw_handler_add
    for draw, when in ((_draw_planes, "POST_VIEW"), (_draw_labels, "POST_PIXEL")):
        _handlers.append(add(draw, (), "WINDOW", when))


def remove_drawing() -> None:
    """Undo `add_drawing`."""
    if bpy.app.timers.is_registered(_make_undo_step):
        bpy.app.timers.unregister(_make_undo_step)
    while _handlers:
        bpy.types.SpaceView3D.draw_handler_remove(_handlers.pop(), "WINDOW")
