"""Runs inside a Blender with a window: sets the depth of the scene by buttons, by an arrow and with the eyedropper.
`-- ZIP FOLDER [PRESET]`: see drive_common. Not a test itself."""

import importlib
import sys
from pathlib import Path

import bpy
from mathutils import Vector

sys.path.insert(0, str(Path(__file__).resolve().parent))
from drive_common import (
    MODULE,
    area_of,
    facts,
    find_button,
    go,
    move,
    press,
    redrawn,
    region_of,
    results,
    run_steps,
    scroll,
    set_up,
    shoot,
    show_sidebar,
    window,
)

places: dict = {}
"""Where the buttons are, by name."""

NEXT_ROW_PX = 24
"""From the upper part of a button to the middle of the one below it."""

DRAG_PX = 60
DRAG_STEPS = 6


def stereo():
    return bpy.context.scene.camera.data.stereo


def settings():
    return [stereo().interocular_distance, stereo().convergence_distance]


def place_of(point):
    """Where a point of the world is in the window."""
    from bpy_extras import view3d_utils

    region = region_of("VIEW_3D", "WINDOW")
    at = view3d_utils.location_3d_to_region_2d(region, area_of("VIEW_3D").spaces.active.region_3d, Vector(point))
    return region.x + at.x, region.y + at.y


def undo():
    region = region_of("VIEW_3D", "WINDOW")
    go(region.x + 0.2 * region.width, region.y + 0.85 * region.height)
    press("Z", ctrl=True)
    yield from redrawn()


def find_the_buttons():
    """Only one of them by what it runs, since that takes its time; the others stand below and beside it."""
    area_of("VIEW_3D").spaces.active.region_3d.view_perspective = "CAMERA"
    yield from show_sidebar("VIEW_3D", "Stereo")
    bpy.ops.ed.undo_push(message="Before")
    yield from find_button("VIEW_3D", "UI", "fit_to_comfort()")
    x, y = facts["button"]
    region = region_of("VIEW_3D", "UI")
    places.update(
        fit=(x, y),
        eyedropper=(region.x + 0.7 * region.width, y),
        show=(x, y - NEXT_ROW_PX),
        measure=(x, y - 2 * NEXT_ROW_PX),
    )


def push(name):
    go(*places[name])
    yield 0.5
    press("LEFTMOUSE")
    yield from redrawn()


def measure():
    yield from push("measure")
    shoot("measured")
    facts["measured"] = [results().depth.near, results().depth.far]


def fit():
    facts["unfitted"] = settings()
    yield from push("fit")
    facts["fitted"] = settings()
    shoot("fitted")
    yield from undo()
    facts["fit undone"] = settings()
    yield from push("fit")


def show_the_planes():
    yield from push("show")
    facts["shown"] = bpy.context.scene.stereo_reproject.show_depth
    shoot("planes through the camera")
    view = area_of("VIEW_3D").spaces.active.region_3d
    view.view_perspective = "PERSP"
    yield from look_from_the_side(view)
    shoot("planes from the side")


def look_from_the_side(view):
    """Half from above, with camera and scene in view."""
    scene = bpy.context.scene
    world = scene.camera.matrix_world.normalized()
    target = world @ Vector((0.0, 0.0, -0.6 * results().depth.far))
    side = world @ Vector((1.4 * results().depth.far, 0.7 * results().depth.far, 0.0))
    view.view_location = target
    view.view_distance = (side - target).length
    view.view_rotation = (side - target).to_track_quat("Z", "Y")
    yield from redrawn()


def drag_the_arrow():
    depth_view = importlib.import_module(f"{MODULE}.operators.depth_view")
    base = depth_view.arrow_base(bpy.context.scene)
    depth = depth_view.screen_depth()
    tail, head = (Vector(place_of(base @ Vector((0.0, 0.0, z)))) for z in (depth, 1.3 * depth))
    along = (head - tail).normalized()
    start = tail + 30.0 * along
    facts["arrow"] = [list(tail), list(along)]
    before = settings()
    bpy.ops.ed.undo_push(message="Before the arrow")
    go(*start)
    yield 0.5
    shoot("arrow")
    window().event_simulate(type="LEFTMOUSE", value="PRESS", x=int(start.x), y=int(start.y))
    yield 0.2
    for step in range(1, DRAG_STEPS + 1):
        move(*(start + along * (DRAG_PX * step / DRAG_STEPS)))
        yield 0.2
    shoot("dragging")
    end = start + along * DRAG_PX
    window().event_simulate(type="LEFTMOUSE", value="RELEASE", x=int(end.x), y=int(end.y))
    yield from redrawn()
    facts["dragged"] = [before, settings()]
    shoot("dragged")
    yield from undo()
    facts["drag undone"] = settings()
    yield from redrawn()


