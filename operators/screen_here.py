"""Eyedropper that puts the screen at the depth of what is clicked, in a 3D View or in the rendered picture."""

from __future__ import annotations

import bpy
import numpy as np
from bpy_extras import view3d_utils
from mathutils import Vector

from ..stereo_reproject.blender.scene.depth import cast_rays, first_seen, frame_pixels
from ..stereo_reproject.blender.scene.rig import frame_region, stereo_cameras
from ..stereo_reproject.errors import BadInputError
from ..stereo_reproject.views.depth_range import FramePixels
from ..stereo_reproject.words import Words
from .cursor_text import hide_text, remove_text, show_at_mouse
from .lengths import length_words
from .redraw import redraw_panels
from .results import result_of
from .run import other_windows
from .slots import content_now
from .stereo import EditsCamera, check_editable, set_screen_depth, warn_if_parallel
from .text import reported, sentence, shown

NAVIGATION = {"MIDDLEMOUSE", "WHEELUPMOUSE", "WHEELDOWNMOUSE", "TRACKPADPAN", "TRACKPADZOOM", "NDOF_MOTION"}
"""Events that are left to Blender while the eyedropper is out, so that the view can be moved."""

MAX_VIEW_CLIPS = 3.0
"""Length of the ray under the mouse, in clip ends of the view: an orthographic view begins before the view's middle by
as much as it reaches behind."""

HELP = "Click: put the screen here    Esc, right click: cancel"


_out: list[str] = []
"""The operator whose eyedropper is out, if any."""


def put_away() -> None:
    """Give every window its own mouse cursor and status bar again, if an eyedropper is out. The extension may be
    switched off, or another file opened, at any moment: then no operator is left to do it.
    """
    if not _out:
        return
    _out.clear()
    remove_text()
    for window in bpy.context.window_manager.windows:
        window.cursor_modal_restore()
        # The text belongs to the workspace of the context, whichever it is asked of.
        with bpy.context.temp_override(window=window):  # pyright: ignore[reportGeneralTypeIssues] - not in the stubs
            window.workspace.status_text_set(None)
    redraw_panels()


def is_out() -> bool:
    """Return whether an eyedropper is out."""
    return bool(_out)


class STEREO_REPROJECT_OT_set_screen_here(EditsCamera, bpy.types.Operator):
    """Click a point in a 3D View, or in the Render Result, that is to be seen at the depth of the screen"""

    bl_idname = "stereo_reproject.set_screen_here"
    bl_label = "Set Screen Here"
    bl_options = {"REGISTER", "UNDO"}

    depth: bpy.props.FloatProperty(
        name="Depth",
        description="Depth of the screen, from the camera along its line of sight",
        subtype="DISTANCE",
        default=1.0,
        min=1e-5,
        soft_max=1000.0,
        options={"SKIP_SAVE"},
    )

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> set[str]:
        """Take out the eyedropper and wait for a click, in every window of the scene: the picture may have one of its
        own.
        """
        if not is_out():
            _out.append(self.bl_idname)
            for window in other_windows(context):
                if window.scene != context.scene:
                    continue
                with context.temp_override(window=window):  # pyright: ignore[reportGeneralTypeIssues] - not in the stubs
                    bpy.ops.stereo_reproject.set_screen_here("INVOKE_DEFAULT")
        context.window.cursor_modal_set("EYEDROPPER")
        context.workspace.status_text_set(shown(HELP))
        redraw_panels()
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Show the depth under the mouse, and set it on a click; end when it was put away in another window."""
        if not is_out():
            return {"CANCELLED", "PASS_THROUGH"}
        if event.type in {"ESC", "RIGHTMOUSE"}:
            put_away()
            return {"CANCELLED"}
        # A job that runs meanwhile lives on its timer.
        if event.type in NAVIGATION or event.type.startswith("TIMER"):
            return {"PASS_THROUGH"}
        clicked = event.type == "LEFTMOUSE" and event.value == "PRESS"
        if event.type != "MOUSEMOVE" and not clicked:
            return {"RUNNING_MODAL"}
        try:
            depth = depth_under_mouse(context, event)
        except BadInputError as error:
            show_depth(context, event, sentence(shown(error)))
            if clicked:
                self.report({"WARNING"}, sentence(reported(error)))
            return {"RUNNING_MODAL"}
        if not clicked:
            show_depth(context, event, Words("Depth {length}", length=length_words(context.scene, depth)))
            return {"RUNNING_MODAL"}
        put_away()
        self.depth = depth
        return self.execute(context)

    def cancel(self, _context: bpy.types.Context) -> None:
        """Put the eyedropper away. Blender calls this when another file is opened meanwhile."""
        put_away()

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Put the screen at the depth `depth`."""
        scene = context.scene
        try:
            check_editable(scene)
        except BadInputError as error:
            self.report({"ERROR"}, sentence(reported(error)))
            return {"CANCELLED"}
        set_screen_depth(scene, self.depth)
        words = Words("The screen is {length} from the camera", length=length_words(scene, self.depth))
        self.report({"INFO"}, reported(words))
        warn_if_parallel(self, scene)
        return {"FINISHED"}


