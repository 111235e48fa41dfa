"""The packed camera without OSL: a plain camera looks at a sheet, and a Ray Portal sends its rays on (see
portal_material.py). It works on every device.

The packed camera is the rendered view's own, with another piece of the view plane: pixels as large as the view's, as
many as the packed picture has. What Cycles derives from the camera (depth, mist, motion in pixels, camera coordinates
in shaders, the footprint of a pixel) so stays that of the view. The sheet stands between the camera's place and its
near clip, where no ray of the view comes.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from ...images.effects import Effect
from ...images.exr import write_table
from ...trace.pixel_filter import filter_support
from ...views.camera import Camera, is_planar, pixel_size, target_from_source
from ...views.panorama import shows_lens_edge
from ..scene.animated import animated_values
from ..scene.cryptomatte import cryptomatte_asked_for
from ..scene.effects import shader_nodes, uses_output, what_moves
from ..scene.materials import world_shading
from ..scene.motion import vector_pass_asked_for, while_open
from ..scene.visible import aperture_radius, reaches_beyond, seen_beyond, volume_boxes
from ..scene.working import changed, evaluated, rendered_layer
from .packed_camera import (
    PackedCamera,
    PackedTask,
    compute_device,
    lens_to_set,
    packed_resolution,
    without_offset,
    without_shifts,
)
from .packed_views import circle_of, focus_distance_of, may_begin_in
from .portal_geometry import (
    SheetPlace,
    SheetRays,
    kind_of,
    on_plane,
    packed_step,
    place_of,
    sheet_from_camera,
    sheet_place,
    spread_ratio,
    tells_lens_apart,
)
from .portal_material import VIEW_ROWS, ViewRays, build_material
from .portal_panorama import PanoramaRays
from .portal_passes import as_plain, panorama_as_plain
from .portal_sheet import put_sheet
from .ray_passes import ADDED_PREFIX
from .ray_table import TEXELS, ray_texels, shared_rays, why_no_rays
from .tuning import TUNING

CAMERA_SETTINGS = ("shift_x", "shift_y", "stereo.convergence_mode", "sensor_fit", "sensor_width", "lens", "clip_start")

PANORAMA_SETTINGS = (
    "panorama_type",
    "longitude_min",
    "longitude_max",
    "latitude_min",
    "latitude_max",
    "stereo.interocular_distance",
)

DOF_SETTINGS = ("aperture_fstop", "focus_distance", "focus_object")

VOLUMES_GUIDED_FROM_VERSION = (5, 0, 0)
"""Version of Blender from which Cycles guides how likely camera rays scatter in a volume."""

COUNTERS = ("Transparent Depth", "Portal Depth")
"""Outputs of the Light Path node that count the sheet; 4.5 has not the second."""

CYCLES_SETTINGS = ("filter_width", "transparent_max_bounces", "min_transparent_bounces")

SETTINGS = frozenset(
    (
        *(f"camera.data.{name}" for name in (*CAMERA_SETTINGS, "ortho_scale")),
        *(f"camera.data.dof.{name}" for name in DOF_SETTINGS),
        *(f"cycles.{name}" for name in CYCLES_SETTINGS),
    )
)
"""Paths from the scene of what only this packed camera sets."""


def _blocker(scene: bpy.types.Scene, eyes: Iterable[Camera], deepest: float) -> str | None:  # noqa: ARG001
    """Return why a portal cannot send on the rays of these views, as `PackedCamera.blocker` says."""
    layer, eyes = rendered_layer(scene), list(eyes)
    lens = evaluated(scene.camera, scene).data
    world = layer.world_override or scene.world
    guided = layer.cycles.denoising_store_passes or scene.cycles.use_denoising
    checks = {
        "a material override would replace the portal's material": layer.material_override is not None,
        "the view layer shows no surfaces": not layer.use_solid,
        # It is there on the CPU alone, and takes the portal for a part of the path.
        "path guiding learns from rays that a portal breaks": scene.cycles.use_guiding
        and compute_device(scene) == "NONE",
        # They look a little of the neighbouring texels up, and the table has other numbers there.
        "shaders are rendered by OSL": scene.cycles.shading_system,
        "a shader counts transparent surfaces or portals": any(
            uses_output("ShaderNodeLightPath", output) for output in COUNTERS
        ),
        "the scene's texture limit would scale the portal's table": scene.render.use_simplify
        and scene.cycles.texture_limit_render != "OFF",
        "denoising passes that do not follow reflections would show the portal": guided
        and not getattr(layer.cycles, "denoising_pass_follow_reflections", True),
        "the pixel filter or the limit of transparent bounces is animated": _is_overwritten(scene),
        "the near clip is too close to the camera for the portal to be before it": any(
            sheet_place(eye, lens.clip_start) is None for eye in eyes
        ),
        # Rays that a portal sends on have no end, and pixels all the same width.
        "a wireframe is drawn as wide in pixels, and a portal's are all as wide": any(
            node.bl_idname == "ShaderNodeWireframe" and node.use_pixel_size for node in shader_nodes()
        ),
        "a material has bumps, and pixels of so wide a lens differ": uses_output("ShaderNodeBump", "Normal")
        and any(spread_ratio(eye) > TUNING.max_bump_spread_ratio for eye in eyes),
        "a volume of the world ends at the camera's clip end": world is not None
        and bool(world_shading(world) & Effect.VOLUME),
        # Cycles guides a ray's first part in a volume, and up to the sheet there is next to nothing of it: more noise.
        "a view may begin in a volume": bpy.app.version >= VOLUMES_GUIDED_FROM_VERSION
        and may_begin_in(scene, volume_boxes(scene), eyes),
    }
    reason = next((reason for reason, blocks in checks.items() if blocks), None)
    return reason or _beyond_clip_end(scene, eyes, lens.clip_end)


def _panorama_blocker(scene: bpy.types.Scene, eyes: Iterable[Camera], deepest: float) -> str | None:
    """Return why a portal cannot send on the rays of these panoramas, as `PackedCamera.blocker` says."""
    eyes, lens = list(eyes), evaluated(scene.camera, scene).data
    places = [place for eye in eyes if (place := sheet_place(eye, lens.clip_start))]
    checks = {
        "the Vector pass of a perspective camera ignores spherical stereo": lens.type == "PERSP"
        and vector_pass_asked_for(scene),
        "the near clip is too close to the camera for the portal's aperture to be before it": lens.type == "PANO"
        and aperture_radius(lens) > 0.0
        and not all(tells_lens_apart(eye, place) for eye, place in zip(eyes, places, strict=False)),
        # What is beyond it ends at the portal's sheet, which these passes show.
        "the lens has an edge, at which passes of surfaces would show the portal": any(map(shows_lens_edge, eyes))
        and _shows_surfaces(scene),
    }
    reason = next((reason for reason, blocks in checks.items() if blocks), None)
    return reason or why_no_rays(scene, eyes) or _blocker(scene, eyes, deepest)


def _shows_surfaces(scene: bpy.types.Scene) -> bool:
    """Return whether the user has asked for a pass of surfaces that is a mean of a pixel's samples."""
    layer = rendered_layer(scene)
    normals = layer.use_pass_normal and f"{ADDED_PREFIX}use_pass_normal" not in layer
    objects = layer.use_pass_cryptomatte_object or layer.use_pass_cryptomatte_asset or cryptomatte_asked_for(scene)
    surroundings = layer.use_pass_mist or layer.use_pass_ambient_occlusion
    return normals or layer.use_pass_uv or vector_pass_asked_for(scene) or objects or surroundings


