"""What scenes of many objects cost Blender, and what a pair adds to that, in processor seconds.

    python tests/bench/many_objects.py [KIND ...] [--runs 3] [--counts 1000 3000 10000 20000]

The scenes are made up: small cubes before the camera, 64 x 36 pixels with one sample: next to nothing is traced.
Processor time is told, of all threads, because a machine may be busy; medians. Of Blender's own: *load* of the file,
*copy* of the scene with its evaluation, *first* and *later* plain render call of that copy (Cycles syncs in the first).
Of ours: *plan* (all that the renderer finds out before the source), *packed* (what a packed render takes over a later
plain one), *picture* (the view transform of both eyes, as stereo.png), *fingerprint* (once per animation), and *pair*:
plan, two packed renders and the picture together. What Blender prints goes to standard error.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from statistics import median

import bpy
import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from stereo_reproject.blender.engines.packed_trace import CAMERAS, trace_packed  # noqa: E402
from stereo_reproject.blender.engines.packed_views import PackedPixels  # noqa: E402
from stereo_reproject.blender.engines.render import render_views  # noqa: E402
from stereo_reproject.blender.engines.renderer import BlenderRenderer  # noqa: E402
from stereo_reproject.blender.output.delivery import deliver_side_by_side  # noqa: E402
from stereo_reproject.blender.scene.fingerprint import scene_fingerprints  # noqa: E402
from stereo_reproject.blender.scene.working import working_scene  # noqa: E402
from stereo_reproject.settings.frame import SceneOverrides  # noqa: E402

WIDTH, HEIGHT = 64, 36
STEPS = ("load", "copy", "first", "later", "plan", "packed", "picture", "pair", "fingerprint")
SHARED_BY = 5
"""Objects with one material, where they have materials of their own."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--counts", type=int, nargs="+", default=[1000, 3000, 10000, 20000])
    parser.add_argument("kinds", nargs="*", metavar="KIND", default=[*KINDS], help=f"some of {', '.join(KINDS)}")
    arguments = parser.parse_args()
    out = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    print(f"{'scene':<12}{'objects':>8}" + "".join(f"{step:>12}" for step in STEPS), file=out)
    for kind in arguments.kinds:
        for count in arguments.counts:
            runs = [_measure(kind, count) for _ in range(arguments.runs)]
            figures = "".join(f"{median(run[step] for run in runs):>12.2f}" for step in STEPS)
            print(f"{kind:<12}{count:>8}{figures}", file=out, flush=True)
    os._exit(0)


def _measure(kind: str, count: int) -> dict[str, float]:
    seconds: dict[str, float] = {}
    with tempfile.TemporaryDirectory() as folder, _clock(seconds) as timed:
        work, blend = Path(folder), Path(folder) / "scene.blend"
        _make(kind, count, blend)
        timed("load", lambda: bpy.ops.wm.open_mainfile(filepath=str(blend), load_ui=False))
        scene = bpy.context.scene
        open_scene = working_scene(scene, SceneOverrides(interocular_distance=0.1, convergence_distance=8.0))
        working = timed("copy", open_scene.__enter__)
        renderer = timed("plan", lambda: BlenderRenderer(working, work, user_scene=scene))
        timed("first", lambda: render_views(working, ("left",), work))
        timed("later", lambda: render_views(working, ("right",), work))
        places = np.argwhere(np.arange(WIDTH * HEIGHT).reshape(HEIGHT, WIDTH) % 10 == 0)
        pixels = PackedPixels(renderer.cameras["right"], places)
        timed(
            "packed", lambda: trace_packed(working, "right", pixels.camera, [pixels], work, seed=1, by=CAMERAS["osl"])
        )
        open_scene.__exit__(None, None, None)
        picture = np.full((HEIGHT, WIDTH, 4), 0.5, np.float32)
        eyes = {"left": picture, "right": picture}
        timed("picture", lambda: deliver_side_by_side(scene, eyes, work / "stereo.png"))
        timed("fingerprint", lambda: scene_fingerprints(scene))
    seconds["packed"] = max(seconds["packed"] - seconds["later"], 0.0)
    seconds["pair"] = seconds["plan"] + 2.0 * seconds["packed"] + seconds["picture"]
    return seconds


