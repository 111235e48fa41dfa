"""Runs inside a Blender with a window: looks at a stereo pair in every way that the Image Editor's tab offers.
`-- ZIP FOLDER [PERCENT SAMPLES]`: see drive_common; the numbers are the render's. Not a test itself."""

import importlib
import sys
import time
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).resolve().parent))
from drive_common import (
    FOLDER,
    MODULE,
    MORE,
    area_of,
    click,
    facts,
    go,
    jobs,
    press,
    redrawn,
    region_of,
    results,
    run_steps,
    set_up,
    shoot,
    show_sidebar,
    until,
    window,
)

PERCENT, SAMPLES = [int(number) for number in MORE] or (25, 4)

MODES = ("ANAGLYPH", "LEFT", "RIGHT", "SIDE_BY_SIDE", "CROSS_EYED")

PREVIEW_PERCENT = 25

LOOKS = 8
"""Looks at where an eye is in a wiggle, at least."""

SHOTS = 6
"""Pictures that are taken of a wiggle: so many that not all of them fall on one eye."""


def modes():
    return importlib.import_module(f"{MODULE}.operators.view_modes")


def space():
    return area_of("IMAGE_EDITOR").spaces.active


def in_editor(at=None):
    """An override that stands in the Image Editor of a window, by default the first."""
    at = at or window()
    area = next(area for area in at.screen.areas if area.type == "IMAGE_EDITOR")
    region = next(region for region in area.regions if region.type == "WINDOW")
    return bpy.context.temp_override(window=at, area=area, region=region)


def shown():
    """The name of the image in the editor, and the mode that its tab has pressed."""
    with in_editor():
        return space().image.name if space().image else None, modes().mode_of(bpy.context)


def over_the_picture():
    region = region_of("IMAGE_EDITOR", "WINDOW")
    go(region.x + 0.3 * region.width, region.y + 0.1 * region.height)


def open_the_tab():
    facts["result_at_start"] = any(image.type == "RENDER_RESULT" for image in bpy.data.images)
    # The sidebar stands beside the picture, not over it.
    bpy.context.preferences.system.use_region_overlap = False
    area_of("VIEW_3D").type = "IMAGE_EDITOR"
    yield 0.5
    yield from show_sidebar("IMAGE_EDITOR", "Stereo")
    with in_editor():
        facts["without_a_pair"] = [
            bpy.ops.stereo_reproject.show_view.poll(),
            bpy.ops.stereo_reproject.wiggle.poll(),
            bpy.ops.stereo_reproject.export_wiggle.poll(),
        ]
    shoot("greyed")


def render_and_compare():
    scene = bpy.context.scene
    scene.render.resolution_percentage, scene.cycles.samples = PERCENT, SAMPLES
    scene.stereo_reproject.compare = True
    scene.stereo_reproject.preview_percentage, scene.stereo_reproject.preview_samples = PREVIEW_PERCENT, 2
    yield from click("IMAGE_EDITOR", "UI", "stereo_reproject_image(preview=False)")
    yield from until(lambda: jobs().running() is None, "the render never ended")
    yield from redrawn()
    facts["size"] = list(results().report["size"]) if results().report else None
    facts["warnings"] = list(results().warnings)
    region = region_of("IMAGE_EDITOR", "WINDOW")
    facts["editor"] = [region.x, region.y, region.width, region.height]


def seen_at():
    """Where the corners of the picture are in the editor, in pixels, as it was drawn last."""
    view = region_of("IMAGE_EDITOR", "WINDOW").view2d
    corners = [view.view_to_region(corner, corner, clip=False) for corner in (0.0, 1.0)]
    return [*corners[0], *corners[1]]


