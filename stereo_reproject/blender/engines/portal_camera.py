"""The packed camera without OSL: a plain camera looks at a card, and a Ray Portal sends its rays on (see
portal_material.py). It works on every device.

The packed camera is the rendered view's own, with another piece of the view plane: pixels as large as the view's, as
many as the packed picture has. What Cycles derives from the camera (depth, mist, motion in pixels, camera coordinates
in shaders, the footprint of a pixel) so stays that of the view. The card stands between the camera's place and its
near clip, where no ray of the view comes.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix
from numpy.typing import NDArray

from ...images.effects import Effect
from ...images.exr import write_table
from ...images.passes import DEPTH_PASS, VECTOR_PASS, Passes
from ...trace.pixel_filter import filter_support
from ...views.camera import Camera, OrthographicCamera
from ...views.frustum import Frustum, Lens
from ..scene.animated import animated_values
from ..scene.effects import shader_nodes, uses_output
from ..scene.materials import world_shading
from ..scene.rig import camera_from_eye
from ..scene.visible import aperture_radius, seen_beyond, volume_boxes
from ..scene.working import KEPT_OBJECT, changed, evaluated, rendered_layer
from .packed_camera import PackedCamera, PackedTask, compute_device, lens_to_set, packed_resolution, without_shifts
from .packed_views import POSITION, PackedPixels, focus_distance_of, may_begin_in, pose_in, seen_from_view
from .portal_material import VIEW_ROWS, CardRays, ViewRays, build_material

CARD_NAME = "Stereo Reproject portal"
"""Name of the card's object, mesh and material; Blender may add a number."""

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

MAX_SPREAD_RATIO = 1.6
"""Spread of the rays in the middle of a view over that in its corners, up to which bumps look alike: with 35 mm (1.2)
the error was 1.01 times that between two seeds, with 18 mm (1.8) 1.07 times, on a floor that was all bumps."""

CARD_REACH = 8.0
"""Distance from the camera within which all of the card lies that is seen, over its depth and the aperture's radius."""

NEWTON_STEPS = 8
"""Steps by which directions are found again from their motion in pixels; three are enough for any but fast turns."""

MEAN_LENGTH, SPECULAR_ALBEDO = "Denoising Depth", "Denoising Specular Albedo"
"""Passes in which the card counts: the length of the rays, and what is reflected sharply."""

CAMERA_SETTINGS = ("shift_x", "shift_y", "stereo.convergence_mode", "sensor_fit", "sensor_width", "lens", "clip_start")
DOF_SETTINGS = ("aperture_fstop", "focus_distance", "focus_object")
LEAST_ALPHA = 1e-6
"""Smallest alpha threshold of passes: at 0 they would show the card. Where the user has 0, what is wholly transparent
is in a plain render's passes, and not in those of traced pixels."""

VOLUMES_GUIDED_FROM_VERSION = (5, 0, 0)
"""Version of Blender from which Cycles guides how likely camera rays scatter in a volume."""

COUNTERS = ("Transparent Depth", "Portal Depth")
"""Outputs of the Light Path node that count the card; 4.5 has not the second."""

CYCLES_SETTINGS = ("filter_width", "transparent_max_bounces", "min_transparent_bounces")
SETTINGS = frozenset(
    (
        *(f"camera.data.{name}" for name in (*CAMERA_SETTINGS, "ortho_scale")),
        *(f"camera.data.dof.{name}" for name in DOF_SETTINGS),
        *(f"cycles.{name}" for name in CYCLES_SETTINGS),
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
            _card_place(eye, lens.clip_start) is None for eye in eyes
        ),
        # Rays that a portal sends on have no end, and pixels all the same width.
        "a wireframe is drawn as wide in pixels, and a portal's are all as wide": any(
            node.bl_idname == "ShaderNodeWireframe" and node.use_pixel_size for node in shader_nodes()
        ),
        "a material has bumps, and pixels of so wide a lens differ": uses_output("ShaderNodeBump", "Normal")
        and any(_spread_ratio(eye) > MAX_SPREAD_RATIO for eye in eyes),
        "a volume of the world ends at the camera's clip end": world is not None
        and bool(world_shading(world) & Effect.VOLUME),
        # Cycles guides a ray's first part in a volume, and up to the card there is next to nothing of it: more noise.
        "a view may begin in a volume": bpy.app.version >= VOLUMES_GUIDED_FROM_VERSION
        and may_begin_in(scene, volume_boxes(scene), eyes),
        "something may be seen beyond the camera's clip end": seen_beyond(scene, eyes, lens.clip_end),
    }
    return next((reason for reason, blocks in checks.items() if blocks), None)