def set_the_screen_with_the_eyedropper():
    camera = bpy.context.scene.camera.matrix_world.normalized()
    point, depth = seen_far_away(camera)
    facts["clicked"] = depth
    yield from push("eyedropper")
    go(*place_of(point))
    yield 0.5
    shoot("eyedropper")
    press("RIGHTMOUSE")
    yield 0.5
    facts["eyedropper cancelled"] = settings()
    yield from push("eyedropper")
    go(*place_of(point))
    yield 0.3
    press("LEFTMOUSE")
    yield from redrawn()
    facts["picked"] = settings()
    shoot("picked")
    yield from undo()
    facts["pick undone"] = settings()


def use_the_eyedropper_in_another_window():
    """The picture may have a window of its own."""
    screen_here = importlib.import_module(f"{MODULE}.operators.screen_here")
    with bpy.context.temp_override(window=window()):
        bpy.ops.wm.window_new()
    yield 1.0
    other = bpy.context.window_manager.windows[-1]
    area = next(area for area in other.screen.areas if area.type == "VIEW_3D")
    region = next(region for region in area.regions if region.type == "WINDOW")
    middle = {"x": region.x + region.width // 2, "y": region.y + region.height // 2}
    for name, key in (("put away", "ESC"), ("picked", "LEFTMOUSE")):
        yield from push("eyedropper")
        other.event_simulate(type="MOUSEMOVE", value="NOTHING", **middle)
        yield 0.5
        for value in ("PRESS", "RELEASE"):
            other.event_simulate(type=key, value=value, **middle)
        yield 0.5
        facts[f"{name} elsewhere"] = [screen_here.is_out(), settings()]
    with bpy.context.temp_override(window=other):
        bpy.ops.wm.window_close()
    yield from undo()


def seen_far_away(camera):
    """The place that the 3D View shows where the scene's camera looks at its farthest, and its depth from there."""
    view = area_of("VIEW_3D").spaces.active.region_3d
    eye = view.view_matrix.inverted().translation
    scene, depsgraph = bpy.context.scene, bpy.context.evaluated_depsgraph_get()
    target = camera @ Vector((0.0, 0.0, -0.9 * results().depth.far))
    found, place, *_ = scene.ray_cast(depsgraph, eye, (target - eye).normalized())
    assert found
    return place, -(camera.inverted() @ place).z


def in_the_properties_too():
    area_of("PROPERTIES").spaces.active.context = "OUTPUT"
    yield 1.0
    yield from scroll("PROPERTIES", "WINDOW", "WHEELDOWNMOUSE")
    shoot("narrow")
    bpy.context.preferences.view.ui_scale = 1.5
    yield from redrawn()
    yield from scroll("VIEW_3D", "UI", "WHEELDOWNMOUSE")
    shoot("large")
    bpy.context.preferences.view.ui_scale = 1.0


def uncomfortable():
    stereo().interocular_distance *= 4.0
    yield from redrawn()
    yield from scroll("VIEW_3D", "UI", "WHEELDOWNMOUSE")
    shoot("uncomfortable")


def switch_off():
    """With the planes shown: what is drawn has to go with the extension."""
    bpy.ops.preferences.addon_disable(module=MODULE)
    yield from redrawn()
    shoot("gone")
    facts["gone"] = not hasattr(bpy.types.Scene, "stereo_reproject")


STEPS = (
    set_up,
    find_the_buttons,
    measure,
    fit,
    show_the_planes,
    drag_the_arrow,
    set_the_screen_with_the_eyedropper,
    use_the_eyedropper_in_another_window,
    in_the_properties_too,
    uncomfortable,
    switch_off,
)


run_steps(STEPS)