def wiggle_after_one_eye():
    """Left was pressed before, and Right never: Blender 5 shows an image at 100 % when it is shown for the first time.
    Then the user zooms and pans meanwhile."""
    yield from click("IMAGE_EDITOR", "UI", "show_view(mode='LEFT')")
    yield from redrawn()
    yield from click("IMAGE_EDITOR", "UI", "stereo_reproject.wiggle()")
    over_the_picture()
    facts["eyes_at"] = []
    for name in ("first", "moved"):
        yield from watch_turns(3)
        places = []
        while len(places) < LOOKS or len({seen[0] for seen in places}) < 2:
            eye = shown()[0]
            # What the editor draws is known only after that.
            yield 0.05
            if shown()[0] == eye:
                if eye not in [seen[0] for seen in places]:
                    shoot(f"{name}_{eye.rpartition(' ')[2].lower()}")
                places.append([eye, *seen_at(), space().zoom[0]])
            yield 0.05
        facts["eyes_at"].append(places)
        press("WHEELUPMOUSE")
        with in_editor():
            bpy.ops.image.view_pan(offset=(12.0, 7.0))
        yield from redrawn()
    press("ESC")
    yield from until(lambda: shown()[1] != "WIGGLE", "Esc does not end it")


def look_in_every_mode():
    """By its button; the mouse goes out of the way before the picture is taken. The Render Result is fitted first, as
    the others are by their buttons."""
    pictures = importlib.import_module(f"{MODULE}.operators.pictures")
    pictures.fit_editor(window(), area_of("IMAGE_EDITOR"))
    facts["modes"], facts["places"] = {}, {}
    for mode in MODES:
        yield from click("IMAGE_EDITOR", "UI", f"show_view(mode='{mode}')")
        over_the_picture()
        yield from redrawn()
        facts["modes"][mode] = [*shown(), space().zoom[0]]
        facts["widths"] = {**facts.get("widths", {}), mode: space().zoom[0] * space().image.size[0]}
        facts["places"][mode.lower()] = seen_at()
        shoot(mode.lower())
    facts["dirty"] = [image.name for image in bpy.data.images if image.is_dirty]


def watch_turns(count):
    """The names that the editor shows one after the other, and when each of them came."""
    turns = []
    start = time.monotonic()

    def look():
        name = space().image.name if space().image else None
        if not turns or turns[-1][0] != name:
            turns.append((name, time.monotonic() - start))
        return len(turns) > count

    yield from until(look, "nothing alternates")
    facts["turns"] = turns


def wiggle():
    yield from click("IMAGE_EDITOR", "UI", "stereo_reproject.wiggle()")
    over_the_picture()
    yield from watch_turns(8)
    facts["wiggling"] = shown()
    # Zooming and panning go on meanwhile. A fit that is due comes first.
    yield from redrawn()
    zoom = facts["zoom before"] = space().zoom[0]
    press("WHEELUPMOUSE")
    yield from until(lambda: space().zoom[0] > zoom, "the picture cannot be zoomed meanwhile")
    press("WHEELDOWNMOUSE")
    yield from redrawn()
    for number in range(SHOTS):
        yield 0.25
        shoot(f"wiggle_{number}")
    press("ESC")
    yield from until(lambda: shown()[1] != "WIGGLE", "Esc does not end it")
    yield from redrawn()
    facts["after_escape"] = shown()
    facts["left_over"] = ours()


def ours():
    return sorted(image.name for image in bpy.data.images if "stereo_reproject_kind" in image)


def end_wiggles_by_buttons():
    for name, command in (("again", "stereo_reproject.wiggle()"), ("other", "show_view(mode='LEFT')")):
        yield from click("IMAGE_EDITOR", "UI", "stereo_reproject.wiggle()")
        yield from until(lambda: shown()[1] == "WIGGLE", "it does not begin")
        yield from click("IMAGE_EDITOR", "UI", command)
        yield 0.6
        facts[f"after_{name}"] = shown()


