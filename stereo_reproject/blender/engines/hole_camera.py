"""The packed camera in OSL: a custom camera whose shader shoots the rays of a packed picture (see hole_camera.osl).

Cycles has OSL cameras on CPU and OptiX alone.
"""

from __future__ import annotations

import hashlib
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from ...errors import StereoReprojectError
from ...images.exr import write_table
from ...images.passes import DEPTH_PASS, VECTOR_PASS, Passes
from ...trace.packing import Packing
from ...trace.pixel_filter import sample_offsets
from ...views.camera import Camera, PerspectiveCamera, pixel_size, planar
from ...warp.motion import motion_from_directions
from ...words import Words
from ..scene.visible import aperture_radius
from ..scene.working import changed, evaluated
from .packed_camera import PackedCamera, PackedTask, compute_device, lens_to_set, packed_resolution, without_shifts
from .packed_views import PackedPixels, numbers_of_others, seen_from_view

TEXTURES_UPWARDS_FROM_VERSION = (5, 0, 0)
"""Version of Blender from which textures in OSL are expected to have t upwards; the shader looks for itself."""

BOX_OFFSETS = "offsets[2] = {0.0, 1.0}"
"""Text of the shader that the pixel filter's offsets are put in place of."""

NO_OTHERS = "others[1] = {0.0}"
"""Text of the shader that the numbers of views other than the rendered one are put in place of."""

MAX_KEPT_SHADERS = 8
"""Compiled shaders that are kept: in an animation, one with several views may be another in each frame."""

SETTINGS = frozenset(
    (
        *(f"camera.data.{name}" for name in ("type", "custom_mode", "shift_x", "shift_y", "stereo.convergence_mode")),
        "cycles.pixel_filter_type",
    )
)
"""Paths from the scene of what only this packed camera sets."""

SHADER = Path(__file__).with_name("hole_camera.osl")


def missing_osl_cameras(scene: bpy.types.Scene) -> str | None:
    """Return why Cycles cannot render with an OSL camera here, in words; None if it can. Only this Blender and the
    scene's device count, not what the scene shows.
    """
    if not _has_osl():
        return "this Blender is built without OSL"
    return None if _device_has_osl(scene) else "the device has no OSL cameras (only CPU and OptiX do)"


def _has_osl() -> bool:
    """Return whether this Blender's Cycles is built with OSL."""
    import _cycles  # pyright: ignore[reportMissingImports]

    return bool(_cycles.with_osl)


def _device_has_osl(scene: bpy.types.Scene) -> bool:
    """Return whether the device that the scene is rendered on can run OSL cameras."""
    return compute_device(scene) in ("NONE", "OPTIX")


def _blocker(scene: bpy.types.Scene, eyes: Iterable[Camera], deepest: float) -> str | None:
    """Return why an OSL camera cannot shoot the rays of these views, as `PackedCamera.blocker` says."""
    without_osl = missing_osl_cameras(scene)
    if without_osl is not None:
        return without_osl
    camera = evaluated(scene.camera, scene).data
    if camera.type != "PERSP":
        return "the camera is orthographic"
    # A custom camera's rays end at that distance, a perspective camera's at that depth.
    if deepest * max(map(_corner, eyes)) > camera.clip_end:
        return "surfaces reach the camera's clip end"
    return None


def _corner(eye: Camera) -> float:
    """Return the length of the ray from the eye to the farthest corner of its view plane, at unit depth."""
    plane = planar(eye).plane
    reach_x, reach_y = max(abs(plane.left), abs(plane.right)), max(abs(plane.bottom), abs(plane.top))
    return float(np.linalg.norm((reach_x, reach_y, 1.0)))


def _as_plain(flat: Passes, task: PackedTask, index: int) -> Passes:
    """Return the passes (N, C) of one view's pixels as `PackedCamera.as_plain` says: Cycles gives a custom camera
    the distance in place of the depth, and motion vectors of another kind.
    """
    pixels = task.views[index]
    target, places, region = task.rendered, pixels.places, task.region
    if pixels.camera is not target:
        return seen_from_view(flat, target, pixels)
    assert isinstance(target, PerspectiveCamera)
    x, y = places[:, 1] + 0.5, places[:, 0] + 0.5
    converted = dict(flat)
    if DEPTH_PASS in flat:
        # The distance from it.
        _, through = target.ray_from_px(x, y)
        along = np.sqrt(through[0] ** 2 + through[1] ** 2 + 1.0)
        converted[DEPTH_PASS] = (flat[DEPTH_PASS] / along[:, None]).astype(np.float32)
    if VECTOR_PASS in flat:
        sky = np.isposinf(flat[DEPTH_PASS][:, 0])
        corner = (-region.left, region.full_height - region.top)
        converted[VECTOR_PASS] = motion_from_directions(flat[VECTOR_PASS], target, x, y, sky=sky, corner=corner)
    return converted


