"""Runs inside a Blender with a window: installs the zip and uses it as an artist does, with mouse and keyboard.
`-- ZIP FOLDER [PERCENT SAMPLES]`: see drive_common; the numbers are the preview's. Not a test itself."""

import importlib
import sys
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
    find_button,
    find_property,
    go,
    jobs,
    press,
    redrawn,
    region_of,
    results,
    run_steps,
    scroll,
    set_up,
    shoot,
    show_sidebar,
    turns,
    until,
    window,
)

PREVIEW = [int(number) for number in MORE]

BUTTONS = {
    "preview": "stereo_reproject_image(preview=True)",
    "render": "stereo_reproject_image(preview=False)",
    "animation": "stereo_reproject_animation()",
}
"""The render buttons, by what each runs."""

seen: dict = {}
"""What later steps compare with."""


def values():
    """What of the file a user would notice if it changed."""
    scene = bpy.context.scene
    render, layer = scene.render, scene.view_layers[0]
    kinds = [prop.identifier for prop in bpy.data.bl_rna.properties if prop.type == "COLLECTION"]
    found = {kind: sorted(block.name for block in getattr(bpy.data, kind)) for kind in kinds}
    for kind in ("images", "all_ids"):
        found[kind] = [name for name in found.get(kind, []) if name != "Render Result"]
    plain = [prop.identifier for prop in render.bl_rna.properties if prop.type not in ("POINTER", "COLLECTION")]
    found["render"] = {name: repr(getattr(render, name)) for name in plain}
    found["layer"] = [layer.use, layer.use_grease_pencil, layer.use_pass_z]
    found["frame"] = [scene.frame_current, scene.frame_start, scene.frame_end]
    return found


def look_at_the_file():
    import _cycles

    facts["osl"] = bool(_cycles.with_osl)
    seen["before"] = values()


def find_the_buttons(kind):
    """Where the render buttons are in a sidebar, and how high that reaches."""
    region = region_of(kind, "UI")
    found = {"top": [region.x, region.y + region.height]}
    for name, command in BUTTONS.items():
        yield from find_button(kind, "UI", command)
        found[name] = facts["button"]
    facts[f"buttons of {kind}"] = found


def look_at_the_panels():
    area_of("VIEW_3D").spaces.active.region_3d.view_perspective = "CAMERA"
    yield from show_sidebar("VIEW_3D", "Stereo")
    shoot("panel")
    yield from find_the_buttons("VIEW_3D")
    area_of("PROPERTIES").spaces.active.context = "OUTPUT"
    yield 1.0
    yield from scroll("PROPERTIES", "WINDOW", "WHEELDOWNMOUSE")
    shoot("output")


def check_the_scene():
    yield from click("VIEW_3D", "UI", "stereo_reproject.check_scene()")
    yield from until(lambda: jobs().running() is None, "the check never ended")
    yield from scroll("VIEW_3D", "UI", "WHEELDOWNMOUSE")
    shoot("checked")
    yield from scroll("VIEW_3D", "UI", "WHEELUPMOUSE")
    facts["inspection"] = results().inspection is not None
    facts["unchanged_by_check"] = values() == seen["before"]


def cancel_with_escape():
    yield from click("VIEW_3D", "UI", "stereo_reproject_image(preview=False)")
    facts["started"] = jobs().running() is not None
    facts["second_refused"] = not bpy.ops.render.stereo_reproject_image.poll()
    run, since = jobs().running(), turns["count"]
    yield from until(lambda: run.stage == "source", "the source was never rendered")
    # However slowly a driver in software draws: a render of minutes must leave room for this much.
    yield from until(lambda: turns["count"] - since > 10 or run.finished, "the window stood still")
    shoot("running")
    facts["turns"] = turns["count"] - since
    yield from escape_from_a_menu_and_a_field(run)
    folder = run.folder.parent
    press("ESC")
    yield from until(lambda: jobs().running() is None, "Esc did not end the run")
    yield 1.0
    facts["cancelled"] = results().report is None and not folder.exists()
    facts["unchanged_by_cancel"] = values() == seen["before"]
    shoot("cancelled")


