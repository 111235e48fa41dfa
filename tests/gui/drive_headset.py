"""Runs inside a Blender with a window: renders a preview as VR180 from the panel, looks at its cut-outs, and turns the
camera into a panorama. `-- ZIP FOLDER`: see drive_common. Not a test itself."""

import importlib
import sys
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).resolve().parent))
from drive_common import (
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


def chosen():
    return bpy.context.scene.stereo_reproject


def look_at_the_panel(name):
    """Without a tooltip over it; a setting that a script has changed is drawn when Blender is told."""
    region = region_of("VIEW_3D", "WINDOW")
    go(region.x + 0.3 * region.width, region.y + 0.2 * region.height)
    area_of("VIEW_3D").tag_redraw()
    yield from redrawn()
    shoot(name)


def open_the_panel():
    """Of the sub-panels in the 3D View it alone is left, and open."""
    panels = importlib.import_module(f"{MODULE}.operators.panels").PANELS
    ours = [cls for cls in panels if cls.__name__.startswith("VIEW3D_PT_stereo_reproject_")]
    for cls in ours:
        bpy.utils.unregister_class(cls)
    (headset,) = [cls for cls in ours if cls.__name__.endswith("_headset")]
    headset.bl_options = set()
    bpy.utils.register_class(headset)
    yield from show_sidebar("VIEW_3D", "Stereo")
    yield from look_at_the_panel("camera")


def choose_vr180():
    chosen().headset, chosen().headset_height = "vr180", 256
    chosen().preview_percentage, chosen().preview_samples = 50, 4
    bpy.context.preferences.addons[MODULE].preferences.preview_pixels = 128
    yield from look_at_the_panel("vr180")


def change_the_resolution():
    """In another editor, with the mouse over the picture: the panel tells sizes in pixels."""
    panels = importlib.import_module(f"{MODULE}.operators.panels")
    draw, drawn = panels.draw_buttons, []

    def note(layout):
        drawn.append(bpy.context.area.type)
        draw(layout)

    panels.draw_buttons = note
    yield 0.5
    drawn.clear()
    bpy.context.scene.render.resolution_x += 2
    yield 1.0
    facts["drawn anew"] = sorted({*drawn})
    bpy.context.scene.render.resolution_x -= 2
    panels.draw_buttons = draw


def render_a_preview():
    """By the button in the panel."""
    bpy.context.preferences.view.render_display_type = "NONE"
    yield from click("VIEW_3D", "UI", "stereo_reproject_image(preview=True)")
    yield from until(lambda: jobs().running() is None, "the preview never ended")
    if results().report is None:
        raise StuckError("there is no pair")
    facts["report"] = {key: results().report.get(key) for key in ("panorama", "size")}
    camera = bpy.context.scene.camera
    facts["camera"] = [camera.data.type, list(camera.rotation_euler)]
    facts["resolution"] = [bpy.context.scene.render.resolution_x, bpy.context.scene.render.resolution_y]


def look_at_the_cutouts():
    area_of("VIEW_3D").type = "IMAGE_EDITOR"
    yield from show_sidebar("IMAGE_EDITOR", "Stereo")
    yield from redrawn()
    yield from click("IMAGE_EDITOR", "UI", "show_picture(which='CUTOUTS')")
    yield from redrawn()
    image = area_of("IMAGE_EDITOR").spaces.active.image
    facts["shown"] = [image.name, list(image.size)]
    shoot("cutouts")
    area_of("IMAGE_EDITOR").type = "VIEW_3D"
    yield from redrawn()


def turn_the_camera_into_a_panorama():
    bpy.context.scene.camera.data.type = "PANO"
    yield from look_at_the_panel("panorama")


def take_an_orthographic_one():
    bpy.context.scene.camera.data.type = "ORTHO"
    yield from look_at_the_panel("orthographic")


run_steps(
    [
        set_up,
        open_the_panel,
        choose_vr180,
        change_the_resolution,
        render_a_preview,
        look_at_the_cutouts,
        turn_the_camera_into_a_panorama,
        take_an_orthographic_one,
    ]
)
