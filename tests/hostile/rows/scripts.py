"""Scripts in a .blend do not run, and nothing connects to anything."""

from __future__ import annotations

import functools
import json
import shutil
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from tests.hostile.case import Case
from tests.hostile.program import DEMO, SMALLEST, Outcome, assert_bad_input, assert_done, names_in, run_program
from tests.hostile.rows._animations import run_blender, shared
from tests.hostile.rows._privileges import CLONE_NEWNET, unshare

TITLE = "scripts and the network"
SEEN_BEFORE = 0

MAKE = """
import sys, bpy
demo, place, kind, witness = sys.argv[1:]
bpy.ops.wm.open_mainfile(filepath=demo, load_ui=False)
scene = bpy.context.scene
crime = f"__import__('pathlib').Path({witness!r}).touch()"
thing = next(object for object in scene.objects if object.type == "MESH")

def drive(owner, path, index=-1, expression=None):
    curve = owner.driver_add(path, index) if index >= 0 else owner.driver_add(path)
    curve.driver.type = "SCRIPTED"
    curve.driver.expression = expression or f"({crime} or 1.0)"

def text(name, body):
    block = bpy.data.texts.new(name)
    block.write(body)
    block.use_module = True
    return block

match kind:
    case "text":
        text("evil.py", crime)
    case "text of an add-on":
        text("stereo_reproject.py", crime)
    case "text that shadows":
        text("numpy.py", crime)
    case "handlers":
        text("handlers.py", "import bpy" + chr(10) + "from bpy.app.handlers import persistent" + chr(10)
             + "@persistent" + chr(10) + "def evil(*_):" + chr(10) + "    " + crime + chr(10)
             + "for name in ('load_post', 'render_pre', 'frame_change_pre', 'depsgraph_update_post'):" + chr(10)
             + "    getattr(bpy.app.handlers, name).append(evil)")
    case "timer":
        text("timer.py", "import bpy" + chr(10) + "bpy.app.timers.register(lambda: " + crime + ", persistent=True)")
    case "driver of an object":
        drive(thing, "location", 0)
    case "driver of the camera":
        drive(scene.camera.data, "lens", expression=f"({crime} or 50.0)")
    case "driver of a modifier":
        thing.modifiers.new("evil", "SUBSURF")
        drive(thing, 'modifiers["evil"].levels', expression=f"({crime} or 0)")
    case "driver of a node":
        material = thing.active_material
        curve = material.node_tree.driver_add("nodes[0].location", 0)
        curve.driver.expression = f"({crime} or 0.0)"
    case "driver of a shape key":
        thing.data = thing.data.copy()
        thing.shape_key_add(name="Basis"); thing.shape_key_add(name="evil")
        drive(thing.data.shape_keys, 'key_blocks["evil"].value')
    case "driver of a custom property":
        thing["evil"] = 1.0
        drive(thing, '["evil"]')
    case "driver of the scene":
        drive(scene, "cycles.samples", expression=f"({crime} or 1)")
    case "driver of the eyes":
        drive(scene.camera.data, "stereo.interocular_distance", expression=f"({crime} or 0.1)")
    case "driver by its name space":
        text("space.py", "import bpy" + chr(10) + "bpy.app.driver_namespace['evil'] = lambda: (" + crime + " or 1.0)")
        drive(thing, "location", 1, "evil()")
    case "driver by a class":
        drive(thing, "location", 0, "[c for c in ().__class__.__base__.__subclasses__() if 'Popen' in str(c)] and 1.0")
    case "driver that divides by nothing":
        drive(thing, "location", 2, "1/0")
    case "freestyle":
        layer = scene.view_layers[0]
        scene.render.use_freestyle = True
        layer.freestyle_settings.mode = "SCRIPT"
        layer.freestyle_settings.modules.new().script = text("style.py", crime)
    case "external freestyle":
        import pathlib
        pathlib.Path(place).with_name("style.py").write_text(crime)
    case "shading language":
        scene.cycles.shading_system = True
        material = thing.active_material
        node = material.node_tree.nodes.new("ShaderNodeScript")
        node.script = text("evil.osl", 'shader evil(output color c = 0) { c = 1; printf("hello"); }')
    case "file beside it":
        import pathlib
        for name in ("startup.py", "bpy.py", "sitecustomize.py", "usercustomize.py", "numpy.py"):
            pathlib.Path(place).with_name(name).write_text(crime)
    case "image of the network":
        image = bpy.data.images.new("evil", 8, 8)
        image.source, image.filepath = "FILE", witness
        node = thing.active_material.node_tree.nodes.new("ShaderNodeTexImage")
        node.image = image
        out = next(n for n in thing.active_material.node_tree.nodes if n.type.startswith("BSDF"))
        thing.active_material.node_tree.links.new(node.outputs[0], out.inputs[0])
    case "plain":
        pass
bpy.context.preferences.filepaths.use_scripts_auto_execute = False
bpy.ops.wm.save_as_mainfile(filepath=place, compress=False)
"""