def show_depth(context: bpy.types.Context, event: bpy.types.Event, text: str) -> None:
    """Show a text about what is under the mouse beside it, and in the status bar with what can be done."""
    context.workspace.status_text_set(f"{shown(text)}    {shown(HELP)}")
    try:
        _, region = _place_of(context.window.screen, event.mouse_x, event.mouse_y)
    except BadInputError:
        hide_text()
        return
    show_at_mouse(region, (event.mouse_x - region.x, event.mouse_y - region.y), shown(text))


def depth_under_mouse(context: bpy.types.Context, event: bpy.types.Event) -> float:
    """Return the depth, from the scene's camera along its line of sight, of what is under the mouse. Raises
    BadInputError where that is nothing, or not in front of the camera.
    """
    scene, depsgraph = context.scene, context.evaluated_depsgraph_get()
    camera = check_editable(scene).evaluated_get(depsgraph)
    area, region = _place_of(context.window.screen, event.mouse_x, event.mouse_y)
    at = Vector((event.mouse_x - region.x, event.mouse_y - region.y))
    if area.type == "VIEW_3D":
        depth = _depth_in_view(scene, depsgraph, camera, (area.spaces.active, region), at)
    else:
        depth = _depth_in_picture(scene, depsgraph, camera, region.view2d.region_to_view(*at))
    if depth == float("inf"):
        raise BadInputError("nothing is here")
    if depth <= 0.0:
        raise BadInputError("this is not in front of the camera")
    return depth


def _place_of(screen: bpy.types.Screen, x: int, y: int) -> tuple[bpy.types.Area, bpy.types.Region]:
    """Return the 3D View, or the Image Editor with a Render Result, that has this place of the window, and its region.
    Raises BadInputError where neither is there, or where a sidebar is.
    """
    for area in screen.areas:
        regions = [one for one in area.regions if _is_inside(one, x, y)]
        if not regions:
            continue
        picture = area.spaces.active.image if area.type == "IMAGE_EDITOR" else None
        shows = area.type == "VIEW_3D" or (picture is not None and picture.type == "RENDER_RESULT")
        # Sidebars and headers lie over the view.
        if shows and all(one.type == "WINDOW" for one in regions):
            return area, regions[0]
    raise BadInputError("point at something in a 3D View, or in the Render Result")


def _is_inside(region: bpy.types.Region, x: int, y: int) -> bool:
    """Return whether a region that is open has this place of the window."""
    return 0 <= x - region.x < region.width and 0 <= y - region.y < region.height and region.width * region.height > 1


def _depth_in_view(
    scene: bpy.types.Scene,
    depsgraph: bpy.types.Depsgraph,
    camera: bpy.types.Object,
    view: tuple[bpy.types.SpaceView3D, bpy.types.Region],
    at: Vector,
) -> float:
    """Return the camera's depth of what a 3D View shows at a place of its region; +inf where that is nothing."""
    space, region = view
    origin = view3d_utils.region_2d_to_origin_3d(region, region.data, at)
    direction = view3d_utils.region_2d_to_vector_3d(region, region.data, at)
    distance, _ = first_seen(scene, depsgraph, origin, direction, (0.0, MAX_VIEW_CLIPS * space.clip_end))
    if distance == float("inf"):
        return distance
    return -(camera.matrix_world.normalized().inverted() @ (origin + distance * direction)).z


def _depth_in_picture(
    scene: bpy.types.Scene,
    depsgraph: bpy.types.Depsgraph,
    camera: bpy.types.Object,
    share: tuple[float, float],
) -> float:
    """Return the depth of what the left eye sees at a place of the rendered picture, in shares of its width from the
    left and of its height from below; +inf where that is nothing.
    """
    if not all(0.0 <= part < 1.0 for part in share):
        raise BadInputError("point at something in the picture")
    frame = _pixels_shown(scene)
    x, y = frame.left + share[0] * frame.width, frame.top + (1.0 - share[1]) * frame.height
    left = stereo_cameras(camera, scene.render)["left"]
    clip = camera.data.clip_start, camera.data.clip_end
    depth, _ = next(cast_rays(scene, depsgraph, left, (np.array([x]), np.array([y])), clip))
    return depth


def _pixels_shown(scene: bpy.types.Scene) -> FramePixels:
    """Return what the Render Result shows, in the left eye's pixel positions: the whole frame, in which Blender leaves
    all but the render region empty, or the render region alone, where that is cropped, as it always is in our pairs.
    """
    region, delivery, content = frame_region(scene.render), result_of(scene).delivery, content_now()
    is_ours = content is not None and delivery is not None and content in (delivery.content, delivery.multiview)
    if is_ours or scene.render.use_crop_to_border:
        return FramePixels(0.0, 0.0, region.width, region.height)
    return frame_pixels(region)
