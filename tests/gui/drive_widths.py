"""Runs inside a Blender with a window: draws all panels of the extension at several widths and scales of the interface,
and uses the shortcuts for rendering. `-- ZIP FOLDER`: see drive_common. Not a test itself."""

import importlib
import sys
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).resolve().parent))
from drive_common import (
    FOLDER,
    MODULE,
    StuckError,
    area_of,
    facts,
    go,
    jobs,
    move,
    press,
    redrawn,
    region_of,
    results,
    run_steps,
    set_up,
    shoot,
    show_sidebar,
    turns,
    until,
    window,
)

SCALES = (1.0, 1.5)
WIDTHS_PX = (250, 400)
MAX_PAGES = 12
"""Screenshots of a region's panels, from their beginning to their end, at most."""

PAGE_TURNS = 12
"""Turns of the mouse wheel from one screenshot to the next: fewer than it takes to leave anything out."""

SETTLING_TURNS = 4
"""How often Blender has drawn, at least, after the wheel was turned."""

MAX_DRAGS = 4
"""Drags of a region's edge until it is where it is wanted: the first may change the scale of others."""


class VIEW3D_PT_too_long(bpy.types.Panel):  # noqa: N801 - Blender's naming rule
    """A panel with a label that is cut off, to know what that looks like."""

    bl_label = "Too Long"
    bl_space_type, bl_region_type, bl_category = "VIEW_3D", "UI", "Too Long"

    def draw(self, _context):
        self.layout.label(text="Much more than fits into any panel of such a width, however small its letters are " * 3)


def open_all_panels():
    """Panels that are closed at first are drawn open."""
    panels = [importlib.import_module(f"{MODULE}.operators.{name}") for name in ("panels", "image_panels")]
    for cls in (*panels[0].PANELS, *panels[1].IMAGE_PANELS):
        bpy.utils.unregister_class(cls)
        cls.bl_options = set()
    for cls in (*panels[0].PANELS, *panels[1].IMAGE_PANELS):
        bpy.utils.register_class(cls)


def prefer_small_previews():
    preferences = bpy.context.preferences.addons[MODULE].preferences
    preferences.preview_pixels, preferences.preview_samples = 120, 4
    bpy.context.preferences.view.render_display_type = "NONE"
    bpy.context.scene.stereo_reproject.preview_percentage = 1