def escape_from_a_menu_and_a_field(run):
    """They have Esc first, and the run goes on. A number field is edited after a click, until Esc or Enter."""
    facts["escaped"] = {}
    region = region_of("VIEW_3D", "WINDOW")
    go(region.x + 200, region.y + 200)
    with bpy.context.temp_override(window=window(), area=area_of("VIEW_3D"), region=region):
        bpy.ops.wm.call_menu(name="VIEW3D_MT_add")
    yield from redrawn()
    shoot("menu_under_way")
    press("ESC")
    yield from redrawn()
    shoot("menu_escaped")
    facts["escaped"]["menu"] = run.is_ending
    field = bpy.context.scene.camera.data.stereo.interocular_distance
    yield from find_property("VIEW_3D", "UI", "interocular_distance")
    press("LEFTMOUSE")
    yield from redrawn()
    for key, text in (("NINE", "9"), ("ESC", "")):
        window().event_simulate(type=key, value="PRESS", unicode=text, x=facts["mouse"][0], y=facts["mouse"][1])
        window().event_simulate(type=key, value="RELEASE", x=facts["mouse"][0], y=facts["mouse"][1])
        yield from redrawn()
    facts["escaped"]["field"] = run.is_ending
    facts["field as before"] = bpy.context.scene.camera.data.stereo.interocular_distance == field


def cancel_with_the_button():
    yield from click("VIEW_3D", "UI", "stereo_reproject_image(preview=False)")
    yield from click("VIEW_3D", "UI", "stereo_reproject.cancel()")
    facts["cancel_button"] = facts["button"]
    yield from until(lambda: jobs().running() is None, "Cancel did not end the run")
    yield 0.5
    facts["unchanged_by_cancel_button"] = values() == seen["before"]


def cancel_in_another_window():
    with bpy.context.temp_override(window=window()):
        bpy.ops.wm.window_new()
    yield 1.5
    other = bpy.context.window_manager.windows[-1]
    yield from click("VIEW_3D", "UI", "stereo_reproject_image(preview=False)")
    for value in ("PRESS", "RELEASE"):
        other.event_simulate(type="ESC", value=value, x=20, y=20)
    yield from until(lambda: jobs().running() is None, "Esc in another window did not end the run")
    facts["other_window"] = results().report is None
    with bpy.context.temp_override(window=other):
        bpy.ops.wm.window_close()
    yield 0.5


def set_the_convergence_and_undo_it():
    camera = bpy.context.scene.camera.data
    camera.dof.focus_distance = 4.25
    distance = camera.stereo.convergence_distance
    bpy.ops.ed.undo_push(message="Before")
    yield from click("VIEW_3D", "UI", "set_convergence(target='FOCUS')")
    yield 0.5
    facts["convergence"] = camera.stereo.convergence_distance
    region = region_of("VIEW_3D", "WINDOW")
    go(region.x + 0.3 * region.width, region.y + 0.3 * region.height)
    press("Z", ctrl=True)
    yield 1.0
    # An undo makes new data of everything.
    facts["undone"] = bpy.context.scene.camera.data.stereo.convergence_distance == distance


def open_an_image_editor():
    """With a plain picture: what is rendered next is drawn where one eye was drawn before. Without an Image Editor,
    Blender would show renders in place of the 3D View.
    """
    render, cycles = bpy.context.scene.render, bpy.context.scene.cycles
    kept = render.resolution_percentage, cycles.samples
    render.resolution_percentage, cycles.samples = 10, 1
    bpy.ops.render.render()
    render.resolution_percentage, cycles.samples = kept
    area = area_of("PROPERTIES")
    area.type = "IMAGE_EDITOR"
    area.spaces.active.image = bpy.data.images["Render Result"]
    yield 1.0


def preview():
    scene = bpy.context.scene
    if PREVIEW:
        scene.stereo_reproject.preview_percentage, scene.stereo_reproject.preview_samples = PREVIEW
    seen["before"] = values()
    yield from click("VIEW_3D", "UI", "stereo_reproject_image(preview=True)")
    yield from until(lambda: jobs().running() is None, "the preview never ended")
    yield from redrawn()
    facts["preview"] = dict(results().report["fractions"]) if results().report else None
    facts["fill"] = results().report["fill"] if results().report else None
    facts["result"] = [image.name for image in bpy.data.images if image.type == "RENDER_RESULT" and image.has_data]
    facts["unchanged_by_preview"] = values() == seen["before"]
    shoot("preview")
    space = area_of("IMAGE_EDITOR").spaces.active
    facts["drawn_in_stereo"] = space.show_stereo_3d
    space.show_stereo_3d = False
    yield from redrawn()
    shoot("flat")
    space.show_stereo_3d = True
    region = region_of("IMAGE_EDITOR", "WINDOW")
    size = results().report["size"]
    facts["size"] = list(size)
    facts["fitted"] = [space.zoom[0] * size[0] / region.width, space.zoom[1] * size[1] / region.height]
    facts["editor"] = [region.x, region.y, region.width, region.height]


def show_it_large():
    area_of("IMAGE_EDITOR").type = "PROPERTIES"
    with bpy.context.temp_override(window=window()):
        bpy.ops.render.view_show("INVOKE_DEFAULT")
    yield from until(lambda: area_of("IMAGE_EDITOR"), "no Image Editor was opened")
    yield 1.0


