"""Hands and eyes of the drivers in this folder, which use the extension as an artist does in a Blender with a window,
started with --enable-event-simulate: mouse and keys, what is where in the window, screenshots, and the loop that runs a
driver's steps. The arguments after `--` are ZIP FOLDER [MORE]: FOLDER takes the screenshots and facts.json."""

import importlib
import json
import os
import shutil
import subprocess
import sys
import time
import traceback
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import bpy

ARGUMENTS = sys.argv[sys.argv.index("--") + 1 :]
ZIP, FOLDER = map(Path, ARGUMENTS[:2])
MORE = ARGUMENTS[2:]
"""Arguments of the driver itself."""
MODULE = "bl_ext.user_default.stereo_reproject"
LIMIT = 240.0
"""Seconds after which something that is waited for will never come."""

MAX_FOREIGN_REDRAWS = 10
"""How often Blender has drawn what is to be drawn, at least: more often than anything takes to settle."""

facts: dict = {"steps": []}
turns = {"count": 0}
"""How often Blender has come back to its events."""


class StuckError(Exception):
    pass


def window():
    return bpy.context.window_manager.windows[0]


def area_of(kind):
    return next((area for area in window().screen.areas if area.type == kind), None)


def region_of(kind, region_type):
    return next(region for region in area_of(kind).regions if region.type == region_type)


def jobs():
    return importlib.import_module(f"{MODULE}.operators.jobs")


def results():
    return importlib.import_module(f"{MODULE}.operators.results").result_of(bpy.context.scene)


def shoot(name):
    """What the screen shows; Blender's own screenshot is black where a driver in software draws it."""
    path = FOLDER / f"{name}.png"
    if shutil.which("import"):
        subprocess.run(["import", "-window", "root", f"png:{path}"], check=True)
    else:
        with bpy.context.temp_override(window=window()):
            bpy.ops.screen.screenshot(filepath=str(path))


def move(x, y):
    window().event_simulate(type="MOUSEMOVE", value="NOTHING", x=int(x), y=int(y))


def press(key, **modifiers):
    where = facts["mouse"]
    for value in ("PRESS", "RELEASE"):
        window().event_simulate(type=key, value=value, x=where[0], y=where[1], **modifiers)


def go(x, y):
    facts["mouse"] = (int(x), int(y))
    move(x, y)


def until(condition, what):
    start = time.monotonic()
    while not condition():
        if time.monotonic() - start > LIMIT:
            raise StuckError(what)
        yield 0.2


def redrawn():
    """However slow that is: Blender draws each time after its events."""
    since = turns["count"]
    yield from until(lambda: turns["count"] - since > MAX_FOREIGN_REDRAWS, "the window stood still")


def scroll(kind, region_type, wheel):
    """To the end of a region's panels."""
    region = region_of(kind, region_type)
    go(region.x + 0.5 * region.width, region.y + 0.5 * region.height)
    for _ in range(40):
        press(wheel)
    yield 1.0


def find_button(kind, region_type, command):
    """Where the button is that runs `command`: Ctrl+C over a button copies what it runs."""
    yield from _find(kind, region_type, command, (0.25, 0.75), ctrl=True)


def find_property(kind, region_type, name):
    """Where the field of a property is: Ctrl+Shift+Alt+C over a field copies its data path."""
    yield from _find(kind, region_type, name, (0.75,), ctrl=True, shift=True, alt=True)


def _find(kind, region_type, what, shares, **held):
    manager = bpy.context.window_manager
    region = region_of(kind, region_type)
    for share in shares:
        for y in range(region.y + region.height - 8, region.y + 4, -9):
            manager.clipboard = ""
            go(region.x + share * region.width, y)
            yield 0.02
            press("C", **held)
            yield 0.02
            if what in manager.clipboard:
                facts["button"] = facts["mouse"]
                return
    raise StuckError(f"nothing there for {what}")


def click(kind, region_type, command):
    yield from find_button(kind, region_type, command)
    press("LEFTMOUSE")
    yield 0.3


def install():
    with bpy.context.temp_override(window=window(), area=window().screen.areas[0]):
        bpy.ops.extensions.package_install_files(filepath=str(ZIP), repo="user_default", enable_on_install=True)
    facts["registered"] = hasattr(bpy.types.Scene, "stereo_reproject")


def show_sidebar(kind, category):
    area = area_of(kind)
    area.spaces.active.show_region_ui = True
    yield 1.0
    region_of(kind, "UI").active_panel_category = category
    yield 1.0


def set_up():
    """Close the splash screen, have renders shown in an area of the window, and install the zip."""
    bpy.context.preferences.view.show_splash = False
    bpy.context.preferences.view.render_display_type = "AREA"
    facts["mouse"] = (window().width // 2, window().height // 2)
    press("ESC")
    yield 0.5
    install()
    yield 1.0


def _end():
    (FOLDER / "facts.json").write_text(json.dumps(facts, indent=1), encoding="utf-8")
    sys.stdout.flush()
    os._exit(0)


def _scenario(steps):
    for step in steps:
        facts["steps"].append(step.__name__)
        # A step may do all it does at once.
        yield from step() or ()


def run_steps(steps: Sequence[Callable[[], Iterator[float] | None]]) -> None:
    """Run the steps one after another while Blender handles its events, write facts.json and end Blender. A step is a
    generator of seconds to wait, or a plain function.
    """
    left = _scenario(steps)

    def tick():
        try:
            return next(left)
        except StopIteration:
            facts["finished"] = True
        except Exception as error:  # noqa: BLE001 - whatever it is, the test is to say it
            traceback.print_exc()
            facts["error"] = f"{type(error).__name__}: {error}"
            shoot("error")
        return _end()

    def count():
        turns["count"] += 1
        return 0.05

    bpy.app.timers.register(count, first_interval=3.0)
    bpy.app.timers.register(tick, first_interval=3.0)
