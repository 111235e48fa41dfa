"""The packed fill: one small render whose pixels are wanted pixels of views, side by side (see hole_camera.osl)."""

from __future__ import annotations

import hashlib
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from functools import lru_cache
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from ...errors import StereoReprojectError
from ...images.exr import write_table
from ...images.passes import DEPTH_PASS, VECTOR_PASS, Passes
from ...trace.packing import Packing, pack
from ...trace.pixel_filter import sample_offsets
from ...views.camera import Camera, PerspectiveCamera
from ...warp.motion import motion_from_directions
from ..scene.effects import has_grease_pencil, is_animated, uses_output
from ..scene.motion import vector_pass_asked_for
from ..scene.readers import what_reads
from ..scene.rig import FrameRegion, frame_region
from ..scene.visible import aperture_radius
from ..scene.working import changed, evaluated
from .packed_views import PackedPixels, numbers_of_others, seen_from_view, switch_on_positions, without_added_positions
from .render import Rendered, render_views

TEXTURES_UPWARDS_FROM_VERSION = (5, 0, 0)
"""Version of Blender from which textures in OSL are expected to have t upwards; the shader looks for itself."""

BOX_OFFSETS = "offsets[2] = {0.0, 1.0}"
"""Text of the shader that the pixel filter's offsets are put in place of."""

NO_OTHERS = "others[1] = {0.0}"
"""Text of the shader that the numbers of views other than the rendered one are put in place of."""

MAX_KEPT_SHADERS = 8
"""Compiled shaders that are kept: in an animation, one with several views may be another in each frame."""

PACKED_SAMPLING = {"pixel_filter_type": "BOX", "scrambling_distance": 1.0, "auto_scrambling_distance": False}
"""Cycles' settings while it renders a packed picture. The shader filters pixels itself; and a shorter scrambling
distance has pixels share their random numbers: both traces of a probe would have one noise, and seem to have none."""

PACKED_RENDER_SETTINGS = (
    "resolution_x",
    "resolution_y",
    "resolution_percentage",
    "use_border",
    "pixel_aspect_x",
    "pixel_aspect_y",
)
"""Render settings that a packed picture has of its own."""

PACKED_CAMERA_SETTINGS = ("type", "custom_mode", "shift_x", "shift_y", "stereo.convergence_mode")
"""Properties of the camera's data that are others in it."""

PACKED_SETTINGS = frozenset(
    (
        *(f"render.{name}" for name in PACKED_RENDER_SETTINGS),
        *(f"camera.data.{name}" for name in PACKED_CAMERA_SETTINGS),
        *(f"cycles.{name}" for name in PACKED_SAMPLING),
    )
)
"""Paths from the scene of all settings that a packed render changes, as drivers name them."""

SHADER = Path(__file__).with_name("hole_camera.osl")


def packed_blocker(scene: bpy.types.Scene, eyes: Iterable[Camera], deepest: float) -> str | None:
    """Return why pixels of these views cannot be traced packed, in words; None if they can. deepest is the greatest
    finite depth that a view has shown, in scene units.
    """
    without_osl = missing_osl_cameras(scene)
    if without_osl is not None:
        return without_osl
    camera = evaluated(scene.camera, scene).data
    checks = {
        "the camera is orthographic": camera.type != "PERSP",
        "rolling shutter needs the frame's own rows": scene.render.use_motion_blur
        and scene.cycles.rolling_shutter_type != "NONE",
        "the lens is animated and motion blur is on": scene.render.use_motion_blur and is_animated(scene.camera.data),
        "the lens is animated and the Vector pass is on": vector_pass_asked_for(scene)
        and is_animated(scene.camera.data),
        "adaptive subdivision follows the camera": _uses_adaptive_subdivision(scene),
        "camera culling follows the camera": scene.render.use_simplify
        and (scene.cycles.use_camera_cull or scene.cycles.use_distance_cull),
        "a material uses Window coordinates": uses_output("ShaderNodeTexCoord", "Window"),
        "Grease Pencil is drawn over the finished render": has_grease_pencil(scene),
        # A custom camera's rays end at that distance, a perspective camera's at that depth.
        "surfaces reach the camera's clip end": deepest * max(map(_corner, eyes)) > camera.clip_end,
    }
    return next((reason for reason, blocks in checks.items() if blocks), None) or what_reads(scene, PACKED_SETTINGS)


def missing_osl_cameras(scene: bpy.types.Scene) -> str | None:
    """Return why Cycles cannot render with an OSL camera here, in words; None if it can. Only this Blender and the
    scene's device count, not what the scene shows.
    """
    if not _has_osl():
        return "this Blender is built without OSL"
    return None if _device_has_osl(scene) else "the device has no OSL cameras (only CPU and OptiX do)"