def _spread_ratio(camera: Camera) -> float:
    """Return how much wider apart the rays of neighbouring pixels are in the middle of a view than in its corners."""
    if isinstance(camera, OrthographicCamera):
        return 1.0
    plane = camera.plane
    x, y = np.meshgrid((plane.left, 0.0, plane.right), (plane.bottom, 0.0, plane.top))
    spread = _spread(x, y, *_steps(camera))
    return float(spread.max() / spread.min())


def _is_overwritten(scene: bpy.types.Scene) -> bool:
    """Return whether curves or drivers would overwrite what is set in the scene's Cycles settings."""
    owner = scene.cycles.as_pointer()
    return any((owner, name) in animated_values(scene) for name in CYCLES_SETTINGS)


def _place_of(task: PackedTask) -> CardPlace:
    """Return where the card of a packed render stands; there is room for it."""
    place = _card_place(task.rendered, task.clip_start)
    assert place is not None
    return place


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
    place = _place_of(task)
    pixel_filter, cycles = scene.cycles.pixel_filter_type, scene.cycles
    support = filter_support(pixel_filter, cycles.filter_width)
    jitter = 1.0 if pixel_filter == "BOX" else MAX_JITTER_PIXELS
    step = _packed_step(task)
    card = CardRays(
        orthographic=isinstance(task.rendered, OrthographicCamera),
        size=(task.packing.width, task.packing.height),
        step=step,
        depth=place.depth,
        widening=support / jitter,
    )
    views = ViewRays(
        step=_steps(task.rendered),
        focus=focus_distance_of(scene, task.rendered),
        lens=aperture_radius(evaluated(scene.camera, scene).data) / place.lens_radius,
        near_clip=task.clip_start,
        count=1 + len(task.others),
    )
    tables = [folder / "pixels.exr"]
    write_table(tables[0], _pixels_table(task, card.widening))
    if task.others:
        tables.append(folder / "views.exr")
        write_table(tables[1], _views_table(scene, task))
    # As wide as the scene's own, and of its kind: so much of a pixel is so much of the scene's filter.
    narrow = {"filter_width": cycles.filter_width * jitter / support}
    # The card is a transparent surface more.
    bounces = {name: getattr(cycles, name) + 1 for name in CYCLES_SETTINGS[1:]}
    layer = rendered_layer(scene)
    seen = max(layer.pass_alpha_threshold, LEAST_ALPHA)
    with ExitStack() as restored:
        restored.enter_context(changed(layer, pass_alpha_threshold=seen))
        packed = restored.enter_context(lens_to_set(scene))
        restored.enter_context(packed_resolution(scene, task.packing, aspect=step[1] / step[0]))
        restored.enter_context(changed(cycles, **narrow, **bounces))
        restored.enter_context(without_shifts(packed))
        restored.enter_context(_set_camera(packed, card, place))
        build_material(_card(scene, task, card, place), card, views, tables)
        yield


@contextmanager
def _set_camera(packed: bpy.types.Camera, card: CardRays, place: CardPlace) -> Iterator[None]:
    """Have the lens `packed` look at the card, for the time of a `with` block."""
    width = card.size[0] * card.step[0]
    if card.orthographic:
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