def _beyond_clip_end(scene: bpy.types.Scene, eyes: Sequence[Camera], clip_end: float) -> str | None:
    """Return what may be seen beyond the camera's clip end, in words; None if there is nothing.

    With the shutter open, what is out of view may come into it, by its own motion or by the camera's. Then all counts
    that is farther away than the clip end when the shutter opens, closes, or is half way.
    """
    if scene.render.use_motion_blur and what_moves(scene):
        place = np.array(evaluated(scene.camera, scene).matrix_world.translation)
        apart = max(float(np.linalg.norm(eye.world_from_camera[:3, 3] - place)) + circle_of(eye) for eye in eyes)
        found = while_open(scene, (0.0, 0.5, 1.0), lambda: reaches_beyond(scene, clip_end - apart))
        name = next(filter(None, found), None)
    else:
        name = seen_beyond(scene, eyes, clip_end)
    return None if name is None else f"{name!r} may be seen beyond the camera's clip end"


def _is_overwritten(scene: bpy.types.Scene) -> bool:
    """Return whether curves or drivers would overwrite what is set in the scene's Cycles settings."""
    owner, animated = scene.cycles.as_pointer(), animated_values(scene)
    return any((owner, name) in animated for name in CYCLES_SETTINGS)


@contextmanager
def _in_place(scene: bpy.types.Scene, task: PackedTask, folder: Path) -> Iterator[None]:
    """Have a sheet before the scene's camera that sends the packed picture's rays on, for the time of a `with` block;
    what it sets of the scene and of its camera is restored afterwards, also after an error. The sheet itself stays in
    the working scene, with its mesh, its material and the images of its tables (see portal_sheet.py). The folder takes
    the tables.
    """
    place = place_of(task)
    pixel_filter, cycles = scene.cycles.pixel_filter_type, scene.cycles
    support = filter_support(pixel_filter, cycles.filter_width)
    jitter = 1.0 if pixel_filter == "BOX" else TUNING.jitter_pixels
    sheet = SheetRays(
        kind=kind_of(task.rendered),
        size=(task.packing.width, task.packing.height),
        step=packed_step(task),
        depth=place.depth,
        widening=support / jitter,
    )
    views = _view_rays(scene, task, place)
    tables = _write_tables(scene, task, sheet, folder)
    # As wide as the scene's own, and of its kind: so much of a pixel is so much of the scene's filter.
    narrow = {"filter_width": cycles.filter_width * jitter / support}
    # The sheet is a transparent surface more.
    bounces = {name: getattr(cycles, name) + 1 for name in CYCLES_SETTINGS[1:]}
    layer = rendered_layer(scene)
    seen = max(layer.pass_alpha_threshold, TUNING.min_pass_alpha_threshold)
    with ExitStack() as restored:
        restored.enter_context(changed(layer, pass_alpha_threshold=seen))
        packed = restored.enter_context(lens_to_set(scene))
        restored.enter_context(packed_resolution(scene, task.packing, aspect=sheet.step[1] / sheet.step[0]))
        restored.enter_context(changed(cycles, **narrow, **bounces))
        restored.enter_context(without_shifts(packed))
        restored.enter_context(without_offset(packed))
        restored.enter_context(_set_camera(packed, sheet, place))
        build_material(put_sheet(scene, task, sheet, place), sheet, views, tables)
        yield