def look_from_elsewhere():
    """By the buttons of a panel in another editor."""
    area = area_of("PROPERTIES")
    region = next(region for region in area.regions if region.type == "WINDOW")
    facts["looked"] = {}
    for mode in ("RIGHT", "WIGGLE", "CROSS_EYED"):
        with bpy.context.temp_override(window=window(), area=area, region=region):
            bpy.ops.stereo_reproject.look(mode=mode)
        yield from until(lambda mode=mode: shown()[1] == mode, f"{mode} does not come")
        yield from redrawn()
        facts["looked"][mode] = len(wiggles())


def fit_beside_the_sidebar():
    """The sidebar lies over the picture, as it does unless the preferences say otherwise."""
    bpy.context.preferences.system.use_region_overlap = True
    yield from redrawn()
    yield from click("IMAGE_EDITOR", "UI", "show_picture(which='PAIR')")
    over_the_picture()
    yield from redrawn()
    sidebar, region = region_of("IMAGE_EDITOR", "UI"), region_of("IMAGE_EDITOR", "WINDOW")
    left, _, right, _ = seen_at()
    facts["pair beside the sidebar"] = [left, right, sidebar.x - region.x, region.width]
    shoot("pair_beside_the_sidebar")
    for mode in ("LEFT", "SIDE_BY_SIDE"):
        yield from click("IMAGE_EDITOR", "UI", f"show_view(mode='{mode}')")
        over_the_picture()
        yield from redrawn()
    sidebar, region = region_of("IMAGE_EDITOR", "UI"), region_of("IMAGE_EDITOR", "WINDOW")
    facts["beside the sidebar"] = [space().zoom[0] * space().image.size[0], sidebar.x - region.x, region.width]
    shoot("beside_the_sidebar")
    # A scale at which the sidebar covers half of the editor.
    bpy.context.preferences.view.ui_scale = 1.9
    yield from redrawn()
    importlib.import_module(f"{MODULE}.operators.pictures").fit_editor(window(), area_of("IMAGE_EDITOR"))
    yield from redrawn()
    sidebar, region = region_of("IMAGE_EDITOR", "UI"), region_of("IMAGE_EDITOR", "WINDOW")
    facts["under a wide sidebar"] = [space().zoom[0] * space().image.size[0], sidebar.x - region.x, region.width]
    shoot("under_a_wide_sidebar")
    bpy.context.preferences.view.ui_scale = 1.0
    bpy.context.preferences.system.use_region_overlap = False
    yield from redrawn()


def undo():
    """To before our images were made, and then to before the first render, where even Blender's own is gone."""
    over_the_picture()
    bpy.ops.ed.undo_push(message="Before")
    yield from click("IMAGE_EDITOR", "UI", "show_view(mode='SIDE_BY_SIDE')")
    bpy.ops.ed.undo_push(message="After")
    over_the_picture()
    for name in ("undo", "undo_of_all"):
        press("Z", ctrl=True)
        yield from redrawn()
        facts[f"after_{name}"] = [*shown(), space().image.size[0] if space().image else 0]
        shoot(name)
    for _ in range(2):
        press("Z", ctrl=True, shift=True)
        yield from redrawn()
    facts["after_redo"] = [*shown(), space().image.size[0] if space().image else 0]


def flip_to_multiview():
    yield from click("IMAGE_EDITOR", "UI", "show_view(mode='RIGHT')")
    slots = bpy.data.images["Render Result"].render_slots
    facts["slots"] = [slot.name for slot in slots]
    facts["pair_slot"] = slots.active_index
    for side in ("MULTIVIEW", "OURS"):
        yield from click("IMAGE_EDITOR", "UI", f"show_side(side='{side}')")
        over_the_picture()
        yield from redrawn()
        facts[f"side {side}"] = [slots[slots.active_index].name, *shown()]
        shoot(f"side_{side.lower()}")
    yield from click("IMAGE_EDITOR", "UI", "show_view(mode='ANAGLYPH')")
    over_the_picture()
    press("J")
    yield from redrawn()
    facts["after_j"] = slots[slots.active_index].name
    shoot("flipped")
    press("J")
    yield from redrawn()
    facts["after_j_again"] = slots.active_index


