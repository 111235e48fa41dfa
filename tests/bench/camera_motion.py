"""A scene with a moving camera, saved beside it, for animations that are measured with `animate --reuse`.

    python -m tests.bench.camera_motion SCENE.blend OUTPUT.blend --dolly 1 [--frames 24]
    python -m tests.bench.camera_motion SCENE.blend OUTPUT.blend --pan -1

--dolly moves the camera ahead by so many per cent of its convergence distance a frame, --pan turns it about the world's
up by so many degrees a frame (to the left, if positive). --interocular and --convergence set the camera's own stereo
distances. The motion begins at frame 1, where the camera is in the scene's own place at the frame it was saved at.
Exit status: 0 saved, 2 bad input.
"""

from __future__ import annotations

import argparse
import math
import sys
from pathlib import Path

import bpy
from mathutils import Matrix, Vector


def main() -> int:
    """Save the scene with its camera's motion."""
    options = _options()
    try:
        bpy.ops.wm.open_mainfile(filepath=str(options.scene.resolve()))
    except RuntimeError as error:
        print(f"camera_motion: {error}".strip(), file=sys.stderr)
        return 2
    scene = bpy.context.scene
    if scene.camera is None:
        print(f"camera_motion: {options.scene} has no camera", file=sys.stderr)
        return 2
    stereo = scene.camera.data.stereo
    stereo.interocular_distance = options.interocular or stereo.interocular_distance
    stereo.convergence_distance = options.convergence or stereo.convergence_distance
    poses = [
        moved(scene.camera.matrix_world, frame, options.dolly * stereo.convergence_distance / 100.0, options.pan)
        for frame in range(options.frames)
    ]
    _animate(scene, poses)
    scene.render.use_persistent_data = True
    bpy.ops.file.make_paths_absolute()
    bpy.ops.wm.save_as_mainfile(filepath=str(options.output.resolve()), copy=True)
    return 0


def moved(pose: Matrix, frames: int, ahead: float, degrees: float) -> Matrix:
    """Return a camera's pose (4 x 4, world from camera) after so many frames, each of which moves it ahead in its own
    direction, in scene units, and turns it about the world's up, in degrees, to the left if positive."""
    place = pose.translation + pose.to_3x3() @ Vector((0.0, 0.0, -ahead * frames))
    turn = Matrix.Rotation(math.radians(degrees * frames), 4, "Z")
    return Matrix.Translation(place) @ turn @ Matrix.Translation(-pose.translation) @ pose


def _animate(scene: bpy.types.Scene, poses: list[Matrix]) -> None:
    """Give the scene a camera of the same lens that stands in each of these poses, from frame 1 on."""
    camera = scene.camera.copy()
    scene.collection.objects.link(camera)
    camera.parent = None
    camera.constraints.clear()
    camera.animation_data_clear()
    camera.rotation_mode = "QUATERNION"
    for frame, pose in enumerate(poses, 1):
        camera.matrix_world = pose
        for path in ("location", "rotation_quaternion", "scale"):
            camera.keyframe_insert(path, frame=frame)
    scene.camera = camera
    scene.frame_start, scene.frame_end = 1, len(poses)
    scene.frame_set(1)


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="camera_motion", description=__doc__.splitlines()[0])
    parser.add_argument("scene", type=Path)
    parser.add_argument("output", type=Path)
    parser.add_argument("--frames", type=int, default=24)
    parser.add_argument("--dolly", type=float, default=0.0, metavar="PER_CENT")
    parser.add_argument("--pan", type=float, default=0.0, metavar="DEGREES")
    parser.add_argument("--interocular", type=float, metavar="D")
    parser.add_argument("--convergence", type=float, metavar="D")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
