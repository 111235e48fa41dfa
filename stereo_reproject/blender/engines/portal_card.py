"""The portal's card in a working scene: made once, put before the camera for each trace, and hidden from all else."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping

import bpy
import numpy as np
from mathutils import Matrix

from ...views.camera import Camera
from ...views.frustum import Frustum, Lens
from ..scene.motion import BLUR_SETTINGS
from ..scene.rig import camera_from_eye
from ..scene.working import KEPT_OBJECT, evaluated
from .packed_camera import PackedTask
from .portal_geometry import CardPlace
from .portal_material import CardRays

CARD_NAME = "Stereo Reproject portal"
"""Name of the card's object, mesh and material; Blender may add a number."""


def put_card(scene: bpy.types.Scene, task: PackedTask, rays: CardRays, place: CardPlace) -> bpy.types.Material:
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
    for name in BLUR_SETTINGS:
        value = getattr(scene.camera.cycles, name)
        if getattr(card.cycles, name) != value:
            setattr(card.cycles, name, value)


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