def turn_to_an_empty_slot():
    """By the header's menu of slots, beside a panel in another editor, which then says the same as the tab here."""
    yield from click("IMAGE_EDITOR", "UI", "show_view(mode='ANAGLYPH')")
    looking = importlib.import_module(f"{MODULE}.operators.looking")
    slots, panels = (importlib.import_module(f"{MODULE}.operators.{name}") for name in ("slots", "panels"))
    draw, drawn = panels.draw_modes_elsewhere, []

    def note(*arguments):
        drawn.append([looking.mode_elsewhere(), slots.content_now().place])
        draw(*arguments)

    panels.draw_modes_elsewhere = note
    area_of("PROPERTIES").spaces.active.context = "OUTPUT"
    yield from redrawn()
    places = bpy.data.images["Render Result"].render_slots
    before, empty = places.active_index, 3
    facts["elsewhere"] = [[before, drawn[-1]]]
    for place in (empty, before):
        places.active_index = place
        yield from redrawn()
        facts["elsewhere"].append([place, drawn[-1], shown()[1]])
        shoot(f"slot_{'empty' if place == empty else 'pair'}")
    panels.draw_modes_elsewhere = draw


def render_again_side_by_side():
    """A preview, while both eyes are shown beside each other: they are the new pair's then."""
    yield from click("IMAGE_EDITOR", "UI", "show_view(mode='SIDE_BY_SIDE')")
    yield from click("IMAGE_EDITOR", "UI", "stereo_reproject_image(preview=True)")
    yield from until(lambda: jobs().running() is None, "the preview never ended")
    yield from redrawn()
    facts["after_preview"] = [*shown(), space().image.size[0], results().report["size"][0]]
    region = region_of("IMAGE_EDITOR", "WINDOW")
    sidebar = region_of("IMAGE_EDITOR", "UI")
    free = min(sidebar.x, region.x + region.width) - region.x if sidebar.width > 1 else region.width
    facts["fitted"] = space().zoom[0] * space().image.size[0] / (free if 2 * free > region.width else region.width)
    shoot("renewed")


