"""The packed camera of panoramas: a custom camera whose shader reads each packed pixel's ray from a table (see
ray_camera.osl).

It takes any camera model, since within a pixel a ray is its centre's and a change per pixel.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from ...images.exr import write_table
from ...images.passes import DEPTH_PASS, Passes
from ...views.camera import Array, Camera, Vector
from ...views.panorama import PANORAMA_FROM_CAMERA, PanoramicCamera
from ..scene.effects import may_read_camera, shader_nodes, uses_output
from ..scene.motion import vector_pass_asked_for
from ..scene.visible import aperture_radius, volume_boxes
from ..scene.working import changed, evaluated
from .denoise import NORMAL
from .hole_camera import SETTINGS, TEXTURES_UPWARDS_FROM_VERSION, compiled_shader, missing_osl_cameras
from .packed_camera import PackedCamera, PackedTask, lens_to_set, packed_resolution, without_shifts
from .packed_views import FORWARD, POSITION, PackedPixels, may_begin_in, surely_inside

SHADER = Path(__file__).with_name("ray_camera.osl")

TEXELS = 6
"""Texels of the table that a packed pixel has."""

TABLE_WIDTH = 4096
"""Columns of the table, a power of two."""

HALF_PIXEL = 0.5
"""Pixels on either side of a pixel's centre over which the change of its ray is measured."""

CAMERA_COORDINATES = (
    ("ShaderNodeTexCoord", "Camera"),
    ("ShaderNodeCameraData", "View Vector"),
    ("ShaderNodeCameraData", "View Z Depth"),
)
"""Nodes that tell a shader of camera space, by which outputs: a panorama's has other axes than a custom camera's."""


def _blocker(scene: bpy.types.Scene, eyes: Iterable[Camera], deepest: float) -> str | None:
    """Return why a table cannot hold the rays of these views, as `PackedCamera.blocker` says."""
    camera, eyes = evaluated(scene.camera, scene).data, list(eyes)
    checks = {
        "the lens of a panorama has an aperture": aperture_radius(camera) > 0.0,
        "the Vector pass of a panorama is that of Cycles' own camera": vector_pass_asked_for(scene),
        "a shader reads camera coordinates": any(uses_output(*output) for output in CAMERA_COORDINATES)
        or any(map(may_read_camera, shader_nodes())),
        "surfaces reach the camera's clip end": camera.type == "PERSP" and deepest > camera.clip_end,
        # Cycles asks whether its own camera is in a volume, and knows nothing of the circle on which the rays begin.
        "an eye may begin in a volume": _may_leave_volumes(scene, eyes),
    }
    return missing_osl_cameras(scene) or next((reason for reason, blocks in checks.items() if blocks), None)


def _may_leave_volumes(scene: bpy.types.Scene, eyes: Sequence[Camera]) -> bool:
    """Return whether rays of spherical stereo may begin in a volume in which the camera itself is not."""
    if not any(_panoramic(eye).stereo for eye in eyes):
        return False
    boxes = volume_boxes(scene)
    return may_begin_in(scene, boxes, eyes) and not all(surely_inside(eye, boxes) for eye in eyes)


def _rays(pixels: PackedPixels, pose: NDArray[np.float64]) -> tuple[NDArray, NDArray]:
    """Return the rays (3, 6, N) of pixels in the space of a custom camera with this pose (4, 4), and the length (N,) by
    which they begin beyond its near clip, in near clips.

    By the first index there are the rays of the pixels' centres and their changes per pixel to the right and down; by
    the second, origin and direction.
    """
    camera = replace(_panoramic(pixels.camera), ends_at_lens=False)
    x, y = pixels.places[:, 1] + 0.5, pixels.places[:, 0] + 0.5
    into = (FORWARD @ np.linalg.inv(pose))[:3]
    own = into[:, :3] @ camera.world_from_camera[:3, 3] + into[:, 3]
    turn = into[:, :3] @ camera.world_from_camera[:3, :3]

    def rays(right: float, down: float) -> NDArray:
        origin, direction = (_stacked(part, x) for part in camera.ray_from_px(x + right, y + down))
        return np.concatenate([turn @ origin + own[:, None], turn @ direction])

    def change(right: float, down: float) -> NDArray:
        return (rays(right, down) - rays(-right, -down)) / (2.0 * HALF_PIXEL)

    return np.stack([rays(0.0, 0.0), change(HALF_PIXEL, 0.0), change(0.0, HALF_PIXEL)]), camera.near_clips(x, y) - 1.0


def _lens_edge(pixels: PackedPixels) -> NDArray:
    """Return (3, N) how far within the lens's edge the pixels' centres lie, and the change of that per pixel to the
    right and down."""
    camera = _panoramic(pixels.camera)
    x, y = pixels.places[:, 1] + 0.5, pixels.places[:, 0] + 0.5
    right = camera.within_lens(x + HALF_PIXEL, y) - camera.within_lens(x - HALF_PIXEL, y)
    down = camera.within_lens(x, y + HALF_PIXEL) - camera.within_lens(x, y - HALF_PIXEL)
    return np.stack([camera.within_lens(x, y), right, down])


def _panoramic(camera: Camera) -> PanoramicCamera:
    """Return the camera itself: no other kind is traced here."""
    assert isinstance(camera, PanoramicCamera)
    return camera


def _stacked(vector: Vector, like: Array) -> NDArray:
    """Return a vector's parts as an array (3, N)."""
    return np.stack(np.broadcast_arrays(*vector, like)[:3])