KINDS = (
    "text",
    "text of an add-on",
    "text that shadows",
    "handlers",
    "timer",
    "driver of an object",
    "driver of the camera",
    "driver of a modifier",
    "driver of a node",
    "driver of a shape key",
    "driver of a custom property",
    "driver of the scene",
    "driver of the eyes",
    "driver by its name space",
    "driver by a class",
    "driver that divides by nothing",
    "freestyle",
    "shading language",
    "file beside it",
)

COMMANDS: dict[str, tuple[str, ...]] = {
    "render": ("--output", "out", *SMALLEST),
    "animate": ("--output", "out", *SMALLEST, "--frames", "1-2"),
    "inspect": ("--json", *SMALLEST),
    "tradeoff": ("--output", "out", "--size", "16x16", "--samples", "1", "--no-denoise", "--only", "draft"),
}

TRUSTING = """
import sys, bpy
bpy.context.preferences.filepaths.use_scripts_auto_execute = True
bpy.ops.wm.save_userpref()
"""


def _make(kind: str, folder: Path, witness: str | Path) -> Path:
    blend = folder / "scene.blend"
    run_blender(MAKE, DEMO, blend, kind, witness)
    return blend


def _not_run(outcome: Outcome, folder: Path) -> None:
    if outcome.status:
        assert_bad_input(outcome)
    else:
        assert_done(outcome)
    odd = [name for name in names_in(folder) if name.endswith(("pwned", "witness"))]
    assert not odd, f"a script ran: {odd}"


def _does_not_run(kind: str, command: str, folder: Path) -> None:
    """Whatever a .blend brings to be run is not run; scripts are named by a warning, where there are any."""
    blend = _make(kind, folder, folder / "witness")
    outcome = run_program(command, blend, *COMMANDS[command], cwd=folder)
    _not_run(outcome, folder)


def _not_by_preferences(kind: str, folder: Path) -> None:
    """Preferences of the user's Blender that trust every file are not the program's."""
    blend = _make(kind, folder, folder / "witness")
    preferences = folder / "preferences"
    preferences.mkdir()
    variables = {"BLENDER_USER_CONFIG": str(preferences), "BLENDER_USER_RESOURCES": str(preferences)}
    env = ["env", *(f"{name}={value}" for name, value in variables.items())]
    subprocess.run([*env, sys.executable, "-c", TRUSTING], check=True, capture_output=True, timeout=120)
    _not_run(run_program("render", blend, *COMMANDS["render"], cwd=folder, environment=variables), folder)


def _is_warned(command: str, folder: Path) -> None:
    """A scene whose scripts were not run may look otherwise than its maker meant: that is said."""
    blend = _make("driver of an object", folder, folder / "witness")
    outcome = run_program(command, blend, *COMMANDS[command], cwd=folder)
    assert_done(outcome)
    said = outcome.stdout + outcome.stderr if command == "inspect" else outcome.stderr
    assert b"script" in said, f"nobody is told: {outcome}"


def _plain(folder: Path) -> Path:
    place = shared(folder, "plain", lambda place: run_blender(MAKE, DEMO, place / "scene.blend", "plain", "none"))
    return place / "scene.blend"


def _counters() -> dict[str, int]:
    """What this network namespace has sent or tried to, by protocol."""
    counted: dict[str, int] = {}
    lines = Path("/proc/net/snmp").read_text().splitlines()
    for names, values in zip(lines[::2], lines[1::2], strict=True):
        kind = names.split()[0]
        counted |= {
            f"{kind}{name}": int(value) for name, value in zip(names.split()[1:], values.split()[1:], strict=True)
        }
    wanted = ("Ip:OutRequests", "Ip:OutNoRoutes", "Tcp:ActiveOpens", "Udp:OutDatagrams")
    return {name: counted[name] for name in wanted}


