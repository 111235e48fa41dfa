"""Runs inside a Blender with a window: renders with an Image Editor open, and looks at what it shows meanwhile.
`-- ZIP FOLDER`: see drive_common. Not a test itself."""

import importlib
import sys
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).resolve().parent))
import drive_common
from drive_common import (
    FOLDER,
    MODULE,
    area_of,
    click,
    facts,
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

NAME = "Stereo Render"
"""Beginning of the names of images that show an eye under way."""


def space():
    area = area_of("IMAGE_EDITOR")
    return None if area is None else area.spaces.active


def shown():
    """The name of the image in the Image Editor; "" without either."""
    return space().image.name if space() is not None and space().image is not None else ""


def reports():
    """What the Info Editor has: a line for each report."""
    area = area_of("PROPERTIES")
    area.type = "INFO"
    region = next(region for region in area.regions if region.type == "WINDOW")
    with bpy.context.temp_override(window=window(), area=area, region=region):
        bpy.ops.info.select_all(action="SELECT")
        bpy.ops.info.report_copy()
    area.type = "PROPERTIES"
    return bpy.context.window_manager.clipboard


def words():
    return importlib.import_module(f"{MODULE}.operators.run_words")


def start(*, preview):
    with bpy.context.temp_override(window=window()):
        bpy.ops.render.stereo_reproject_image("INVOKE_DEFAULT", preview=preview)


def picture():
    yield from until(lambda: shown().startswith(NAME) or jobs().running() is None, "nothing was ever shown")
    yield from redrawn()


def ended():
    yield from until(lambda: jobs().running() is None, "the run never ended")
    yield from redrawn()


def left():
    """The images of ours that are in the file."""
    return [image.name for image in bpy.data.images if image.name.startswith(NAME)]


def open_an_image_editor():
    render, cycles = bpy.context.scene.render, bpy.context.scene.cycles
    render.resolution_percentage, cycles.samples = 10, 1
    bpy.ops.render.render()
    # Soon something to see, and minutes until the end.
    render.resolution_percentage, cycles.samples = 40, 4096
    area = area_of("PROPERTIES")
    area.type = "IMAGE_EDITOR"
    area.spaces.active.image = bpy.data.images["Render Result"]
    yield from show_sidebar("VIEW_3D", "Stereo")
    region = region_of("IMAGE_EDITOR", "WINDOW")
    facts["editor"] = [region.x, region.y, region.width, region.height]
    shoot("before")


def waiting():
    """The second Blender that waits for a job, or None."""
    return next(iter(importlib.import_module(f"{MODULE}.operators.second_blender")._waiting), None)


def watch_a_preview():
    yield from until(waiting, "no second Blender was started")
    second = waiting()
    start(preview=True)
    run = jobs().running()
    facts["taken"] = run._worker is second.worker
    facts["words"] = [words().progress_of(run)[1]]
    facts["shown"], taken = [], {}
    while jobs().running() is not None:
        if shown() not in facts["shown"]:
            facts["shown"].append(shown())
            if shown().startswith(NAME):
                yield 0.3
                shoot("source" if "source" not in taken else "target")
                taken["source"] = taken.get("source", jobs().running() is not None)
        said = words().progress_of(run)[1]
        if said != facts["words"][-1]:
            facts["words"].append(said)
        yield 0.05
    yield from redrawn()
    facts["drawn under way"] = taken.get("source")
    facts["after"] = [shown(), left()]
    shoot("after")
    yield from until(waiting, "no second Blender was started again")


def save_and_undo_under_way():
    bpy.ops.ed.undo_push(message="Before")
    start(preview=False)
    yield from picture()
    facts["before undo"] = shown()
    copy = FOLDER / "saved.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(copy), copy=True)
    with bpy.data.libraries.load(str(copy)) as (inside, _):
        facts["saved"] = list(inside.images)
    with bpy.context.temp_override(window=window()):
        bpy.ops.ed.undo_push(message="Under way")
        bpy.ops.ed.undo()
    yield from until(lambda: shown().startswith(NAME) or jobs().running() is None, "nothing is shown after an undo")
    facts["after undo"] = shown()


def cancel_with_escape():
    progress = jobs().running().progress
    yield from until(lambda: progress._stage_fraction, "nobody knew how many samples were done")
    facts["samples"] = progress._stage_fraction
    press("ESC")
    yield from ended()
    facts["cancelled"] = [shown(), left()]
    shoot("cancelled")


def turn_to_something_else():
    other = bpy.data.images.new("Other", 8, 8)
    bpy.context.scene.stereo_reproject.preview_samples = 4
    start(preview=True)
    yield from picture()
    space().image = other
    yield from ended()
    facts["turned"] = [shown(), left()]
    space().image = bpy.data.images["Render Result"]
    bpy.data.images.remove(other)
    yield 0.5


def animate():
    scene = bpy.context.scene
    scene.render.image_settings.file_format = "PNG"
    scene.frame_end, scene.render.filepath = 2, str(FOLDER / "shots" / "shot_")
    scene.render.resolution_percentage, scene.cycles.samples = 10, 64
    with bpy.context.temp_override(window=window()):
        bpy.ops.render.stereo_reproject_animation("INVOKE_DEFAULT")
    run = jobs().running()
    facts["frames"], facts["frames shown"] = [], []
    while jobs().running() is not None:
        for seen, what in (("frames", words().frame_words(run)), ("frames shown", shown())):
            if what not in facts[seen]:
                facts[seen].append(what)
        yield 0.05
    facts["animated"] = [shown(), left()]
    scene.render.resolution_percentage, scene.cycles.samples = 40, 4096


def without_an_image_editor():
    """What Blender opens for a render is closed again after Esc: an area that was another editor's, or a window."""
    area_of("IMAGE_EDITOR").type = "PROPERTIES"
    yield 0.5
    kinds = [area.type for area in window().screen.areas]
    for display in ("AREA", "WINDOW"):
        bpy.context.preferences.view.render_display_type = display
        start(preview=False)
        run = jobs().running()
        yield from until(lambda run=run: run.picture is not None, "there was no picture")
        yield from redrawn()
        windows = list(bpy.context.window_manager.windows)
        areas = [area for one in windows for area in one.screen.areas if area.type == "IMAGE_EDITOR"]
        opened = [len(windows), [area.spaces.active.image.name for area in areas]]
        press("ESC")
        yield from ended()
        yield 0.5
        closed = [len(bpy.context.window_manager.windows), [area.type for area in window().screen.areas] == kinds]
        facts[f"opened as {display}"] = [opened, closed, left()]
    yield from animate_without_an_image_editor()


def animate_without_an_image_editor():
    """The result is as large in the editor that Blender opens as its frames were under way."""
    scene = bpy.context.scene
    scene.frame_end, scene.render.filepath = 1, str(FOLDER / "one" / "shot_")
    kept = scene.render.resolution_percentage, scene.cycles.samples
    scene.render.resolution_percentage, scene.cycles.samples = 10, 16
    bpy.context.preferences.view.render_display_type = "AREA"
    with bpy.context.temp_override(window=window()):
        bpy.ops.render.stereo_reproject_animation("INVOKE_DEFAULT")
    yield from ended()
    yield from redrawn()
    region, size = region_of("IMAGE_EDITOR", "WINDOW"), results().animation["frames"][0]["size"]
    shares = [zoom * side for zoom, side in zip(space().zoom, size, strict=True)]
    facts["fitted after an animation"] = max(shares[0] / region.width, shares[1] / region.height)
    shoot("animated_in_a_new_editor")
    with bpy.context.temp_override(window=window(), area=area_of("IMAGE_EDITOR")):
        bpy.ops.render.view_cancel()
    scene.render.resolution_percentage, scene.cycles.samples = kept
    scene.frame_end, scene.render.filepath = 2, str(FOLDER / "shots" / "shot_")
    yield 0.5


def click_twice_on_animation():
    """The second click comes where Cancel stands by then; in its time, one there ends the run."""
    bpy.context.preferences.view.render_display_type = "WINDOW"
    yield from click("VIEW_3D", "UI", "stereo_reproject_animation()")
    run = jobs().running()
    press("LEFTMOUSE")
    yield from redrawn()
    facts["double click"] = run is not None and jobs().running() is run and not run.is_ending
    first = facts["button"]
    yield from click("VIEW_3D", "UI", "stereo_reproject.cancel()")
    facts["between buttons"] = [abs(one - other) for one, other in zip(first, facts["button"], strict=True)]
    yield from ended()
    facts["click on cancel"] = results().ended
    yield 0.5


def fail_without_an_image_editor():
    module = importlib.import_module(f"{MODULE}.operators.run")
    errors = importlib.import_module(f"{MODULE}.stereo_reproject.errors")
    run_worker = module.run_worker

    def fail(*_, **__):
        raise errors.StereoReprojectError(f"the worker of {display} has failed")

    module.run_worker = fail
    for display in ("AREA", "WINDOW"):
        bpy.context.preferences.view.render_display_type = display
        # What is called from Python reports to Python.
        yield from click("VIEW_3D", "UI", "stereo_reproject_image(preview=True)")
        yield from ended()
        yield from until(lambda: len(bpy.context.window_manager.windows) == 1, "the window was never closed")
        yield 0.5
        shoot(f"failed_as_{display.lower()}")
        facts[f"failed as {display}"] = [len(bpy.context.window_manager.windows), left()]
        # The error's popup lies over the panel's buttons.
        press("ESC")
        yield 0.5
    module.run_worker = run_worker
    facts["reports"] = reports()


def open_another_file_under_way():
    """The last step: Blender ends the driver's own timers as it opens a file."""
    bpy.context.preferences.view.render_display_type = "AREA"
    start(preview=False)
    run = jobs().running()
    yield from until(lambda: run.picture is not None, "there was no picture")
    yield from redrawn()

    def end():
        facts["new file"] = [importlib.import_module(f"{MODULE}.operators.jobs").running() is None, left()]
        facts["finished"] = True
        drive_common._end()

    bpy.app.timers.register(end, first_interval=2.0, persistent=True)
    bpy.ops.wm.read_homefile(use_factory_startup=True)
    yield 10.0


run_steps(
    (
        set_up,
        open_an_image_editor,
        watch_a_preview,
        save_and_undo_under_way,
        cancel_with_escape,
        turn_to_something_else,
        animate,
        without_an_image_editor,
        click_twice_on_animation,
        fail_without_an_image_editor,
        open_another_file_under_way,
    )
)
