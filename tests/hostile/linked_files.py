"""Sets of .blend files that refer to each other, each in a folder of its own with main.blend in it.

Run as a program with a folder it makes them all. Every path has as many letters as //main.blend, so that one can be
put in another's place in the bytes of a file.
"""

from __future__ import annotations

import functools
import subprocess
import sys
from pathlib import Path

from tests.hostile.blends import MAKING_SECONDS, ROOT, private_folder

MAIN, LIBRARY, DEEPER = "main.blend", "libr.blend", "deep.blend"


@functools.cache
def linked_sets() -> Path:
    """The folder of all sets, made at the first call."""
    folder = private_folder("linked")
    command = [sys.executable, "-m", "tests.hostile.linked_files", str(folder)]
    ended = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=MAKING_SECONDS, check=False)
    assert ended.returncode == 0, f"the linked files could not be made: {ended.stderr[-2000:]}"
    return folder


def _make(folder: Path) -> None:
    plain(folder / "plain")
    linked(folder / "linked")
    nested(folder / "nested")
    circle(folder / "circle")
    linked_scene(folder / "scene")
    overridden(folder / "override")
    parts(folder / "parts")
    packed(folder / "packed")
    odd_contents(folder / "contents")


def _save(path: Path, *, compress: bool = False) -> None:
    import bpy

    path.parent.mkdir(parents=True, exist_ok=True)
    path.unlink(missing_ok=True)
    bpy.ops.wm.save_as_mainfile(filepath=str(path), compress=compress, relative_remap=False)


def plain(folder: Path) -> None:
    """A file that renders, as it is and compressed."""
    from tests.hostile.small_scenes import small_scene

    small_scene()
    _save(folder / MAIN)
    _save(folder / "compressed.blend", compress=True)


def _library(path: Path) -> None:
    """A file with a collection of three objects in it."""
    import bpy

    from tests.hostile.small_scenes import small_scene

    scene = small_scene()
    collection = bpy.data.collections.new("Furniture")
    scene.collection.children.link(collection)
    for number in range(3):
        item = scene.objects["Cube"].copy()
        item.name = f"Chair {number}"
        item.location.x = number - 1.0
        collection.objects.link(item)
    _save(path)


def _link(library: Path, kind: str, name: str) -> object:
    import bpy

    with bpy.data.libraries.load(str(library), link=True) as (_, wanted):
        setattr(wanted, kind, [name])
    block = getattr(wanted, kind)[0]
    block.library.filepath = f"//{library.name}"
    return block


def linked(folder: Path, library: str = LIBRARY) -> None:
    """A collection of three objects and a material from a library."""
    from tests.hostile.small_scenes import small_scene

    if not (folder / library).exists():
        _library(folder / library)
    scene = small_scene()
    _save(folder / MAIN)
    scene.collection.children.link(_link(folder / library, "collections", "Furniture"))
    _save(folder / MAIN)


def nested(folder: Path) -> None:
    """A library that has its objects from another."""
    _library(folder / DEEPER)
    linked(folder, DEEPER)
    (folder / MAIN).rename(folder / LIBRARY)
    import bpy

    from tests.hostile.small_scenes import small_scene

    bpy.ops.wm.open_mainfile(filepath=str(folder / LIBRARY), load_ui=False)
    outer = bpy.data.collections.new("Room")
    bpy.context.scene.collection.children.link(outer)
    outer.children.link(next(block for block in bpy.data.collections if block.library))
    _save(folder / LIBRARY)
    scene = small_scene()
    _save(folder / MAIN)
    scene.collection.children.link(_link(folder / LIBRARY, "collections", "Room"))
    _save(folder / MAIN)


def circle(folder: Path) -> None:
    """Two files that have something from each other."""
    import bpy

    linked(folder)
    bpy.ops.wm.open_mainfile(filepath=str(folder / LIBRARY), load_ui=False)
    wall = _link(folder / MAIN, "materials", "wall")
    bpy.data.objects["Chair 0"].data.materials[0] = wall
    _save(folder / LIBRARY)


def linked_scene(folder: Path) -> None:
    """A file whose scene is the library's."""
    import bpy

    from tests.hostile.small_scenes import small_scene

    _library(folder / LIBRARY)
    small_scene()
    _save(folder / MAIN)
    bpy.context.window.scene = _link(folder / LIBRARY, "scenes", "Scene")
    _save(folder / MAIN)


def overridden(folder: Path) -> None:
    """A collection of a library with an override."""
    import bpy

    linked(folder)
    scene = bpy.context.scene
    collection = next(block for block in bpy.data.collections if block.library)
    collection.override_hierarchy_create(scene, bpy.context.view_layer)
    _save(folder / MAIN)


def parts(folder: Path) -> None:
    """Camera, mesh, material and world, each from the library."""
    from tests.hostile.small_scenes import small_scene

    _library(folder / LIBRARY)
    scene = small_scene()
    _save(folder / MAIN)
    scene.camera = _link(folder / LIBRARY, "objects", "Camera")
    scene.collection.objects.link(scene.camera)
    scene.objects["Plane"].data = _link(folder / LIBRARY, "meshes", "Cube")
    scene.world = _link(folder / LIBRARY, "worlds", "World")
    _save(folder / MAIN)


def packed(folder: Path) -> None:
    """A picture packed into the file: random, and so found again in its bytes."""
    from tests.blender.toolbox import emission, noise_image
    from tests.hostile.small_scenes import small_scene

    folder.mkdir(parents=True, exist_ok=True)
    scene = small_scene()
    image = noise_image(folder, size=64)
    scene.objects["Plane"].data.materials[0] = emission("shown", image=image).block
    image.pack()
    _save(folder / MAIN)


def odd_contents(folder: Path) -> None:
    """Files of parts of a scene, as libraries are written; and of scenes that lack something."""
    import bpy

    from tests.hostile.small_scenes import small_scene

    folder.mkdir(parents=True, exist_ok=True)
    for kind in ("materials", "meshes", "node_groups", "worlds", "cameras", "collections", "texts", "actions"):
        scene = small_scene()
        bpy.data.node_groups.new("Group", "ShaderNodeTree")
        bpy.data.collections.new("Collection")
        bpy.data.texts.new("Text")
        scene.objects["Cube"].keyframe_insert("location", frame=1)
        bpy.data.libraries.write(str(folder / f"{kind}.blend"), set(getattr(bpy.data, kind)), fake_user=True)
    small_scene()
    bpy.data.libraries.write(str(folder / "scenes.blend"), {bpy.context.scene})
    small_scene()
    bpy.data.cameras.remove(bpy.context.scene.camera.data)
    _save(folder / "camera_deleted.blend")
    small_scene()
    bpy.context.window.scene = bpy.data.scenes.new("Empty")
    _save(folder / "empty_scene_active.blend")


if __name__ == "__main__":
    _make(Path(sys.argv[1]))