def look_at_the_pictures():
    yield from show_sidebar("IMAGE_EDITOR", "Stereo")
    shoot("result")
    yield from find_the_buttons("IMAGE_EDITOR")
    yield from click("IMAGE_EDITOR", "UI", "show_picture(which='HOLES')")
    yield 1.0
    shoot("holes")
    space = area_of("IMAGE_EDITOR").spaces.active
    facts["holes"] = [space.image.name, list(space.image.size)] if space.image else None


def animate():
    scene = bpy.context.scene
    settings = scene.render.image_settings
    settings.file_format, settings.views_format = "PNG", "INDIVIDUAL"
    scene.frame_end, scene.render.filepath = 2, str(FOLDER / "shots" / "shot_")
    scene.render.resolution_percentage = 10
    bpy.ops.render.stereo_reproject_animation("INVOKE_DEFAULT")
    yield from until(lambda: jobs().running() is None, "the animation never ended")
    yield 1.0
    facts["animation"] = sorted(path.name for path in (FOLDER / "shots").glob("shot_[0-9]*"))
    player = FOLDER / "player"
    player.write_text('#!/bin/sh\necho "$@" >"$0.told"\n', encoding="utf-8")
    player.chmod(0o755)
    paths = bpy.context.preferences.filepaths
    paths.animation_player_preset, paths.animation_player = "CUSTOM", str(player)
    facts["played"] = {}
    for name, held in (("ours", {"shift": True}), ("Blender's", {}), ("Blender's, with plain files", {})):
        if "plain" in name:
            (FOLDER / "shots" / "shot_0001.png").touch()
        press("F11", ctrl=True, **held)
        told = player.with_name("player.told")
        yield from until(lambda told=told: told.exists() and told.stat().st_size, f"{name} key has played nothing")
        facts["played"][name] = Path(told.read_text(encoding="utf-8").strip()).name
        told.unlink()
    facts["stereoscopy"] = scene.render.use_multiview


def look_at_frames():
    """By the button, then the timeline is played: what the editor shows follows it."""
    yield from click("IMAGE_EDITOR", "UI", "stereo_reproject.look_at_frame()")
    space = area_of("IMAGE_EDITOR").spaces.active
    yield from until(lambda: space.image.name == "Stereo Frames", "the frame is not shown")
    yield 0.5
    shoot("frame")
    region = region_of("IMAGE_EDITOR", "WINDOW")
    sides = zip(space.image.size, (region.width, region.height), strict=True)
    shares = [space.zoom[0] * side / room for side, room in sides]
    facts["frame"] = [space.image.is_stereo_3d, space.show_stereo_3d, max(shares)]
    seen = facts["frames played"] = []
    bpy.context.scene.frame_start = 1
    with bpy.context.temp_override(window=window()):
        bpy.ops.screen.animation_play()

    def look():
        name = Path(space.image.filepath).name
        if name not in seen[-1:]:
            seen.append(name)
        return len(seen) > 3

    yield from until(look, "the editor does not follow the timeline")
    with bpy.context.temp_override(window=window()):
        bpy.ops.screen.animation_cancel()
    yield from click("IMAGE_EDITOR", "UI", "stereo_reproject.look_at_frame()")
    yield from until(lambda: space.image.type == "RENDER_RESULT", "a second press does not show the Render Result")


def warp_on_the_gpu():
    """What a script in the window's own process has."""
    # The extension has no synthetic scenes: it is the checkout's engine that is tried, which is the same.
    sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
    facts["warp"] = importlib.import_module("tests.gui.warp_in_the_window").agreement()
    yield 0.5


def switch_off_under_way():
    bpy.ops.render.stereo_reproject_image("INVOKE_DEFAULT")
    yield 1.0
    bpy.ops.preferences.addon_disable(module=MODULE)
    yield 1.0
    shoot("gone")
    facts["gone"] = not hasattr(bpy.types.Scene, "stereo_reproject")
    bpy.ops.preferences.addon_enable(module=MODULE)
    yield 0.5
    facts["back"] = hasattr(bpy.types.Scene, "stereo_reproject")


STEPS = (
    set_up,
    look_at_the_file,
    look_at_the_panels,
    check_the_scene,
    open_an_image_editor,
    cancel_with_escape,
    cancel_with_the_button,
    cancel_in_another_window,
    set_the_convergence_and_undo_it,
    preview,
    show_it_large,
    look_at_the_pictures,
    animate,
    look_at_frames,
    warp_on_the_gpu,
    switch_off_under_way,
)


run_steps(STEPS)
