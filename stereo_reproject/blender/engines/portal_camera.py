"""The packed camera without OSL: a plain camera looks at a card, and a Ray Portal sends its rays on (see
portal_material.py). It works on every device.

The packed camera is the rendered view's own, with another piece of the view plane: pixels as large as the view's, as
many as the packed picture has. What Cycles derives from the camera (depth, mist, motion in pixels, camera coordinates
in shaders, the footprint of a pixel) so stays that of the view. The card stands between the camera's place and its
near clip, where no ray of the view comes.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix
from numpy.typing import NDArray

from ...images.exr import write_table
from ...images.passes import DEPTH_PASS, VECTOR_PASS, Passes
from ...trace.packing import Packing
from ...trace.pixel_filter import filter_support
from ...views.camera import Camera, OrthographicCamera
from ..scene.effects import uses_output
from ..scene.rig import camera_from_eye
from ..scene.visible import aperture_radius
from ..scene.working import changed, evaluated, rendered_layer
from .packed_camera import PackedCamera, PackedTask, lens_to_set, packed_resolution, without_shifts
from .packed_views import POSITION, PackedPixels, focus_distance_of, pose_in, seen_from_view
from .portal_material import VIEW_ROWS, CardRays, build_material

CARD_NAME = "Stereo Reproject portal"
"""Name of the card's object, mesh and material."""

MAX_JITTER_PIXELS = 0.9
"""Part of a packed pixel, along its side, in which rays are shot: rounding cannot bring them into the next pixel. A box
filter has no width that can be set, and fills the pixel."""

SENSOR_MM = 8.0
"""Width of the packed camera's sensor: with the usual focal lengths, few pixels are as wide."""

DEPTH_SHARE = 1.0 / 64.0
"""Depth of the card over that of the near clip: the closer to the camera, the less can stand in front of it."""

LEAST_DEPTH_ROUNDINGS = 12
"""Least depth of the card, over what coordinates of the camera's place are rounded by."""

LENS_ROUNDINGS = 4096
"""Least radius of the packed camera's aperture, over the same: places on it are told apart by so much."""

MIN_CLIP = 1e-6
"""Smallest near clip that Blender takes, in scene units."""

FOCUS_RADII = 1e7
"""Depth in focus of the packed perspective camera over the radius of its aperture: it is as good as endless."""

CAMERA_SETTINGS = ("shift_x", "shift_y", "stereo.convergence_mode", "sensor_fit", "sensor_width", "lens", "clip_start")
DOF_SETTINGS = ("aperture_fstop", "focus_distance", "focus_object")
SETTINGS = frozenset(
    (
        *(f"camera.data.{name}" for name in (*CAMERA_SETTINGS, "ortho_scale")),
        *(f"camera.data.dof.{name}" for name in DOF_SETTINGS),
        *(f"cycles.{name}" for name in ("filter_width", "transparent_max_bounces", "min_transparent_bounces")),
    )
)
"""Paths from the scene of what only this packed camera sets."""


@dataclass(frozen=True)
class CardPlace:
    """Place of the card before the packed camera, in scene units: its depth, the camera's near clip, and the radius of
    its aperture where it has one."""

    depth: float
    near_clip: float
    lens_radius: float


def _blocker(scene: bpy.types.Scene, eyes: Iterable[Camera], deepest: float) -> str | None:
    """Return why a portal cannot send on the rays of these views, as `PackedCamera.blocker` says."""
    layer = rendered_layer(scene)
    follows = getattr(layer.cycles, "denoising_pass_follow_reflections", True)
    clip_start = evaluated(scene.camera, scene).data.clip_start
    checks = {
        "a material override would replace the portal's material": layer.material_override is not None,
        "the view layer shows no surfaces": not layer.use_solid,
        "a shader counts transparent surfaces, and the portal is one": uses_output(
            "ShaderNodeLightPath", "Transparent Depth"
        ),
        "the scene's texture limit would scale the portal's table": scene.render.use_simplify
        and scene.cycles.texture_limit_render != "OFF",
        "passes take surfaces of any transparency, and the portal is one": layer.pass_alpha_threshold == 0.0,
        "denoising passes that do not follow reflections would show the portal": not follows,
        "the near clip is too close to the camera, so far from the world's origin": any(
            _card_place(eye, clip_start) is None for eye in eyes
        ),
    }
    return next((reason for reason, blocks in checks.items() if blocks), None)


def _card_place(camera: Camera, clip_start: float) -> CardPlace | None:
    """Return where the card stands before a camera with this near clip; None where there is no room for it."""
    rounding = float(np.spacing(np.float32(np.abs(camera.world_from_camera[:3, 3]).max())))
    least = max(LEAST_DEPTH_ROUNDINGS * rounding, 2.0 * MIN_CLIP)
    depth = max(DEPTH_SHARE * clip_start, least)
    if depth > 0.5 * clip_start:
        return None
    return CardPlace(depth, 0.5 * depth, max(depth, LENS_ROUNDINGS * rounding))