def _view_rays(scene: bpy.types.Scene, task: PackedTask, place: SheetPlace) -> ViewRays | PanoramaRays:
    """Return what the sheet's material needs to know of the views and their lens, with the sheet at this place."""
    if not is_planar(task.rendered):
        shared = shared_rays(scene, task, sheet_from_camera(task.rendered))
        # A plane before a perspective camera may stand beside the eye.
        may_meet = shared.by_plane or bool(task.others)
        return PanoramaRays(shared, shared.aperture / place.lens_radius, may_meet)
    return ViewRays(
        step=pixel_size(task.rendered),
        focus=focus_distance_of(scene, task.rendered),
        lens=aperture_radius(evaluated(scene.camera, scene).data) / place.lens_radius,
        near_clip=task.clip_start,
        count=1 + len(task.others),
    )


def _write_tables(scene: bpy.types.Scene, task: PackedTask, sheet: SheetRays, folder: Path) -> list[Path]:
    """Write the table of the packed pixels into the folder, and that of the other views if the picture has pixels of
    any planar ones. Return their files.
    """
    tables = [folder / "pixels.exr"]
    if not is_planar(task.rendered):
        width, height = sheet.size
        texels = ray_texels(task, sheet_from_camera(task.rendered), count=width * height)
        write_table(tables[0], np.moveaxis(texels.reshape(4, height, width * TEXELS), 0, -1))
        return tables
    write_table(tables[0], _pixels_table(task, sheet.widening))
    if task.others:
        tables.append(folder / "views.exr")
        write_table(tables[1], _views_table(scene, task))
    return tables


