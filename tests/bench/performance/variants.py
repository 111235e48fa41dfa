"""Variants of a scene: with a camera that goes along a path, or with more triangles of the same shape.

    python -m tests.bench.performance.variants SCENE.blend VARIANT.blend --frames N | --subdivisions N

The last line of standard output is JSON: the number of triangles of the variant's meshes.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import sys
from pathlib import Path
from typing import Any

from stereo_reproject.errors import StereoReprojectError

ORBIT = math.radians(8.0)
"""To either side of where the camera stands, around what it looks at."""

APPROACH = 0.15
"""How much nearer it ends, as a share of the distance."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scene", type=Path)
    parser.add_argument("variant", type=Path)
    parser.add_argument("--frames", type=int)
    parser.add_argument("--distance", type=float, help="of what the camera goes around; else the convergence distance")
    parser.add_argument("--subdivisions", type=int, default=0)
    options = parser.parse_args()
    status = 0
    try:
        print(json.dumps(_make(options)), flush=True)
    except (StereoReprojectError, RuntimeError, OSError) as error:
        print(f"error: {' '.join(str(error).split())}", file=sys.stderr, flush=True)
        status = 1
    os._exit(status)


def _make(options: argparse.Namespace) -> dict[str, int]:
    import bpy

    from stereo_reproject.blender.scene.working import open_blend

    scene = open_blend(options.scene)
    bpy.ops.file.make_paths_absolute()
    if options.frames is not None:
        _move_camera(scene, options.frames, options.distance)
    if options.subdivisions:
        _subdivide(scene, options.subdivisions)
    beside = options.variant.with_suffix(".part.blend")
    bpy.ops.wm.save_as_mainfile(filepath=str(beside), copy=True, relative_remap=False)
    beside.replace(options.variant)
    return {"triangles": _triangles(scene)}


def _move_camera(scene: Any, frames: int, distance: float | None) -> None:
    """An arc around what the camera looks at, and nearer to it, in frames 1, 2, ..."""
    from mathutils import Matrix, Vector

    camera = scene.camera
    if camera is None:
        raise StereoReprojectError("the scene has no camera")
    world = camera.matrix_world.copy()
    camera.parent = None
    camera.constraints.clear()
    camera.animation_data_clear()
    distance = distance or camera.data.stereo.convergence_distance
    camera.rotation_mode = "QUATERNION"
    scene.frame_start, scene.frame_end = 1, frames
    for frame in range(1, frames + 1):
        along = (frame - 1) / max(frames - 1, 1)
        turn = Matrix.Rotation(ORBIT * (2.0 * along - 1.0), 4, "Y")
        out = Matrix.Translation(Vector((0.0, 0.0, distance)))
        # The point that it goes around lies before it, on its own -z.
        nearer = Matrix.Translation(Vector((0.0, 0.0, -APPROACH * along * distance)))
        camera.matrix_world = world @ out.inverted() @ turn @ out @ nearer
        camera.keyframe_insert("location", frame=frame)
        camera.keyframe_insert("rotation_quaternion", frame=frame)


def _subdivide(scene: Any, levels: int) -> None:
    """Each face into four, `levels` times over, in the plane of the face."""
    for thing in scene.objects:
        if thing.type == "MESH":
            modifier = thing.modifiers.new("bench", "SUBSURF")
            modifier.subdivision_type = "SIMPLE"
            modifier.levels = modifier.render_levels = levels


def _triangles(scene: Any) -> int:
    import bpy

    depsgraph = bpy.context.evaluated_depsgraph_get()
    count = 0
    for thing in scene.objects:
        if thing.type == "MESH" and not thing.hide_render:
            evaluated = thing.evaluated_get(depsgraph)
            mesh = evaluated.to_mesh()
            mesh.calc_loop_triangles()
            count += len(mesh.loop_triangles)
            evaluated.to_mesh_clear()
    return count


if __name__ == "__main__":
    main()