@contextmanager
def _clock(seconds: dict[str, float]) -> Iterator[Callable]:
    def timed(step: str, function: Callable) -> object:
        start = time.process_time()
        result = function()
        seconds[step] = time.process_time() - start
        return result

    yield timed


def _make(kind: str, count: int, blend: Path) -> None:
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.cycles.samples = 1
    scene.cycles.use_denoising = False
    scene.render.resolution_x, scene.render.resolution_y = WIDTH, HEIGHT
    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    camera.location, camera.rotation_euler = (0.0, -8.0, 0.0), (0.5 * np.pi, 0.0, 0.0)
    scene.collection.objects.link(camera)
    scene.camera = camera
    KINDS[kind](scene, count)
    bpy.ops.wm.save_as_mainfile(filepath=str(blend), compress=False)


def _mesh(name: str, material: bpy.types.Material) -> bpy.types.Mesh:
    mesh = bpy.data.meshes.new(name)
    corners = [(x, y, z) for x in (-0.02, 0.02) for y in (-0.02, 0.02) for z in (-0.02, 0.02)]
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    mesh.from_pydata(corners, [], faces)
    mesh.materials.append(material)
    return mesh


def _material(name: str) -> bpy.types.Material:
    material = bpy.data.materials.new(name)
    if material.node_tree is None:
        material.use_nodes = True
    return material


def _object(index: int, count: int, data: bpy.types.Mesh | None, into: bpy.types.Collection) -> bpy.types.Object:
    item, side = bpy.data.objects.new(f"object {index}", data), int(np.ceil(np.sqrt(count)))
    item.location = (6.0 * (index % side) / side - 3.0, 0.0, 4.0 * (index // side) / side - 2.0)
    into.objects.link(item)
    return item


def _shared(scene: bpy.types.Scene, count: int) -> None:
    mesh = _mesh("cube", _material("matte"))
    for k in range(count):
        _object(k, count, mesh, scene.collection)


def _own(scene: bpy.types.Scene, count: int) -> None:
    materials = [_material(f"matte {k}") for k in range(max(count // SHARED_BY, 1))]
    for k in range(count):
        _object(k, count, _mesh(f"cube {k}", materials[k % len(materials)]), scene.collection)


def _instances(scene: bpy.types.Scene, count: int) -> None:
    cubes = bpy.data.collections.new("cubes")
    cubes.objects.link(bpy.data.objects.new("cube", _mesh("cube", _material("matte"))))
    for k in range(count):
        item = _object(k, count, None, scene.collection)
        item.instance_type, item.instance_collection = "COLLECTION", cubes


def _nested(scene: bpy.types.Scene, count: int) -> None:
    """A hundred objects in each collection, ten collections within each other."""
    mesh, parent = _mesh("cube", _material("matte")), scene.collection
    for k in range(count):
        if k % 100 == 0:
            inner = bpy.data.collections.new(f"level {k}")
            (scene.collection if k % 1000 == 0 else parent).children.link(inner)
            parent = inner
        _object(k, count, mesh, parent)


def _parents(scene: bpy.types.Scene, count: int) -> None:
    """Chains of twenty, each object with a bevel, and one in three with what the viewport does not show."""
    mesh, last = _mesh("cube", _material("matte")), None
    for k in range(count):
        item = _object(k, count, mesh, scene.collection)
        if k % 20:
            item.parent, item.location = last, (0.01, 0.0, 0.0)
        item.modifiers.new("bevel", "BEVEL").width = 0.002
        if k % 3 == 0:
            item.modifiers.new("smooth", "SUBSURF").show_viewport = False
        last = item


KINDS = {"shared": _shared, "own": _own, "instances": _instances, "nested": _nested, "parents": _parents}
"""One mesh for all; meshes and materials of their own; instances of a collection; nested collections; parents and
modifiers."""


if __name__ == "__main__":
    main()