@contextmanager
def _set_camera(packed: bpy.types.Camera, sheet: SheetRays, place: SheetPlace) -> Iterator[None]:
    """Have the lens `packed` look at the sheet, for the time of a `with` block."""
    width = sheet.size[0] * sheet.step[0]
    focus = TUNING.focus_lens_radii * place.lens_radius
    if sheet.kind == "ORTHO":
        view, diameter, focus = {"ortho_scale": width}, 1.0, place.depth
    elif sheet.kind == "PANO":
        view, diameter = _equirectangular(sheet), packed.lens * 1e-3
    else:
        # Blender takes no lens of less than 1 mm.
        sensor = max(TUNING.sensor_mm, width)
        view, diameter = {"sensor_width": sensor, "lens": sensor / width}, sensor / width * 1e-3
    stop = {"aperture_fstop": diameter / (2.0 * place.lens_radius), "focus_distance": focus, "focus_object": None}
    with (
        changed(packed, sensor_fit="HORIZONTAL", clip_start=place.near_clip, **view),
        changed(packed.dof, **(stop if packed.dof.use_dof else {})),
    ):
        yield


def _equirectangular(sheet: SheetRays) -> dict[str, object]:
    """Return the settings of a panorama that looks at the sheet, to the camera's right."""
    half_width, half_height = (0.5 * count * step for count, step in zip(sheet.size, sheet.step, strict=True))
    middle = 0.5 * math.pi
    return {
        "panorama_type": "EQUIRECTANGULAR",
        "longitude_min": middle - half_width,
        "longitude_max": middle + half_width,
        "latitude_min": -half_height,
        "latitude_max": half_height,
    }


def _pixels_table(task: PackedTask, widening: float) -> NDArray[np.float32]:
    """Return the pixels' table (height, width, 4) that `build_material` takes; widening is as in `SheetRays`."""
    packing = task.packing
    table = np.full((packing.height * packing.width, 4), -1.0, np.float32)
    number = 0
    for pixels, at in zip(task.views, packing.at, strict=True):
        own = pixels.camera is task.rendered
        number += not own
        x, y = on_plane(pixels)
        across, up = pixel_size(pixels.camera)
        table[at, 0], table[at, 1] = x / across - 0.5 * widening, y / up - 0.5 * widening
        table[at, 2] = 0 if own else number
    table[:, 3] = 1.0
    return table.reshape(packing.height, packing.width, 4)


def _views_table(scene: bpy.types.Scene, task: PackedTask) -> NDArray[np.float32]:
    """Return the views' table (VIEW_ROWS, views, 4) that `build_material` takes."""
    cameras = [task.rendered, *task.others]
    table = np.ones((VIEW_ROWS, len(cameras), 4), np.float32)
    for number, camera in enumerate(cameras):
        pose = target_from_source(camera, task.rendered)
        across, up = pixel_size(camera)
        table[0, number, :3] = pose[:3, 0] * across
        table[1, number, :3] = pose[:3, 1] * up
        table[2, number, :3] = -pose[:3, 2]
        table[3, number, :3] = pose[:3, 3]
        table[4, number, :3] = focus_distance_of(scene, camera), 1.0 / across, 1.0 / up
    return table


PORTAL_CAMERA = PackedCamera(
    name="portal",
    label="Ray Portal",
    clips_by_distance=False,
    blocker=_blocker,
    settings=SETTINGS,
    in_place=_in_place,
    as_plain=as_plain,
)
"""The packed camera by a Ray Portal."""

PANORAMA_PORTAL_CAMERA = replace(
    PORTAL_CAMERA,
    blocker=_panorama_blocker,
    settings=SETTINGS | {f"camera.data.{name}" for name in PANORAMA_SETTINGS},
    as_plain=panorama_as_plain,
    costs_key="portal-rays",
)
"""The packed camera of panoramas by a Ray Portal."""