def _card(scene: bpy.types.Scene, task: PackedTask, rays: CardRays, place: CardPlace) -> bpy.types.Material:
    """Put the card of a working scene before its camera, and return its material. It is made where there is none yet,
    and stays: no plain render shows it, since it is before the near clip and only camera rays see it.
    """
    eye, lens = scene.camera, evaluated(scene.camera, scene).data
    card = bpy.data.objects.get(eye.get(KEPT_OBJECT, "")) or _new_card(eye)
    if scene.collection.objects.get(card.name) is None:
        scene.collection.objects.link(card)
    mesh: bpy.types.Mesh = card.data  # pyright: ignore[reportAssignmentType] - the card's is one
    corners = _corners(task.rendered, rays, place, lens)
    # Where a mesh or an object changes, Cycles builds what finds it, and all others, again.
    if [tuple(vertex.co) for vertex in mesh.vertices] != corners:
        mesh.clear_geometry()
        mesh.from_pydata(corners, [], [(0, 1, 2, 3)])
    _put_before_camera(card, scene, task.view)
    material = mesh.materials[0]
    assert material is not None
    return material


def _new_card(eye: bpy.types.Object) -> bpy.types.Object:
    """Return a new card, without faces, that hangs on a working camera and is shown to camera rays alone."""
    mesh, material = bpy.data.meshes.new(CARD_NAME), bpy.data.materials.new(CARD_NAME)
    card = bpy.data.objects.new(CARD_NAME, mesh)
    for block in (card, mesh, material):
        block[KEPT_OBJECT] = True
    eye[KEPT_OBJECT] = card.name
    if material.node_tree is None:
        material.use_nodes = True
    material.node_tree.nodes.clear()
    mesh.materials.append(material)
    card.parent = eye
    for kind in ("diffuse", "glossy", "transmission", "volume_scatter", "shadow"):
        setattr(card, f"visible_{kind}", False)
    return card


def _corners(
    camera: Camera, rays: CardRays, place: CardPlace, lens: bpy.types.Camera
) -> list[tuple[float, float, float]]:
    """Return the corners of the card: somewhat more than what the packed camera, or the view's own, sees of the plane
    at the card's depth. Sides are powers of two, so that they seldom change.
    """
    plane, scale = camera.plane, 1.0 if rays.orthographic else place.depth
    margin = 2.0 * place.lens_radius / min(lens.dof.aperture_ratio, 1.0)
    views = max(-plane.left, plane.right), max(-plane.bottom, plane.top)
    halves = (
        max(0.5 * side * step, view) * scale + margin
        for side, step, view in zip(rays.size, rays.step, views, strict=True)
    )
    across, up = (float(np.float32(2.0 ** np.ceil(np.log2(half)))) for half in halves)
    depth = float(np.float32(place.depth))
    return [(-across, -up, -depth), (across, -up, -depth), (across, up, -depth), (-across, up, -depth)]


def _put_before_camera(card: bpy.types.Object, scene: bpy.types.Scene, view: str) -> None:
    """Give the card, which hangs on the camera, the view's camera space at any time while the shutter is open."""
    camera = evaluated(scene.camera, scene)
    without_scale = Matrix.Diagonal((*camera.matrix_world.to_scale(), 1.0)).inverted()
    from_eye = Matrix(camera_from_eye(camera.data, view).tolist())
    for name, value in (("matrix_parent_inverse", without_scale), ("matrix_basis", from_eye)):
        if getattr(card, name) != value:
            setattr(card, name, value)
    if card.cycles.motion_steps != scene.camera.cycles.motion_steps:
        card.cycles.motion_steps = scene.camera.cycles.motion_steps


def hide_card(scene: bpy.types.Scene, cameras: Iterable[Camera]) -> None:
    """Take away the faces of a working scene's card, if any of the cameras might see it in a plain render."""
    card = bpy.data.objects.get(scene.camera.get(KEPT_OBJECT, ""))
    if card is None:
        return
    mesh: bpy.types.Mesh = card.data  # pyright: ignore[reportAssignmentType] - the card's is one
    if len(mesh.vertices) == 0:
        return
    places = np.empty(3 * len(mesh.vertices), np.float32)
    mesh.vertices.foreach_get("co", places)
    corners = (
        np.pad(places.reshape(-1, 3), ((0, 0), (0, 1)), constant_values=1.0)
        @ np.array(evaluated(card, scene).matrix_world).T
    )
    near = Lens(near=evaluated(scene.camera, scene).data.clip_start)
    if any(Frustum(camera, near).may_meet(corners[:, :3]) for camera in cameras):
        mesh.clear_geometry()