@contextmanager
def _in_place(scene: bpy.types.Scene, task: PackedTask, folder: Path) -> Iterator[None]:
    """Have a card before the scene's camera that sends the packed picture's rays on, for the time of a `with` block;
    all is restored afterwards, also after an error. The folder takes the tables.
    """
    place = _card_place(task.rendered, evaluated(scene.camera, scene).data.clip_start)
    assert place is not None
    pixel_filter, cycles = scene.cycles.pixel_filter_type, scene.cycles
    support = filter_support(pixel_filter, cycles.filter_width)
    jitter = 1.0 if pixel_filter == "BOX" else MAX_JITTER_PIXELS
    step = _packed_step(task)
    lens = evaluated(scene.camera, scene).data
    aperture = aperture_radius(lens)
    rays = CardRays(
        orthographic=isinstance(task.rendered, OrthographicCamera),
        size=(task.packing.width, task.packing.height),
        step=step,
        depth=place.depth,
        widening=support / jitter,
        lens=aperture / place.lens_radius,
        near_clip=lens.clip_start,
        views=len(_cameras(task)),
    )
    tables = folder / "pixels.exr", folder / "views.exr"
    write_table(tables[0], _pixels_table(task))
    write_table(tables[1], _views_table(scene, task))
    # As wide as the scene's own, and of its kind: so much of a pixel is so much of the scene's filter.
    narrow = {"filter_width": cycles.filter_width * jitter / support}
    bounces = {
        name: getattr(cycles, name) + 1 for name in ("transparent_max_bounces", "min_transparent_bounces")
    }
    with ExitStack() as restored:
        packed = restored.enter_context(lens_to_set(scene))
        restored.enter_context(packed_resolution(scene, task.packing, aspect=step[1] / step[0]))
        restored.enter_context(changed(cycles, **narrow, **bounces))
        restored.enter_context(without_shifts(packed))
        restored.enter_context(_set_camera(packed, rays, place))
        restored.enter_context(_card(scene, task, rays, place, tables))
        yield


@contextmanager
def _set_camera(packed: bpy.types.Camera, rays: CardRays, place: CardPlace) -> Iterator[None]:
    """Have the lens `packed` look at the card, for the time of a `with` block."""
    width = rays.size[0] * rays.step[0]
    if rays.orthographic:
        view = {"ortho_scale": width}
        diameter, focus = 1.0, place.depth
    else:
        view = {"sensor_width": SENSOR_MM, "lens": SENSOR_MM / width}
        diameter, focus = SENSOR_MM / width * 1e-3, FOCUS_RADII * place.lens_radius
    stop = {"aperture_fstop": diameter / (2.0 * place.lens_radius), "focus_distance": focus, "focus_object": None}
    with (
        changed(packed, sensor_fit="HORIZONTAL", clip_start=place.near_clip, **view),
        changed(packed.dof, **(stop if packed.dof.use_dof else {})),
    ):
        yield


@contextmanager
def _card(
    scene: bpy.types.Scene, task: PackedTask, rays: CardRays, place: CardPlace, tables: tuple[Path, Path]
) -> Iterator[None]:
    """Have the card in a scene, for the time of a `with` block; it is removed afterwards, also after an error. tables
    are the files of the pixels' and of the views' table.
    """
    images = [bpy.data.images.load(str(table)) for table in tables]
    mesh = bpy.data.meshes.new(CARD_NAME)
    material = bpy.data.materials.new(CARD_NAME)
    card = bpy.data.objects.new(CARD_NAME, mesh)
    try:
        for image in images:
            image.colorspace_settings.name = "Non-Color"
        _build_mesh(mesh, rays, place, evaluated(scene.camera, scene).data)
        build_material(material, rays, images[0], images[1])
        mesh.materials.append(material)
        _hang_on_camera(card, scene, task.view)
        scene.collection.objects.link(card)
        yield
    finally:
        bpy.data.objects.remove(card)
        bpy.data.meshes.remove(mesh)
        bpy.data.materials.remove(material)
        for image in images:
            bpy.data.images.remove(image)
        # Else Blender crashes when it lists what the scene shows: the card that it has evaluated is gone. And
        # scene.view_layers.update() passes over a scene that no window shows.
        rendered_layer(scene).update()


def _build_mesh(mesh: bpy.types.Mesh, rays: CardRays, place: CardPlace, lens: bpy.types.Camera) -> None:
    """Build the card's mesh: somewhat more than what the packed camera sees of the plane at the card's depth."""
    scale = 1.0 if rays.orthographic else place.depth
    margin = 2.0 * place.lens_radius / min(lens.dof.aperture_ratio, 1.0)
    across, up = (0.5 * side * step * scale + margin for side, step in zip(rays.size, rays.step, strict=True))
    corners = [(-across, -up), (across, -up), (across, up), (-across, up)]
    mesh.from_pydata([(x, y, -place.depth) for x, y in corners], [], [(0, 1, 2, 3)])