def _corner(eye: Camera) -> float:
    """Return the length of the ray from the eye to the farthest corner of its view plane, at unit depth."""
    plane = eye.plane
    reach_x, reach_y = max(abs(plane.left), abs(plane.right)), max(abs(plane.bottom), abs(plane.top))
    return float(np.linalg.norm((reach_x, reach_y, 1.0)))


def _has_osl() -> bool:
    """Return whether this Blender's Cycles is built with OSL."""
    import _cycles  # pyright: ignore[reportMissingImports]

    return bool(_cycles.with_osl)


def _device_has_osl(scene: bpy.types.Scene) -> bool:
    """Return whether the device that the scene is rendered on can run OSL cameras."""
    if scene.cycles.device == "CPU":
        return True
    preferences = bpy.context.preferences.addons["cycles"].preferences
    return preferences.compute_device_type in ("NONE", "OPTIX")


def _uses_adaptive_subdivision(scene: bpy.types.Scene) -> bool:
    """Return whether adaptive subdivision is on for any object of the scene."""
    for item in scene.objects:
        settings = getattr(item, "cycles", None)
        if getattr(settings, "use_adaptive_subdivision", False):
            return True
        if any(getattr(modifier, "use_adaptive_subdivision", False) for modifier in item.modifiers):
            return True
    return False


def trace_packed(
    scene: bpy.types.Scene,
    view: str,
    rendered: Camera,
    views: Sequence[PackedPixels],
    folder: Path,
    *,
    seed: int,
) -> tuple[Rendered, list[Passes]]:
    """Trace pixels of any number of views in one render. Return the render, and the passes (N, C) of each view's
    pixels.

    view is the view of the scene that Blender renders, and `rendered` its camera; each of `views` has either that very
    camera or any other. If there are several, their cameras must keep their places to each other while the shutter is
    open, and nothing in the scene may depend on where Cycles' camera is: see `why_apart`. folder is private.
    """
    assert isinstance(rendered, PerspectiveCamera)
    others = [pixels.camera for pixels in views if pixels.camera is not rendered]
    if others:
        switch_on_positions(scene)
    packing = pack([pixels.places for pixels in views])
    size = packing.width, packing.height
    with (
        tempfile.TemporaryDirectory(dir=folder) as tables,
        _packed(scene, rendered, others, size, Path(tables)) as path,
    ):
        write_table(path, _table(views, rendered, packing))
        result = render_views(scene, (view,), folder, seed=seed)
    flat = {name: image.reshape(-1, image.shape[2]) for name, image in result.views[view].items()}
    region = frame_region(scene.render)
    traced: list[Passes] = []
    for pixels, at in zip(views, packing.at, strict=True):
        passes = {name: image[at] for name, image in flat.items()}
        if pixels.camera is rendered:
            passes = _as_plain_camera_has_them(passes, rendered, pixels.places, region)
        else:
            passes = seen_from_view(passes, rendered, pixels)
        traced.append(without_added_positions(scene, passes))
    return result, traced


def _as_plain_camera_has_them(flat: Passes, target: Camera, places: NDArray[np.intp], region: FrameRegion) -> Passes:
    """Return the passes (N, C) of pixels of a custom camera as a plain camera has them: Cycles gives a custom one the
    distance in place of the depth, and motion vectors of another kind. places (N, 2) are the pixels' rows and columns.
    """
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
def _packed(
    scene: bpy.types.Scene,
    rendered: PerspectiveCamera,
    others: Sequence[PerspectiveCamera],
    size: tuple[int, int],
    folder: Path,
) -> Iterator[Path]:
    """Have the scene set up for a packed render of this size (width, height), for the time of a `with` block; all is
    restored afterwards, also after an error. It yields the path at which the shader looks for its table, to be written
    by the caller.
    """
    # Cycles keeps textures by file name, so each table has a new one: the folder's name is random.
    table = folder / "table.exr"
    numbers = numbers_of_others(scene, rendered, others)
    bytecode = _bytecode(scene.cycles.pixel_filter_type, scene.cycles.filter_width, numbers)
    resolution = {"resolution_x": size[0], "resolution_y": size[1], "resolution_percentage": 100}
    whole = {"use_border": False, "pixel_aspect_x": 1.0, "pixel_aspect_y": 1.0}
    with ExitStack() as restored:
        packed = restored.enter_context(_lens_to_set(scene))
        restored.enter_context(changed(scene.render, **resolution, **whole))
        restored.enter_context(changed(scene.cycles, **PACKED_SAMPLING))
        restored.enter_context(_set_camera(packed, rendered, size, table, bytecode))
        yield table


