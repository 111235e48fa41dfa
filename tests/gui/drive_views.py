"""Runs inside a Blender with a window: shows the cone of many views, renders a quilt from the panel, and has what is in
the way said. `-- ZIP FOLDER`: see drive_common. Not a test itself."""

import importlib
import math
import sys
from pathlib import Path

import bpy
from mathutils import Vector

sys.path.insert(0, str(Path(__file__).resolve().parent))
from drive_common import (
    FOLDER,
    MODULE,
    StuckError,
    area_of,
    click,
    facts,
    go,
    jobs,
    redrawn,
    region_of,
    results,
    run_steps,
    set_up,
    shoot,
    show_sidebar,
    until,
)

SHOWN_VIEW = 3
"""View from which on the running job is looked at."""


def chosen():
    return bpy.context.scene.stereo_reproject.views


def look_at_the_panel(name):
    """Without a tooltip over it; a setting that a script has changed is drawn when Blender is told."""
    region = region_of("VIEW_3D", "WINDOW")
    go(region.x + 0.3 * region.width, region.y + 0.1 * region.height)
    area_of("VIEW_3D").tag_redraw()
    yield from redrawn()
    shoot(name)


def open_the_panel():
    """Of the sub-panels in the 3D View it alone is left, and open."""
    panels = importlib.import_module(f"{MODULE}.operators.panels").PANELS
    ours = [cls for cls in panels if cls.__name__.startswith("VIEW3D_PT_stereo_reproject_")]
    for cls in ours:
        bpy.utils.unregister_class(cls)
    (views,) = [cls for cls in ours if cls.__name__.endswith("_views")]
    views.bl_options = set()
    bpy.utils.register_class(views)
    yield from show_sidebar("VIEW_3D", "Stereo")
    camera = bpy.context.scene.camera
    # In the middle of the box.
    camera.data.stereo.convergence_distance = camera.matrix_world.translation.length
    look_from_above()
    yield from look_at_the_panel("panel")


def look_from_above():
    """With the cameras, the focus plane and the scene in the part of the view that the sidebar leaves free."""
    scene = bpy.context.scene
    world = scene.camera.matrix_world.normalized()
    focus = scene.camera.data.stereo.convergence_distance
    view = area_of("VIEW_3D").spaces.active.region_3d
    target = world @ Vector((0.15 * focus, 0.0, -0.6 * focus))
    eye = world @ Vector((1.2 * focus, 1.1 * focus, 0.7 * focus))
    view.view_perspective = "PERSP"
    view.view_location, view.view_distance = target, (eye - target).length
    view.view_rotation = (eye - target).to_track_quat("Z", "Y")


def show_the_cone():
    chosen().show_cone = True
    yield from look_at_the_panel("cone")
    area_of("VIEW_3D").spaces.active.region_3d.view_perspective = "CAMERA"
    yield from look_at_the_panel("cone through the camera")
    look_from_above()


def find_eevee_in_the_way():
    bpy.context.scene.render.engine = "BLENDER_EEVEE"
    yield from look_at_the_panel("eevee")
    facts["eevee"] = bpy.ops.render.stereo_reproject_views.poll()
    bpy.context.scene.render.engine = "CYCLES"


def choose_small_views():
    scene = bpy.context.scene
    chosen().display, chosen().count, chosen().columns, chosen().rows = "OTHER", 12, 4, 3
    chosen().cone = math.radians(12.0)
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 240, 180, 100
    scene.cycles.samples, scene.cycles.use_denoising = 16, False
    scene.render.filepath = str(FOLDER / "shot_")
    yield from look_at_the_panel("other")


def render_a_quilt():
    """By the button; the preferences have the 3D View become an Image Editor meanwhile."""
    words = importlib.import_module(f"{MODULE}.operators.run_words")
    yield from click("VIEW_3D", "UI", "stereo_reproject_views()")
    seen, shot = {}, False
    while jobs().running() is not None:
        run = jobs().running()
        seen[words.frame_words(run)] = None
        if not shot and run.detail.startswith(f"view {SHOWN_VIEW} "):
            shot = True
            shoot("running")
        yield 0.1
    facts["progress"] = [text for text in seen if text]
    yield from redrawn()
    if results().views is None:
        raise StuckError(f"there are no views: {results().ended}")
    facts["how"] = [view["how"] for view in results().views.report["views"]]
    facts["files"] = sorted(path.name for path in results().views.folder.iterdir())


def look_at_the_quilt():
    yield from until(lambda: area_of("IMAGE_EDITOR") is not None, "there is no Image Editor")
    yield from redrawn()
    image = area_of("IMAGE_EDITOR").spaces.active.image
    facts["shown"] = [image.name, list(image.size)]
    region = region_of("IMAGE_EDITOR", "WINDOW")
    corners = [region.view2d.view_to_region(corner, corner, clip=False) for corner in (0.0, 1.0)]
    facts["place"] = [*corners[0], *corners[1], region.width, region.height]
    shoot("quilt")


def look_at_the_verdict():
    area_of("IMAGE_EDITOR").type = "VIEW_3D"
    yield from show_sidebar("VIEW_3D", "Stereo")
    look_from_above()
    yield from look_at_the_panel("verdict")


run_steps(
    [
        set_up,
        open_the_panel,
        show_the_cone,
        find_eevee_in_the_way,
        choose_small_views,
        render_a_quilt,
        look_at_the_quilt,
        look_at_the_verdict,
    ]
)
