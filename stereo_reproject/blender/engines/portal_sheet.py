"""The portal's sheet in a working scene: made once, put before the camera for each trace, and hidden from all else."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping

import bpy
import numpy as np
from mathutils import Matrix

from ...views.camera import Camera, planar
from ...views.frustum import Frustum, Lens
from ...views.panorama import PanoramicCamera
from ..scene.motion import BLUR_SETTINGS
from ..scene.rig import camera_from_eye
from ..scene.working import KEPT_OBJECT, evaluated
from .packed_camera import PackedTask
from .portal_geometry import SheetPlace, SheetRays, sheet_from_camera
from .tuning import TUNING

SHEET_NAME = "Stereo Reproject portal"
"""Name of the sheet's object, mesh and material; Blender may add a number."""


def put_sheet(scene: bpy.types.Scene, task: PackedTask, rays: SheetRays, place: SheetPlace) -> bpy.types.Material:
    """Put the sheet of a working scene before its camera, and return its material. It is made where there is none yet,
    and stays: no plain render shows it, since it is before the near clip and only camera rays see it.
    """
    eye, lens = scene.camera, evaluated(scene.camera, scene).data
    sheet = bpy.data.objects.get(eye.get(KEPT_OBJECT, "")) or _new_sheet(eye)
    if scene.collection.objects.get(sheet.name) is None:
        scene.collection.objects.link(sheet)
    mesh: bpy.types.Mesh = sheet.data  # pyright: ignore[reportAssignmentType] - the sheet's is one
    corners = _corners(task.rendered, rays, place, lens)
    # Where a mesh or an object changes, Cycles builds what finds it, and all others, again.
    if [tuple(vertex.co) for vertex in mesh.vertices] != corners:
        mesh.clear_geometry()
        mesh.from_pydata(corners, [], [(0, 1, 2, 3)])
    _put_before_camera(sheet, scene, task)
    material = mesh.materials[0]
    assert material is not None
    return material


def _new_sheet(eye: bpy.types.Object) -> bpy.types.Object:
    """Return a new sheet, without faces, that hangs on a working camera and is shown to camera rays alone."""
    mesh, material = bpy.data.meshes.new(SHEET_NAME), bpy.data.materials.new(SHEET_NAME)
    sheet = bpy.data.objects.new(SHEET_NAME, mesh)
    for block in (sheet, mesh, material):
        block[KEPT_OBJECT] = True
    eye[KEPT_OBJECT] = sheet.name
    if material.node_tree is None:
        material.use_nodes = True
    material.node_tree.nodes.clear()
    mesh.materials.append(material)
    sheet.parent = eye
    for kind in ("diffuse", "glossy", "transmission", "volume_scatter", "shadow"):
        setattr(sheet, f"visible_{kind}", False)
    return sheet


def _corners(
    camera: Camera, rays: SheetRays, place: SheetPlace, lens: bpy.types.Camera
) -> list[tuple[float, float, float]]:
    """Return the corners of the sheet: somewhat more than what the packed camera, or the view's own, sees of the plane
    at the sheet's depth. Sides are powers of two, so that they seldom change.
    """
    margin = 2.0 * place.lens_radius / min(lens.dof.aperture_ratio, 1.0)
    across, up = (float(np.float32(2.0 ** np.ceil(np.log2(half + margin)))) for half in _halves(camera, rays, place))
    depth = float(np.float32(place.depth))
    return [(-across, -up, -depth), (across, -up, -depth), (across, up, -depth), (-across, up, -depth)]


def _halves(camera: Camera, rays: SheetRays, place: SheetPlace) -> tuple[float, float]:
    """Return half of the width and of the height of what is seen of the plane at the sheet's depth, in scene units."""
    if rays.kind == "PANO":
        across = math.tan(TUNING.panorama_half_angle_radians) * place.depth
        return 2.0 * across, 2.0 * across / math.cos(TUNING.panorama_half_angle_radians)
    # The window of a perspective camera with spherical stereo is its view plane.
    plane = camera.window if isinstance(camera, PanoramicCamera) else planar(camera).plane
    scale = 1.0 if rays.kind == "ORTHO" else place.depth
    views = max(-plane.left, plane.right), max(-plane.bottom, plane.top)
    across, up = (
        max(0.5 * side * step, view) * scale for side, step, view in zip(rays.size, rays.step, views, strict=True)
    )
    return across, up


def _put_before_camera(sheet: bpy.types.Object, scene: bpy.types.Scene, task: PackedTask) -> None:
    """Give the sheet, which hangs on the camera, its space before the view at any time while the shutter is open."""
    camera = evaluated(scene.camera, scene)
    without_scale = Matrix.Diagonal((*camera.matrix_world.to_scale(), 1.0)).inverted()
    turn = np.eye(4)
    turn[:3, :3] = sheet_from_camera(task.rendered).T
    in_stereo = isinstance(task.rendered, PanoramicCamera) and task.rendered.stereo is not None
    eye = np.eye(4) if in_stereo else camera_from_eye(camera.data, task.view)
    from_eye = Matrix((eye @ turn).tolist())
    for name, value in (("matrix_parent_inverse", without_scale), ("matrix_basis", from_eye)):
        if getattr(sheet, name) != value:
            setattr(sheet, name, value)
    for name in BLUR_SETTINGS:
        value = getattr(scene.camera.cycles, name)
        if getattr(sheet.cycles, name) != value:
            setattr(sheet.cycles, name, value)


def hide_sheet(scene: bpy.types.Scene, cameras: Iterable[Camera]) -> None:
    """Take away the faces of a working scene's sheet, if any of the cameras might see it in a plain render."""
    sheet = bpy.data.objects.get(scene.camera.get(KEPT_OBJECT, ""))
    if sheet is None:
        return
    mesh: bpy.types.Mesh = sheet.data  # pyright: ignore[reportAssignmentType] - the sheet's is one
    if len(mesh.vertices) == 0:
        return
    places = np.empty(3 * len(mesh.vertices), np.float32)
    mesh.vertices.foreach_get("co", places)
    corners = (
        np.pad(places.reshape(-1, 3), ((0, 0), (0, 1)), constant_values=1.0)
        @ np.array(evaluated(sheet, scene).matrix_world).T
    )
    near = Lens(near=evaluated(scene.camera, scene).data.clip_start)
    if any(Frustum(camera, near).may_meet(corners[:, :3]) for camera in cameras):
        mesh.clear_geometry()


def without_sheet(texts: Mapping[str, str]) -> dict[str, str]:
    """Return the texts of a render's header without the sheet in the manifests of cryptomattes: it stays in the scene,
    and is in no picture.
    """
    if not any(SHEET_NAME in text for text in texts.values()):
        return dict(texts)
    entry = re.compile(rf'"{SHEET_NAME}(\.\d+)?":"[0-9a-f]{{8}}",?')
    kept = {key: entry.sub("", text) for key, text in texts.items()}
    return {key: text.replace(",}", "}") if text != texts[key] else text for key, text in kept.items()}