def without_card(texts: Mapping[str, str]) -> dict[str, str]:
    """Return the texts of a render's header without the card in the manifests of cryptomattes: it stays in the scene,
    and is in no picture.
    """
    if not any(CARD_NAME in text for text in texts.values()):
        return dict(texts)
    entry = re.compile(rf'"{CARD_NAME}(\.\d+)?":"[0-9a-f]{{8}}",?')
    kept = {key: entry.sub("", text) for key, text in texts.items()}
    return {key: text.replace(",}", "}") if text != texts[key] else text for key, text in kept.items()}


# The tables


def _steps(camera: Camera) -> tuple[float, float]:
    """Return the width and the height of a camera's pixel on its view plane."""
    plane = camera.plane
    return (plane.right - plane.left) / camera.width, (plane.top - plane.bottom) / camera.height


def _pixels_table(task: PackedTask, widening: float) -> NDArray[np.float32]:
    """Return the pixels' table (height, width, 4) that `build_material` takes; widening is as in `CardRays`."""
    packing = task.packing
    table = np.full((packing.height * packing.width, 4), -1.0, np.float32)
    number = 0
    for pixels, at in zip(task.views, packing.at, strict=True):
        own = pixels.camera is task.rendered
        number += not own
        x, y = _on_plane(pixels)
        across, up = _steps(pixels.camera)
        table[at, 0], table[at, 1] = x / across - 0.5 * widening, y / up - 0.5 * widening
        table[at, 2] = 0 if own else number
    table[:, 3] = 1.0
    return table.reshape(packing.height, packing.width, 4)


def _on_plane(pixels: PackedPixels) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
    """Return x and y (N,) of the pixels' centres on their camera's view plane."""
    camera, plane = pixels.camera, pixels.camera.plane
    across, up = _steps(camera)
    return plane.left + (pixels.places[:, 1] + 0.5) * across, plane.top - (pixels.places[:, 0] + 0.5) * up


def _views_table(scene: bpy.types.Scene, task: PackedTask) -> NDArray[np.float32]:
    """Return the views' table (VIEW_ROWS, views, 4) that `build_material` takes."""
    cameras = [task.rendered, *task.others]
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


def _as_plain(flat: Passes, task: PackedTask, index: int) -> Passes:
    """Return the passes (N, C) of one view's pixels as `PackedCamera.as_plain` says: Cycles leaves depth and place of
    the card where a ray meets nothing behind it, and counts the way to the card and what the card lets through.
    """
    passes, pixels = dict(flat), task.views[index]
    sky = _shows_card(flat, task, own=pixels.camera is task.rendered)
    passes[DEPTH_PASS] = np.where(sky, np.float32(np.inf), flat[DEPTH_PASS])
    if POSITION in flat:
        passes[POSITION] = np.where(sky, np.float32(0.0), flat[POSITION])
    if MEAN_LENGTH in flat:
        passes[MEAN_LENGTH] = (flat[MEAN_LENGTH] - _lengths_to_card(task, index)[:, None]).astype(np.float32)
    if SPECULAR_ALBEDO in flat:
        passes[SPECULAR_ALBEDO] = flat[SPECULAR_ALBEDO] - np.float32(1.0)
    if pixels.camera is not task.rendered:
        return seen_from_view(passes, task.rendered, pixels)
    if VECTOR_PASS in flat:
        passes[VECTOR_PASS] = _motion(flat[VECTOR_PASS], task, pixels, sky[:, 0])
    return passes


def _shows_card(flat: Passes, task: PackedTask, *, own: bool) -> NDArray[np.bool_]:
    """Return where (N, 1) depth and place are the card's: nothing of the rendered view is so near, and of another view
    (not `own`) nothing is in that place.
    """
    place = _place_of(task)
    near = np.abs(flat[DEPTH_PASS] - place.depth) < 0.5 * place.depth
    if own:
        return near
    away = np.linalg.norm(flat[POSITION] - task.rendered.world_from_camera[:3, 3], axis=-1, keepdims=True)
    return near & (away < CARD_REACH * (place.depth + place.lens_radius))