def _sends_nothing(command: str, up: bool, folder: Path) -> None:
    """In a network of its own, with a way out or without one, nothing is sent."""
    blend = _plain(folder)
    unshare(CLONE_NEWNET)
    if up:
        for words in ("link set lo up", "addr add 192.0.2.1/24 dev lo", "route add default via 192.0.2.2 dev lo"):
            subprocess.run(["ip", *words.split()], check=True, capture_output=True)
    before = _counters()
    assert_done(run_program(command, blend, *COMMANDS[command], cwd=folder))
    assert _counters() == before, f"something was sent: {_counters()}, before {before}"


def _counters_count(folder: Path) -> None:
    """The counters of the cases above do count: a connection and a datagram that are made here are seen."""
    unshare(CLONE_NEWNET)
    subprocess.run(["ip", "link", "set", "lo", "up"], check=True, capture_output=True)
    before = _counters()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        sender.sendto(b"x", ("127.0.0.1", 9))
    with socket.socket() as caller:
        caller.settimeout(1.0)
        caller.connect_ex(("127.0.0.1", 9))
    after = _counters()
    assert after["Udp:OutDatagrams"] > before["Udp:OutDatagrams"], after
    assert after["Tcp:ActiveOpens"] > before["Tcp:ActiveOpens"], after


def _asks_nobody(address: str, folder: Path) -> None:
    """An image at an address of the network is a missing image, and nobody is asked for it."""
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        listener.listen()
        listener.settimeout(0.2)
        blend = _make("image of the network", folder, address.replace("PORT", str(listener.getsockname()[1])))
        outcome = run_program("render", blend, *COMMANDS["render"], cwd=folder)
        assert_done(outcome)
        try:
            listener.accept()
        except TimeoutError:
            return
    raise AssertionError("it was asked for")


def _sockets(command: str, folder: Path) -> None:
    """Nothing is sent, called or waited for, by system calls: `strace` sees them all. (Binding a socket to one's own
    machine, as urllib3 does to see whether there is IPv6, is none of these.)"""
    log = folder / "calls"
    python = (
        "strace",
        "-f",
        "--seccomp-bpf",
        "-qq",
        "-o",
        str(log),
        "-e",
        "trace=connect,listen,sendto,sendmsg,sendmmsg",
        sys.executable,
    )
    outcome = run_program(command, _plain(folder), *COMMANDS[command], cwd=folder, python=python, timeout=300)
    assert_done(outcome)
    opened = [line for line in log.read_text().splitlines() if "AF_INET" in line or "listen(" in line]
    assert not opened, f"calls: {opened[:5]}"


def _json_names_no_place(folder: Path) -> None:
    """What is told as JSON of a scene with scripts is JSON, and holds none of them."""
    blend = _make("text", folder, folder / "witness")
    outcome = run_program("inspect", blend, *COMMANDS["inspect"], cwd=folder)
    assert_done(outcome)
    told: Any = json.loads(outcome.stdout)
    assert "__import__" not in json.dumps(told)


def cases() -> Iterator[Case]:
    for number, kind in enumerate(KINDS):
        for command in ("render", list(COMMANDS)[1 + number % 3]):
            yield Case(f"{command} with a {kind}", functools.partial(_does_not_run, kind, command))
    for kind in ("text", "handlers", "driver of an object"):
        yield Case(f"a {kind}, and preferences that trust it", functools.partial(_not_by_preferences, kind))
    for command in COMMANDS:
        yield Case(f"{command} warns of scripts", functools.partial(_is_warned, command))
        for up in (True, False):
            check = functools.partial(_sends_nothing, command, up)
            yield Case(f"{command} with {'a' if up else 'no'} network sends nothing", check)
        if shutil.which("strace"):
            yield Case(f"{command} calls nobody", functools.partial(_sockets, command))
    yield Case("counters of the network count", _counters_count)
    for address in (
        "http://127.0.0.1:PORT/x.png",
        "//127.0.0.1:PORT/x.png",
        "\\\\127.0.0.1@PORT\\x.png",
        "ftp://127.0.0.1:PORT/x.exr",
    ):
        yield Case(f"an image at {address}", functools.partial(_asks_nobody, address))
    yield Case("JSON without scripts", _json_names_no_place)