def _hang_on_camera(card: bpy.types.Object, scene: bpy.types.Scene, view: str) -> None:
    """Hang the card on the camera, so that its space is the view's camera space at any time while the shutter is open,
    and show it to camera rays alone.
    """
    camera = evaluated(scene.camera, scene)
    card.parent = scene.camera
    scale = Matrix.Diagonal((*camera.matrix_world.to_scale(), 1.0))
    card.matrix_parent_inverse = scale.inverted()
    card.matrix_basis = Matrix(camera_from_eye(camera.data, view).tolist())
    card.cycles.motion_steps = scene.camera.cycles.motion_steps
    for kind in ("diffuse", "glossy", "transmission", "volume_scatter", "shadow"):
        setattr(card, f"visible_{kind}", False)


# The tables


def _cameras(task: PackedTask) -> list[Camera]:
    """Return the cameras of the views' table: the rendered one, and all others."""
    return [task.rendered, *task.others]


def _steps(camera: Camera) -> tuple[float, float]:
    """Return the width and the height of a camera's pixel on its view plane."""
    plane = camera.plane
    return (plane.right - plane.left) / camera.width, (plane.top - plane.bottom) / camera.height


def _pixels_table(task: PackedTask) -> NDArray[np.float32]:
    """Return the pixels' table (height, width, 4) that `build_material` takes."""
    packing = task.packing
    table = np.full((packing.height * packing.width, 4), -1.0, np.float32)
    number = 0
    for pixels, at in zip(task.views, packing.at, strict=True):
        own = pixels.camera is task.rendered
        number += not own
        x, y = _on_plane(pixels)
        across, up = _steps(pixels.camera)
        table[at, 0], table[at, 1] = x / across, y / up
        table[at, 2] = 0 if own else number
    table[:, 3] = 1.0
    return table.reshape(packing.height, packing.width, 4)


def _on_plane(pixels: PackedPixels) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return x and y (N,) of the pixels' centres on their camera's view plane."""
    camera, plane = pixels.camera, pixels.camera.plane
    across, up = _steps(camera)
    return plane.left + (pixels.places[:, 1] + 0.5) * across, plane.top - (pixels.places[:, 0] + 0.5) * up


def _views_table(scene: bpy.types.Scene, task: PackedTask) -> NDArray[np.float32]:
    """Return the views' table (VIEW_ROWS, views, 4) that `build_material` takes."""
    cameras = _cameras(task)
    table = np.ones((VIEW_ROWS, len(cameras), 4), np.float32)
    for number, camera in enumerate(cameras):
        pose = pose_in(camera, task.rendered)
        across, up = _steps(camera)
        table[0, number, :3] = pose[:3, 0] * across
        table[1, number, :3] = pose[:3, 1] * up
        table[2, number, :3] = -pose[:3, 2]
        table[3, number, :3] = pose[:3, 3]
        table[4, number, :3] = focus_distance_of(scene, camera), 1.0 / across, 1.0 / up
    return table


def _packed_step(task: PackedTask) -> tuple[float, float]:
    """Return the width and the height of a packed pixel on the packed camera's plane: those of the rendered view's
    pixels, times how much wider the views' pixels are seen than those in the middle of its picture.
    """
    across, up = _steps(task.rendered)
    if isinstance(task.rendered, OrthographicCamera):
        return across, up
    packing = task.packing
    wanted = np.concatenate([_spread(*_on_plane(pixels), *_steps(pixels.camera)) for pixels in task.views])
    x, y = np.meshgrid(
        (np.arange(packing.width) + 0.5 - 0.5 * packing.width) * across,
        (np.arange(packing.height) + 0.5 - 0.5 * packing.height) * up,
    )
    share = float(np.mean(wanted) / np.mean(_spread(x, y, across, up))) if wanted.size else 1.0
    return across * share, up * share


def _spread(x: NDArray, y: NDArray, across: float, up: float) -> NDArray[np.float64]:
    """Return how far apart the directions of neighbouring pixels are, at places x, y on a plane at unit depth, on which
    pixels are `across` wide and `up` high: the mean of both sides, as Cycles spreads its rays (`camera_sample`).
    """
    squared = 1.0 + x**2 + y**2
    return 0.5 * (across * np.sqrt(1.0 + y**2) + up * np.sqrt(1.0 + x**2)) / squared


# The passes


def _as_plain(flat: Passes, task: PackedTask, pixels: PackedPixels) -> Passes:
    """Return the passes (N, C) of one view's pixels as a plain camera has them.

    Where a ray meets nothing behind the card, Cycles leaves depth and place of the card itself.
    """
    passes = dict(flat)
    return passes if pixels.camera is task.rendered else seen_from_view(passes, task.rendered, pixels)


PORTAL_CAMERA = PackedCamera("portal", _blocker, SETTINGS, _in_place, _as_plain)
"""The packed camera by a Ray Portal."""