def _lengths_to_card(task: PackedTask, index: int) -> NDArray[np.float64]:
    """Return the lengths (N,) of the rays of one view's pixels from the packed camera's near clip to the card."""
    place, packing = _place_of(task), task.packing
    length = place.depth - place.near_clip
    if isinstance(task.rendered, OrthographicCamera):
        return np.full(len(packing.at[index]), length)
    row, column = np.divmod(packing.at[index], packing.width)
    across, up = _packed_step(task)
    x, y = (column + 0.5 - 0.5 * packing.width) * across, (row + 0.5 - 0.5 * packing.height) * up
    return length * np.sqrt(1.0 + x**2 + y**2)


def _motion(
    vectors: NDArray[np.float32], task: PackedTask, pixels: PackedPixels, sky: NDArray[np.bool_]
) -> NDArray[np.float32]:
    """Return motion vectors (N, 4) in pixels of the rendered view, from those in packed pixels. sky (N,) are pixels of
    what is endlessly far.
    """
    (across, up), (packed_across, packed_up) = _steps(task.rendered), _packed_step(task)
    converted = vectors * np.float32(packed_across / across)
    if isinstance(task.rendered, OrthographicCamera) or not sky.any():
        return converted
    plane, region, packing = task.rendered.plane, task.region, task.packing
    x, y = (place[sky] for place in _on_plane(pixels))
    ahead = np.stack([x, y, np.ones_like(x)], axis=-1)
    ahead /= np.linalg.norm(ahead, axis=-1, keepdims=True)
    packed = _Raster(1.0 / packed_across, 1.0 / packed_up, 0.5 * packing.width, 0.5 * packing.height)
    below = region.full_height - region.top - region.height
    whole = _Raster(1.0 / across, 1.0 / up, region.left - plane.left / across, below - plane.bottom / up)
    before, after = (packed.turn(ahead, part) for part in (vectors[sky, :2], -vectors[sky, 2:]))
    converted[sky] = np.concatenate([whole.moved(before), -whole.moved(after)], axis=-1)
    return converted


@dataclass(frozen=True)
class _Raster:
    """A picture's pixels, counted from its lower left corner, as Cycles has them for directions: per unit across and
    up, and where the direction straight ahead is."""

    per_x: float
    per_y: float
    middle_x: float
    middle_y: float

    def moved(self, change: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return how many pixels (N, 2) a direction that changes by so much (N, 3) moves. Cycles leaves out the
        division by depth.
        """
        x, y, z = change.T
        return np.stack([self.per_x * x + self.middle_x * z, self.per_y * y + self.middle_y * z], axis=-1)

    def turn(self, ahead: NDArray[np.float64], moved: NDArray[np.float32]) -> NDArray[np.float64]:
        """Return by how much (N, 3) unit directions `ahead` (N, 3) change that move by so many pixels (N, 2), and stay
        unit directions: the inverse of `moved`, by Newton's method.
        """
        change = np.zeros_like(ahead)
        slope = np.array([-self.middle_x / self.per_x, -self.middle_y / self.per_y, 1.0])
        start = np.concatenate([moved / np.array([self.per_x, self.per_y]), np.zeros((len(moved), 1))], axis=-1)
        for _ in range(NEWTON_STEPS):
            change = start + change[:, 2:] * slope
            off = ((ahead + change) ** 2).sum(axis=-1) - 1.0
            per_depth = 2.0 * ((ahead + change) * slope).sum(axis=-1)
            change[:, 2] -= off / np.where(per_depth == 0.0, 1.0, per_depth)
        return start + change[:, 2:] * slope


PORTAL_CAMERA = PackedCamera(
    name="portal",
    clips_by_distance=False,
    blocker=_blocker,
    settings=SETTINGS,
    in_place=_in_place,
    as_plain=_as_plain,
)
"""The packed camera by a Ray Portal."""
