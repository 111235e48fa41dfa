"""Runs in a Python of its own, with a user folder of its own: does one thing with the extension as Blender installs it,
and prints what it found as JSON in its last line. Its argument is JSON too: {"do": one of TASKS, and what that takes}.
Not a test itself."""

import contextlib
import io
import json
import os
import subprocess
import sys
import tempfile
from importlib import import_module
from pathlib import Path

import bpy

REPOSITORY = "user_default"
MODULE = f"bl_ext.{REPOSITORY}.stereo_reproject"
SIZE = (96, 54)
LARGE = (960, 540)
"""Size of which a preview is half."""
SAMPLES = 4
FRAMES = (1, 2)

WORKER = "stereo_reproject.programs.worker"
ORIGINS = f"""
import importlib.util, json
print(json.dumps({{name: importlib.util.find_spec(name).origin for name in ({WORKER!r}, "OpenEXR")}}))
"""

workers = []
"""The environment and the working directory of each worker process that was started."""


def note_worker(event, arguments):
    if event == "subprocess.Popen":
        _, command, folder, environment = arguments
        if WORKER in command:
            workers.append({"env": environment, "cwd": folder})


def origins_in(worker):
    """Where a worker finds its code and its library: asked of another Python that is started as it was."""
    asked = subprocess.run([sys.executable, "-c", ORIGINS], **worker, check=True, capture_output=True, text=True)
    return json.loads(asked.stdout)


def start():
    """As Blender starts where the extension is installed: a Python module would leave the preferences unread."""
    bpy.ops.wm.read_userpref()
    assert hasattr(bpy.types.Scene, "stereo_reproject"), "the extension is not on after a start"
    # An installed Blender has no other OpenEXR than the extension's. Here the environment of the tests has one too, and
    # the folder that Blender adds to the path comes last.
    sys.path.sort(key=lambda folder: not Path(folder).is_relative_to(bpy.utils.user_resource("EXTENSIONS")))


def switch_on():
    assert bpy.ops.preferences.addon_enable(module=MODULE) == {"FINISHED"}


def switch_off():
    assert bpy.ops.preferences.addon_disable(module=MODULE) == {"FINISHED"}


def own_temporary_files():
    return [path.name for path in Path(tempfile.gettempdir()).iterdir() if "stereo_reproject" in path.name]


def open_demo(blend):
    bpy.ops.wm.open_mainfile(filepath=blend)
    scene = bpy.context.scene
    scene.render.resolution_x, scene.render.resolution_y = SIZE
    scene.render.resolution_percentage = 100
    scene.cycles.samples = SAMPLES
    scene.frame_start, scene.frame_end = FRAMES
    return scene


def set_format(scene, file_format, views_format):
    settings = scene.render.image_settings
    if hasattr(settings, "media_type"):
        settings.media_type = "IMAGE"  # 5.x lists only this one's formats
    settings.file_format, settings.views_format = file_format, views_format


def traces():
    """Whatever an add-on may leave behind in Blender: classes, operators, properties, menu entries, handlers."""
    handlers = [getattr(bpy.app.handlers, name) for name in dir(bpy.app.handlers)]
    owners = (bpy.types.Scene, bpy.types.Object, bpy.types.WindowManager, bpy.types.Camera)
    return {
        "types": sorted(dir(bpy.types)),
        "operators": sorted(f"{module}.{name}" for module in dir(bpy.ops) for name in dir(getattr(bpy.ops, module))),
        "properties": sorted(f"{owner.__name__}.{name}" for owner in owners for name in dir(owner)),
        "render menu": len(bpy.types.TOPBAR_MT_render._dyn_ui_initialize()),
        # Its own alone: Blender's add-ons add theirs once more when preferences are read.
        "handlers": [
            function.__name__
            for functions in handlers
            if isinstance(functions, list)
            for function in functions
            if getattr(function, "__module__", "").startswith(MODULE)
        ],
    }


def install(archive):
    result = bpy.ops.extensions.package_install_files(filepath=archive, repo=REPOSITORY, enable_on_install=True)
    bpy.ops.wm.save_userpref()
    return {
        "result": list(result),
        "enabled": MODULE in bpy.context.preferences.addons,
        "registered": hasattr(bpy.types.Scene, "stereo_reproject"),
        "module": sys.modules[MODULE].__file__,
        "extensions": bpy.utils.user_resource("EXTENSIONS"),
    }


