"""The packed camera of panoramas in OSL: a custom camera whose shader makes each packed pixel's ray of what a table has
of it (see ray_camera.osl and ray_table.py).
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

import bpy
import numpy as np

from ...images.exr import write_table
from ...images.passes import Passes
from ...views.camera import Camera
from ..scene.effects import may_read_camera, shader_nodes, uses_output
from ..scene.motion import vector_pass_asked_for
from ..scene.working import changed, evaluated
from .hole_camera import SETTINGS, TEXTURES_UPWARDS_FROM_VERSION, compiled_shader, missing_osl_cameras
from .packed_camera import PackedCamera, PackedTask, lens_to_set, packed_resolution, without_offset, without_shifts
from .packed_views import FORWARD
from .ray_table import TEXELS, SharedRays, ray_texels, seen_by_eye, shared_rays, why_no_rays

SHADER = Path(__file__).with_name("ray_camera.osl")

TABLE_WIDTH = 4096
"""Columns of the table, a power of two."""

CAMERA_COORDINATES = (
    ("ShaderNodeTexCoord", "Camera"),
    ("ShaderNodeCameraData", "View Vector"),
    ("ShaderNodeCameraData", "View Z Depth"),
)
"""Nodes that tell a shader of camera space, by which outputs: a panorama's has other axes than a custom camera's."""


def _blocker(scene: bpy.types.Scene, eyes: Iterable[Camera], deepest: float) -> str | None:
    """Return why an OSL camera cannot shoot the rays of these views, as `PackedCamera.blocker` says."""
    camera, eyes = evaluated(scene.camera, scene).data, list(eyes)
    checks = {
        "the Vector pass of a panorama is that of Cycles' own camera": vector_pass_asked_for(scene),
        "a shader reads camera coordinates": any(uses_output(*output) for output in CAMERA_COORDINATES)
        or any(map(may_read_camera, shader_nodes())),
        "surfaces reach the camera's clip end": camera.type == "PERSP" and deepest > camera.clip_end,
    }
    reason = missing_osl_cameras(scene) or next((reason for reason, blocks in checks.items() if blocks), None)
    return reason or why_no_rays(scene, eyes)


def _write_rays(path: Path, task: PackedTask) -> tuple[int, ...]:
    """Write the table (rows, TABLE_WIDTH, 4) that the shader reads, with the packed pixels from its second row on.
    Return its shape."""
    per_row = TABLE_WIDTH // TEXELS
    filled = -(-task.packing.height * task.packing.width // per_row)
    rows = 1 << (filled + 1).bit_length()
    texels = ray_texels(task, FORWARD[:3, :3], count=rows * per_row, first=per_row)
    table = np.moveaxis(texels.reshape(4, rows, TABLE_WIDTH), 0, -1)
    table[0] = 1.0
    write_table(path, table)
    return table.shape


@contextmanager
def _in_place(scene: bpy.types.Scene, task: PackedTask, folder: Path) -> Iterator[None]:
    """Have the working scene's camera be the custom camera of a packed render, for the time of a `with` block; all is
    restored afterwards, also after an error. The folder takes the table that the shader reads.
    """
    # Cycles keeps textures by file name, so each table has a new one: the folder's name is random.
    path = folder / "rays.exr"
    shape = _write_rays(path, task)
    bytecode = compiled_shader(SHADER, scene.cycles.pixel_filter_type, scene.cycles.filter_width)
    with (
        lens_to_set(scene) as packed,
        packed_resolution(scene, task.packing),
        changed(scene.cycles, pixel_filter_type="BOX"),
        without_shifts(packed),
        without_offset(packed),
        _set_camera(packed, task, path, shape, bytecode),
    ):
        _set_shared(packed, shared_rays(scene, task, FORWARD[:3, :3]))
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


def _set_shared(packed: bpy.types.Camera, rays: SharedRays) -> None:
    """Give the shader of the lens `packed` what all rays share; all are floats, as it takes them."""
    parameters = packed.cycles_custom
    parameters["up"], parameters["axis"] = rays.up, rays.ahead
    parameters["per_convergence"] = rays.per_convergence
    parameters["poles"] = (*(rays.poles or (0.0, 0.0)), 0.0)
    parameters["is_unit"], parameters["by_plane"] = float(rays.is_unit), float(rays.by_plane)
    parameters["near_clip"], parameters["focus"] = rays.near_clip, rays.focus
    parameters["aperture"] = rays.aperture


def _as_plain(flat: Passes, task: PackedTask, index: int) -> Passes:
    """Return the passes (N, C) of one view's pixels as `PackedCamera.as_plain` says: Cycles gives a custom camera the
    distance from its place in place of the depth, and the denoiser's normals other axes."""
    return seen_by_eye(flat, task, index, by_distance=True, camera_from_normals=FORWARD[:3, :3])


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