@contextmanager
def _lens_to_set(scene: bpy.types.Scene) -> Iterator[bpy.types.Camera]:
    """Have a lens that can be made the packed camera's, for the time of a `with` block: the working scene's own; or a
    copy of it where the own one is animated, since curves would undo what is set. The copy is removed afterwards.

    A copy costs time: Blender works out anew what depends on what, and Cycles syncs all objects again.
    """
    eye = scene.camera
    plain: bpy.types.Camera = eye.data  # pyright: ignore[reportAssignmentType] - a camera object has no other data
    if not is_animated(plain):
        yield plain
        return
    packed = plain.copy()
    try:
        _set_lens(packed, evaluated(eye, scene).data)
        eye.data = packed
        yield packed
    finally:
        eye.data = plain
        bpy.data.cameras.remove(packed)


def _set_lens(packed: bpy.types.Camera, plain: bpy.types.Camera) -> None:
    """Give the lens `packed` the values that `plain`, the evaluated lens, has in the rendered frame, and no
    animation.
    """
    packed.animation_data_clear()
    for name in ("clip_start", "clip_end", "lens"):
        setattr(packed, name, getattr(plain, name))
    for name in ("interocular_distance", "convergence_distance"):
        setattr(packed.stereo, name, getattr(plain.stereo, name))
    for name in ("focus_distance", "aperture_fstop", "aperture_blades", "aperture_rotation", "aperture_ratio"):
        setattr(packed.dof, name, getattr(plain.dof, name))
    packed.dof.use_dof = plain.dof.use_dof


@contextmanager
def _set_camera(
    packed: bpy.types.Camera,
    target: PerspectiveCamera,
    size: tuple[int, int],
    table: Path,
    bytecode: str,
) -> Iterator[None]:
    """Have the lens `packed` be the custom camera of a packed render, for the time of a `with` block. target is the
    camera of the view that Blender renders, size (width, height) the packed picture's, table the path of its table.
    """
    packed.custom_mode = "INTERNAL"
    packed.custom_bytecode = bytecode
    packed.custom_bytecode_hash = hashlib.md5(packed.custom_bytecode.encode(), usedforsecurity=False).hexdigest()
    plane = target.plane
    parameters = packed.cycles_custom
    parameters["table"] = str(table)
    parameters["size"] = (float(size[0]), float(size[1]), 0.0)
    parameters["plane_corner"] = (float(plane.left), float(plane.top), 0.0)
    parameters["plane_step"] = (
        float((plane.right - plane.left) / target.width),
        float((plane.top - plane.bottom) / target.height),
        0.0,
    )
    parameters["upwards"] = 1.0 if bpy.app.version >= TEXTURES_UPWARDS_FROM_VERSION else 0.0
    parameters["near_clip"] = float(packed.clip_start)
    parameters["aperture_size"] = aperture_radius(packed)
    mode = packed.stereo.convergence_mode
    # Blender would shift a custom camera's raster positions; the view plane holds the shifts already.
    with (
        changed(packed.stereo, convergence_mode="PARALLEL" if mode == "OFFAXIS" else mode),
        changed(packed, type="CUSTOM", shift_x=0.0, shift_y=0.0),
    ):
        yield


@lru_cache(maxsize=MAX_KEPT_SHADERS)
def _bytecode(pixel_filter: str, width: float, others: tuple[float, ...]) -> str:
    """Return the custom camera's shader, compiled by the Blender that runs it. pixel_filter and width, in pixels, are
    Cycles' pixel filter; others are what `numbers_of_others` returns. Raises StereoReprojectError if it does not
    compile.
    """
    import _cycles  # pyright: ignore[reportMissingImports]

    source = SHADER.read_text(encoding="utf-8")
    source = _with_numbers(source, BOX_OFFSETS, sample_offsets(pixel_filter, width))
    if others:
        source = _with_numbers(source, NO_OTHERS, np.array(others, np.float32))
    with tempfile.TemporaryDirectory() as folder:
        shader, compiled = Path(folder) / SHADER.name, Path(folder) / "hole_camera.oso"
        shader.write_text(source, encoding="utf-8")
        if not _cycles.osl_compile(str(shader), str(compiled)):
            raise StereoReprojectError(f"Blender's OSL compiler does not take {SHADER.name}: use --fill card")
        return compiled.read_text()


def _with_numbers(source: str, stands_there: str, numbers: NDArray[np.float32]) -> str:
    """Return a shader's source in which `numbers` are the default of an array. stands_there is the text of the
    declaration that is replaced; it must be in the source exactly once.
    """
    assert source.count(stands_there) == 1
    name = stands_there.partition("[")[0]
    listed = ", ".join(f"{number:.9g}" for number in numbers)
    return source.replace(stands_there, f"{name}[{numbers.size}] = {{{listed}}}")