def _table(task: PackedTask) -> NDArray[np.float32]:
    """Return the table (rows, TABLE_WIDTH, 4) that the shader reads: 0 where the packed picture has no pixel, and where
    a pixel shows nothing."""
    size = task.packing.height * task.packing.width
    texels = np.zeros((size, TEXELS, 4), np.float32)
    per_row = TABLE_WIDTH // TEXELS
    for pixels, at in zip(task.views, task.packing.at, strict=True):
        rays, beyond = _rays(pixels, task.rendered.world_from_camera)
        shown = np.isfinite(rays).all(axis=(0, 1))
        rays = np.where(shown, rays, 0.0)
        texels[at, :3, :3] = rays[:, :3].transpose(2, 0, 1)
        texels[at, 3:, :3] = rays[:, 3:].transpose(2, 0, 1)
        texels[at, 0, 3] = np.where(shown, np.asarray(at) // per_row + 1, 0)
        texels[at, 1, 3] = beyond * task.clip_start
        texels[at, 3:, 3] = _lens_edge(pixels).T
    rows = -(-size // per_row)
    table = np.zeros((1 << (rows - 1).bit_length(), TABLE_WIDTH, 4), np.float32)
    filled = np.zeros((rows * per_row, TEXELS, 4), np.float32)
    filled[:size] = texels
    table[:rows, : per_row * TEXELS] = filled.reshape(rows, -1, 4)
    return table


@contextmanager
def _in_place(scene: bpy.types.Scene, task: PackedTask, folder: Path) -> Iterator[None]:
    """Have the working scene's camera be the custom camera of a packed render, for the time of a `with` block; all is
    restored afterwards, also after an error. The folder takes the table that the shader reads.
    """
    # Cycles keeps textures by file name, so each table has a new one: the folder's name is random.
    path = folder / "rays.exr"
    table = _table(task)
    write_table(path, table)
    bytecode = compiled_shader(SHADER, scene.cycles.pixel_filter_type, scene.cycles.filter_width)
    with (
        lens_to_set(scene) as packed,
        packed_resolution(scene, task.packing),
        changed(scene.cycles, pixel_filter_type="BOX"),
        without_shifts(packed),
        _without_offset(packed),
        _set_camera(packed, task, path, table.shape, bytecode),
    ):
        yield


@contextmanager
def _without_offset(packed: bpy.types.Camera) -> Iterator[None]:
    """Have a lens with spherical stereo not moved to an eye, for the time of a `with` block. Blender moves a custom
    camera as it moves a plain lens, and not as it moves one with spherical stereo; the rays begin at the eye."""
    if not packed.stereo.use_spherical_stereo:
        yield
        return
    with changed(packed.stereo, interocular_distance=0.0):
        yield


@contextmanager
def _set_camera(
    packed: bpy.types.Camera, task: PackedTask, path: Path, shape: tuple[int, ...], bytecode: str
) -> Iterator[None]:
    """Have the lens `packed` be the custom camera of a packed render, for the time of a `with` block; path is that of
    the table, whose shape is (rows, columns, 4)."""
    packed.custom_mode = "INTERNAL"
    packed.custom_bytecode = bytecode
    packed.custom_bytecode_hash = hashlib.md5(bytecode.encode(), usedforsecurity=False).hexdigest()
    parameters = packed.cycles_custom
    parameters["table"] = str(path)
    parameters["sides"] = (float(shape[1]), float(shape[0]), 0.0)
    parameters["size"] = (float(task.packing.width), float(task.packing.height), 0.0)
    parameters["upwards"] = 1.0 if bpy.app.version >= TEXTURES_UPWARDS_FROM_VERSION else 0.0
    with changed(packed, type="CUSTOM"):
        yield


def _as_plain(flat: Passes, task: PackedTask, index: int) -> Passes:
    """Return the passes (N, C) of one view's pixels as `PackedCamera.as_plain` says, with the depth of its camera.

    Cycles gives both custom cameras and panoramas the distance from its camera's own place, and the denoiser's normals
    in axes that differ.
    """
    pixels = task.views[index]
    camera, converted = _panoramic(pixels.camera), dict(flat)
    if DEPTH_PASS in flat:
        x, y = pixels.places[:, 1] + 0.5, pixels.places[:, 0] + 0.5
        distance = flat[DEPTH_PASS][:, 0]
        if camera is not task.rendered:
            away = np.linalg.norm(flat[POSITION] - camera.world_from_camera[:3, 3], axis=-1)
            distance = np.where(np.isfinite(distance), away, distance)
        depth = camera.depth_from_distance(x, y, distance)
        converted[DEPTH_PASS] = depth[:, None].astype(np.float32)
    if NORMAL in flat:
        place = np.linalg.inv(camera.world_from_camera[:3, :3]) @ task.rendered.world_from_camera[:3, :3]
        turn = PANORAMA_FROM_CAMERA @ place @ FORWARD[:3, :3]
        converted[NORMAL] = (flat[NORMAL] @ turn.T).astype(np.float32)
    return converted


RAY_CAMERA = PackedCamera(
    name="osl",
    label="OSL camera",
    clips_by_distance=True,
    blocker=_blocker,
    settings=SETTINGS | {"camera.data.stereo.interocular_distance"},
    in_place=_in_place,
    as_plain=_as_plain,
    costs_key="osl-rays",
)
"""The packed camera of panoramas, in OSL."""