def use_the_shortcuts():
    """As an artist does, with the mouse over the 3D View; and end each render again."""
    bpy.context.scene.render.filepath = str(FOLDER / "shots" / "shot_")
    region = region_of("VIEW_3D", "WINDOW")
    go(region.x + region.width // 2, region.y + region.height // 2)
    find = bpy.context.window_manager.keyconfigs.find_item_from_operator
    for name, held in (("image", {}), ("animation", {"alt": True})):
        _, item = find(f"render.stereo_reproject_{name}", context="INVOKE_REGION_WIN")
        yield 0.2
        press("F12", ctrl=True, shift=True, **held)
        yield 0.3
        run = jobs().running()
        started = "nothing" if run is None else "a picture" if run.animation is None else "an animation"
        is_whole = run is not None and run.settings.scene.size is None
        facts["shortcuts"][name] = [item.to_string() if item else None, started, is_whole]
        press("ESC")
        yield from until(lambda: jobs().running() is None, "Esc did not end the run")
        yield 0.3


def have_results():
    """A preview, so that the panels have something to say."""
    with bpy.context.temp_override(window=window(), area=area_of("VIEW_3D"), region=region_of("VIEW_3D", "WINDOW")):
        bpy.ops.render.stereo_reproject_image("INVOKE_DEFAULT", preview=True)
    run = jobs().running()
    yield from until(lambda: jobs().running() is None, "the preview never ended")
    if run.error is not None:
        raise StuckError(str(run.error))
    facts["preview_size"] = results().report["size"]
    facts["preview_samples"] = results().report["samples"]
    # Its panel then has all that it may have.
    bpy.context.scene.stereo_reproject.headset = "vr360"


def drag(start, end):
    facts["mouse"] = start
    x, y = start
    move(x, y)
    yield 0.1
    window().event_simulate(type="LEFTMOUSE", value="PRESS", x=x, y=y)
    yield 0.1
    for share in (0.3, 0.7, 1.0):
        move(x + share * (end[0] - x), y)
        yield 0.05
    window().event_simulate(type="LEFTMOUSE", value="RELEASE", x=int(end[0]), y=y)
    yield 0.3


def make_sidebar(kind, width):
    """Drag the sidebar's edge until it is as wide as wanted."""
    for _ in range(MAX_DRAGS):
        region = region_of(kind, "UI")
        if region.width == width:
            return
        edge, y = region.x, region.y + region.height // 2
        yield from drag((edge, y), (edge + region.width - width, y))


def make_properties(width):
    """Move the edge of the Properties editor until its panels are as wide as wanted."""
    for _ in range(MAX_DRAGS):
        area, region = area_of("PROPERTIES"), region_of("PROPERTIES", "WINDOW")
        if region.width == width:
            return
        edge, y = area.x - 1, area.y + area.height // 2
        yield from drag((edge, y), (edge + region.width - width, y))


def settled():
    """However slow that is: Blender draws each time after its events, and scrolling is done with the next."""
    since = turns["count"]
    yield from until(lambda: turns["count"] - since > SETTLING_TURNS, "the window stood still")


def shoot_pages(kind, region_type, name):
    """Screenshots from the first panel to the last."""
    region = region_of(kind, region_type)
    go(region.x + region.width // 2, region.y + region.height // 2)
    for _ in range(40):
        press("WHEELUPMOUSE")
    yield from settled()
    before = None
    for page in range(MAX_PAGES):
        shoot(f"widths-{name}-{page}")
        drawn = (FOLDER / f"widths-{name}-{page}.png").read_bytes()
        if drawn == before:
            (FOLDER / f"widths-{name}-{page}.png").unlink()
            facts["to the end"].append(name)
            return
        before = drawn
        facts["shots"][f"widths-{name}-{page}"] = [region.x, region.y, region.width, region.height]
        for _ in range(PAGE_TURNS):
            press("WHEELDOWNMOUSE")
        yield from settled()


def look_at_what_is_cut_off():
    bpy.utils.register_class(VIEW3D_PT_too_long)
    yield from show_sidebar("VIEW_3D", "Too Long")
    for scale in SCALES:
        bpy.context.preferences.view.ui_scale = scale
        yield from redrawn()
        yield from make_sidebar("VIEW_3D", WIDTHS_PX[0])
        shoot(f"control-{scale:g}")
        region = region_of("VIEW_3D", "UI")
        facts["controls"][f"control-{scale:g}"] = [region.x, region.y, region.width, region.height]
    bpy.utils.unregister_class(VIEW3D_PT_too_long)


def look_at_sidebars():
    for kind, name in (("VIEW_3D", "view"), ("IMAGE_EDITOR", "image")):
        area = area_of("VIEW_3D") or area_of("IMAGE_EDITOR")
        area.type = kind
        yield from show_sidebar(kind, "Stereo")
        for scale in SCALES:
            bpy.context.preferences.view.ui_scale = scale
            yield from redrawn()
            for width in WIDTHS_PX:
                yield from make_sidebar(kind, width)
                yield from shoot_pages(kind, "UI", f"{name}-{scale:g}-{width}")


def hide_other_output_panels():
    """Blender's own panels cut texts off; of the Output properties, ours are left."""
    types = [getattr(bpy.types, name) for name in dir(bpy.types) if "stereo_reproject" not in name]
    others = [cls for cls in types if getattr(cls, "bl_context", "") == "output"]
    for cls in sorted(others, key=lambda cls: not getattr(cls, "bl_parent_id", "")):
        bpy.utils.unregister_class(cls)


def look_at_output_properties():
    area_of("PROPERTIES").spaces.active.context = "OUTPUT"
    hide_other_output_panels()
    for scale in SCALES:
        bpy.context.preferences.view.ui_scale = scale
        yield from redrawn()
        for width in WIDTHS_PX:
            yield from make_properties(width)
            yield from shoot_pages("PROPERTIES", "WINDOW", f"output-{scale:g}-{width}")


def speak_german():
    """Texts of panels and reports in Blender's own languages, by a made-up table of translations."""
    words = importlib.import_module(f"{MODULE}.stereo_reproject.words").Words
    text = importlib.import_module(f"{MODULE}.operators.text")
    table = {("*", "{time} saved"): "{time} gespart", ("*", "Before Rendering"): "Vor dem Rendern"}
    bpy.app.translations.register("drive_widths", {"de_DE": table})
    view = bpy.context.preferences.view
    view.language = "de_DE"
    view.use_translate_interface = view.use_translate_reports = True
    facts["german"] = [say(words("{time} saved", time="12 s")) for say in (text.shown, text.reported)]
    yield from redrawn()
    shoot("german")
    view.language = "en_US"
    bpy.app.translations.unregister("drive_widths")


facts.update({"shots": {}, "controls": {}, "shortcuts": {}, "to the end": []})
run_steps(
    [
        set_up,
        open_all_panels,
        prefer_small_previews,
        use_the_shortcuts,
        have_results,
        look_at_what_is_cut_off,
        look_at_sidebars,
        look_at_output_properties,
        speak_german,
    ]
)