def wiggle_until_a_render():
    yield from click("IMAGE_EDITOR", "UI", "stereo_reproject.wiggle()")
    yield from until(lambda: shown()[1] == "WIGGLE", "it does not begin")
    render, cycles = bpy.context.scene.render, bpy.context.scene.cycles
    kept = render.resolution_percentage, cycles.samples
    render.resolution_percentage, cycles.samples = 10, 1
    bpy.ops.render.render()
    render.resolution_percentage, cycles.samples = kept
    yield from until(lambda: shown()[1] != "WIGGLE", "a render does not end it")
    yield from redrawn()
    facts["after_render"] = shown()
    sizes = importlib.import_module(f"{MODULE}.operators.zoom_and_place")
    facts["size_of_another"] = sizes.picture_size(area_of("IMAGE_EDITOR"))
    facts["expected_size"] = [render.resolution_x // 10, render.resolution_y // 10]
    with in_editor():
        facts["one_view"] = []
        try:
            bpy.ops.stereo_reproject.show_view(mode="LEFT")
        except RuntimeError as error:
            facts["one_view"].append(str(error))
    facts["image_after_one_view"] = shown()[0]


def export():
    yield from click("IMAGE_EDITOR", "UI", "stereo_reproject_image(preview=True)")
    yield from until(lambda: jobs().running() is None, "the preview never ended")
    yield from redrawn()
    for name in ("wiggle.gif", "wiggle.mp4"):
        with in_editor():
            bpy.ops.stereo_reproject.export_wiggle(filepath=str(FOLDER / name), percentage=100)
    facts["content_kept"] = shown()
    facts["libraries"] = [str(path) for folder in map(Path, sys.path) for path in folder.glob("OpenEXR.*")]
    yield from click("IMAGE_EDITOR", "UI", "export_wiggle()")
    yield 1.5
    shoot("export")
    others = [other for other in bpy.context.window_manager.windows if other != window()]
    for other in others:
        other.event_simulate(type="ESC", value="PRESS", x=20, y=20)
        other.event_simulate(type="ESC", value="RELEASE", x=20, y=20)
    yield 1.0
    facts["file_windows"] = len(others)


def look_where_no_editor_is():
    """From a panel elsewhere: an editor opens in a window of its own, and Esc in this window ends a wiggle in that."""
    area, before = area_of("IMAGE_EDITOR"), bpy.context.preferences.view.render_display_type
    area.type = "VIEW_3D"
    bpy.context.preferences.view.render_display_type = "WINDOW"
    yield 0.5
    facts["opened"] = {}
    for mode in ("SIDE_BY_SIDE", "WIGGLE"):
        properties = area_of("PROPERTIES")
        region = next(region for region in properties.regions if region.type == "WINDOW")
        with bpy.context.temp_override(window=window(), area=properties, region=region):
            bpy.ops.stereo_reproject.look(mode=mode)
        yield 1.0
        facts["opened"][mode] = importlib.import_module(f"{MODULE}.operators.looking").mode_elsewhere()
    others = [other for other in bpy.context.window_manager.windows if other != window()]
    facts["opened"]["windows"] = len(others)
    region = region_of("VIEW_3D", "WINDOW")
    go(region.x + region.width // 2, region.y + region.height // 2)
    yield 0.3
    press("ESC")
    yield 1.0
    facts["opened"]["after Esc"] = importlib.import_module(f"{MODULE}.operators.looking").mode_elsewhere()
    for other in others:
        with bpy.context.temp_override(window=other):
            bpy.ops.wm.window_close()
    yield 0.5
    bpy.context.preferences.view.render_display_type = before
    area_of("VIEW_3D").type = "IMAGE_EDITOR"
    yield from redrawn()


def close_a_window_that_wiggles():
    yield from click("IMAGE_EDITOR", "UI", "show_view(mode='ANAGLYPH')")
    with bpy.context.temp_override(window=window()):
        bpy.ops.wm.window_new()
    yield 1.0
    other = bpy.context.window_manager.windows[-1]
    with in_editor(other):
        bpy.ops.stereo_reproject.wiggle("INVOKE_DEFAULT")
    yield 0.7
    facts["in_a_window"] = bool(wiggles())
    with bpy.context.temp_override(window=other):
        bpy.ops.wm.window_close()
    yield 0.7
    facts["after_closing"] = len(wiggles())


def wiggles():
    return importlib.import_module(f"{MODULE}.operators.wiggling")._wiggles


def look_where_it_is_narrow():
    bpy.context.preferences.view.ui_scale = 1.5
    yield from redrawn()
    facts["narrow"] = region_of("IMAGE_EDITOR", "UI").width
    shoot("narrow")
    bpy.context.preferences.view.ui_scale = 1.0
    yield from redrawn()


def switch_off_under_way():
    yield from click("IMAGE_EDITOR", "UI", "stereo_reproject.wiggle()")
    yield 0.5
    bpy.ops.preferences.addon_disable(module=MODULE)
    yield 1.0
    facts["switched_off"] = [space().image.name if space().image else None, ours()]
    shoot("off")


STEPS = (
    set_up,
    open_the_tab,
    render_and_compare,
    wiggle_after_one_eye,
    look_in_every_mode,
    wiggle,
    end_wiggles_by_buttons,
    look_from_elsewhere,
    fit_beside_the_sidebar,
    flip_to_multiview,
    turn_to_an_empty_slot,
    render_again_side_by_side,
    wiggle_until_a_render,
    export,
    look_where_no_editor_is,
    close_a_window_that_wiggles,
    undo,
    look_where_it_is_narrow,
    switch_off_under_way,
)


run_steps(STEPS)