def cycle():
    """What is there before the extension, with it, and without and with it again."""
    found = [traces()]
    start()
    found.append(traces())
    for switch in (switch_off, switch_on, switch_off):
        switch()
        found.append(traces())
    switch_on()
    return {"traces": found}


def image(blend, output, preview):
    start()
    scene = open_demo(blend)
    if preview:
        scene.render.resolution_x, scene.render.resolution_y = LARGE
        scene.stereo_reproject.preview_percentage, scene.stereo_reproject.preview_samples = 50, 1
    result = bpy.ops.render.stereo_reproject_image(preview=preview)
    set_format(scene, "OPEN_EXR", "INDIVIDUAL")
    scene.render.use_multiview = True
    # After a plain multiview render as well, Blender looks for a file without a view's suffix when it has saved.
    with contextlib.suppress(RuntimeError):
        bpy.data.images["Render Result"].save_render(str(Path(output) / "result.exr"), scene=scene)
    return {"result": list(result)}


def animation(blend, output, views_format):
    start()
    scene = open_demo(blend)
    set_format(scene, "PNG", views_format)
    scene.render.filepath = str(Path(output) / "name")
    return {"result": list(bpy.ops.render.stereo_reproject_animation())}


def check(blend):
    start()
    scene = open_demo(blend)
    result = bpy.ops.stereo_reproject.check_scene()
    inspection = import_module(f"{MODULE}.operators.results").result_of(scene).inspection
    return {"result": list(result), "size": inspection["size"], "effects": len(inspection["effects"])}


def convergence(blend):
    """What the convergence distance becomes for each target, and Blender's own word on how far that is."""
    from bpy_extras.object_utils import world_to_camera_view

    start()
    scene = open_demo(blend)
    camera = scene.camera
    target = next(item for item in scene.objects if item.type == "MESH")
    bpy.context.view_layer.objects.active = target
    camera.data.dof.focus_object, camera.data.dof.focus_distance = None, 3.25
    expected = {
        "OBJECT": world_to_camera_view(scene, camera, target.matrix_world.translation).z,
        "FOCUS": camera.data.dof.focus_distance,
    }
    found = {}
    for name in expected:
        bpy.ops.stereo_reproject.set_convergence(target=name)
        found[name] = camera.data.stereo.convergence_distance
    return {"expected": expected, "found": found}


def pictures(blend):
    """Before and after a pair is there: what of it an Image Editor can show."""
    start()
    open_demo(blend)
    window = bpy.context.window_manager.windows[0]
    area = window.screen.areas[0]
    area.type = "VIEW_3D"
    show = bpy.ops.stereo_reproject.show_picture
    with bpy.context.temp_override(window=window, area=area):
        elsewhere = show.poll()
    area.type = "IMAGE_EDITOR"
    with bpy.context.temp_override(window=window, area=area):
        there = show.poll()
        try:
            refusal = list(show(which="HOLES"))
        except RuntimeError as error:
            refusal = str(error)
        bpy.ops.render.stereo_reproject_image()
        shown = {}
        for which in ("HOLES", "GRID", "ERRORS", "PAIR"):
            show(which=which)
            shown[which] = area.spaces.active.image.name
    return {"elsewhere": elsewhere, "there": there, "refusal": refusal, "shown": shown}


def cancel():
    start()
    return {"poll": bpy.ops.stereo_reproject.cancel.poll()}


def command(arguments):
    """`blender --command stereo_reproject …`, from the function that is registered for it."""
    start()
    run = import_module(f"{MODULE}.operators.command").run_command
    with contextlib.redirect_stdout(io.StringIO()) as out:
        status = run(arguments)
    return {"status": status, "out": out.getvalue()}


TASKS = {
    task.__name__: task for task in (install, cycle, image, animation, check, convergence, pictures, cancel, command)
}


def main():
    import addon_utils  # found only when bpy is there

    sys.addaudithook(note_worker)
    given = json.loads(sys.argv[1])
    facts = TASKS[given.pop("do")](**given)
    facts["workers"] = [origins_in(worker) for worker in workers]
    # What a pair has left goes with the extension. The preferences keep it, so that the next start has it again.
    addon_utils.disable(MODULE)
    facts["temporary files"] = own_temporary_files()
    print("\n" + json.dumps(facts))
    sys.stdout.flush()
    sys.stderr.flush()
    # Blender's own clean-up at exit takes its time, and 4.5 as a Python module may not come to an end at all: what is
    # tested here is over.
    os._exit(0)


if __name__ == "__main__":
    main()