def _table(views: Sequence[PackedPixels], rendered: Camera, packing: Packing) -> NDArray[np.float32]:
    """Return the table (height, width, 4) that the shader reads for a packed picture. Each pixel has: column and row in
    its view, -1 where there is no pixel; the table's own row; and the number of its view among those that Blender does
    not render, -1 for the one that it does.
    """
    table = np.full((packing.height * packing.width, 4), -1.0, np.float32)
    number = 0
    for pixels, at in zip(views, packing.at, strict=True):
        table[at, :2] = pixels.places[:, ::-1]
        if pixels.camera is not rendered:
            table[at, 3] = number
            number += 1
    table = table.reshape(packing.height, packing.width, 4)
    table[..., 2] = np.arange(packing.height)[:, None]
    return table


@contextmanager
def _in_place(scene: bpy.types.Scene, task: PackedTask, folder: Path) -> Iterator[None]:
    """Have the working scene's camera be the OSL camera of a packed render, for the time of a `with` block; all is
    restored afterwards, also after an error. The folder takes the table that the shader reads.
    """
    assert isinstance(task.rendered, PerspectiveCamera)
    # Cycles keeps textures by file name, so each table has a new one: the folder's name is random.
    table = folder / "table.exr"
    write_table(table, _table(task.views, task.rendered, task.packing))
    numbers = numbers_of_others(scene, task.rendered, task.others)
    bytecode = compiled_shader(SHADER, scene.cycles.pixel_filter_type, scene.cycles.filter_width, numbers)
    with (
        lens_to_set(scene) as packed,
        packed_resolution(scene, task.packing),
        changed(scene.cycles, pixel_filter_type="BOX"),
        without_shifts(packed),
        _set_camera(packed, task, table, bytecode),
    ):
        yield


@contextmanager
def _set_camera(packed: bpy.types.Camera, task: PackedTask, table: Path, bytecode: str) -> Iterator[None]:
    """Have the lens `packed` be the custom camera of a packed render, for the time of a `with` block; table is the path
    of the packed picture's table.
    """
    target, packing = task.rendered, task.packing
    packed.custom_mode = "INTERNAL"
    packed.custom_bytecode = bytecode
    packed.custom_bytecode_hash = hashlib.md5(packed.custom_bytecode.encode(), usedforsecurity=False).hexdigest()
    plane = planar(target).plane
    parameters = packed.cycles_custom
    parameters["table"] = str(table)
    parameters["size"] = (float(packing.width), float(packing.height), 0.0)
    parameters["plane_corner"] = (float(plane.left), float(plane.top), 0.0)
    parameters["plane_step"] = (*map(float, pixel_size(target)), 0.0)
    parameters["upwards"] = 1.0 if bpy.app.version >= TEXTURES_UPWARDS_FROM_VERSION else 0.0
    parameters["near_clip"] = float(packed.clip_start)
    parameters["aperture_size"] = aperture_radius(packed)
    with changed(packed, type="CUSTOM"):
        yield


@lru_cache(maxsize=MAX_KEPT_SHADERS)
def compiled_shader(path: Path, pixel_filter: str, width: float, others: tuple[float, ...] = ()) -> str:
    """Return a custom camera's shader, compiled by the Blender that runs it. pixel_filter and width, in pixels, are
    Cycles' pixel filter; others are what `numbers_of_others` returns. Raises StereoReprojectError if it does not
    compile.
    """
    import _cycles  # pyright: ignore[reportMissingImports]

    source = path.read_text(encoding="utf-8")
    source = _with_numbers(source, BOX_OFFSETS, sample_offsets(pixel_filter, width))
    if others:
        source = _with_numbers(source, NO_OTHERS, np.array(others, np.float32))
    with tempfile.TemporaryDirectory() as folder:
        shader, compiled = Path(folder) / SHADER.name, Path(folder) / "hole_camera.oso"
        shader.write_text(source, encoding="utf-8")
        if not _cycles.osl_compile(str(shader), str(compiled)):
            message = "Blender's OSL compiler does not take {shader}: use --fill {fill}"
            fill = "card" if path == SHADER else "full"
            raise StereoReprojectError(Words(message, shader=path.name, fill=fill))
        return compiled.read_text()


def _with_numbers(source: str, stands_there: str, numbers: NDArray[np.float32]) -> str:
    """Return a shader's source in which `numbers` are the default of an array. stands_there is the text of the
    declaration that is replaced; it must be in the source exactly once.
    """
    assert source.count(stands_there) == 1
    name = stands_there.partition("[")[0]
    listed = ", ".join(f"{number:.9g}" for number in numbers)
    return source.replace(stands_there, f"{name}[{numbers.size}] = {{{listed}}}")


OSL_CAMERA = PackedCamera(
    name="osl",
    label="OSL camera",
    clips_by_distance=True,
    blocker=_blocker,
    settings=SETTINGS,
    in_place=_in_place,
    as_plain=_as_plain,
)
"""The packed camera in OSL."""
