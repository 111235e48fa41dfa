"""Views of a packed render that are not the one that Blender renders: their rays, and their passes.

Cycles has one camera. A ray of another view is given in that camera's space, so whatever Cycles tells in world space
is right as it is; what it tells in the camera's own is converted here.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import bpy
import numpy as np
from numpy.typing import NDArray

from ...images.passes import DEPTH_PASS, Passes
from ...views.camera import Camera, pixel_size, planar, target_from_source
from ...views.panorama import PanoramicCamera
from ..scene.visible import aperture_radius
from ..scene.working import evaluated, rendered_layer
from .denoise import NORMAL

POSITION = "Position"
"""Blender's pass of places in the world, from which depths of other views are derived."""

ADDED_POSITIONS = "stereo_reproject_added_positions"
"""Property of a working scene's layer that tells that its Position pass was not asked for."""

FORWARD = np.diag([1.0, 1.0, -1.0, 1.0])
"""Blender's camera space from Cycles', which looks along +z."""


@dataclass(frozen=True)
class PackedPixels:
    """Pixels of one view to be traced packed: the view's camera, and places (N, 2), their rows and columns. A pixel may
    be there twice, to be traced twice.
    """

    camera: Camera
    places: NDArray[np.intp]


def numbers_of_others(scene: bpy.types.Scene, rendered: Camera, others: Sequence[Camera]) -> tuple[float, ...]:
    """Return the numbers by which the shader knows the views that Blender does not render, 17 for each.

    They are: left and top of the view plane, and a pixel's width and height on it, at unit depth; the depth in focus,
    in scene units; and three rows of four of the transform from the view's camera space to the rendered view's.
    """
    numbers: list[float] = []
    for camera in others:
        plane = planar(camera).plane
        pose = FORWARD @ target_from_source(camera, rendered) @ FORWARD
        numbers += [plane.left, plane.top, *pixel_size(camera), focus_distance_of(scene, camera), *pose[:3].ravel()]
    return tuple(float(number) for number in numbers)


def focus_distance_of(scene: bpy.types.Scene, camera: Camera) -> float:
    """Return the depth at which a view of the scene is in focus, in scene units. With a focus object, it is that
    object's depth in this view, as Cycles has it.
    """
    dof = evaluated(scene.camera, scene).data.dof
    if dof.focus_object is None:
        return max(dof.focus_distance, 1e-5)
    focus = evaluated(dof.focus_object, scene)
    place = focus.matrix_world
    if dof.focus_subtarget and focus.pose is not None and dof.focus_subtarget in focus.pose.bones:
        place = place @ focus.pose.bones[dof.focus_subtarget].matrix
    ahead, position = camera.world_from_camera[:3, 2], camera.world_from_camera[:3, 3]
    return max(abs(float(ahead @ (position - np.array(place.translation)))), 1e-5)


def switch_on_positions(scene: bpy.types.Scene) -> None:
    """Have a working scene rendered with the Position pass, from now on. It stays on, since Cycles would begin anew
    with other passes; `without_added_positions` takes it out of renders that the user did not want it in.
    """
    layer = rendered_layer(scene)
    if not layer.use_pass_position:
        layer[ADDED_POSITIONS] = True
        layer.use_pass_position = True


def without_added_positions(scene: bpy.types.Scene, passes: Passes) -> Passes:
    """Return a render's passes without the Position pass, unless the user has asked for it."""
    if ADDED_POSITIONS not in rendered_layer(scene):
        return passes
    return {name: image for name, image in passes.items() if name != POSITION}


def seen_from_view(flat: Passes, rendered: Camera, pixels: PackedPixels) -> Passes:
    """Return the passes (N, C) of a packed render as a plain render of the view of `pixels` would have them. rendered
    is the camera that Cycles rendered with.

    Only depth and the denoiser's normals, which are in camera space, are converted. Depth is that of the pixel's first
    ray alone, whose place in the world the Position pass has.
    """
    converted = dict(flat)
    camera = pixels.camera
    if DEPTH_PASS in flat:
        place = flat[POSITION].astype(np.float64) - camera.world_from_camera[:3, 3]
        ahead = -place @ np.linalg.inv(camera.world_from_camera[:3, :3])[2]
        known = np.isfinite(flat[DEPTH_PASS])
        converted[DEPTH_PASS] = np.where(known, ahead[:, None], flat[DEPTH_PASS]).astype(np.float32)
    if NORMAL in flat:
        turn = (FORWARD @ target_from_source(rendered, camera) @ FORWARD)[:3, :3]
        converted[NORMAL] = (flat[NORMAL] @ turn.T).astype(np.float32)
    return converted


def may_begin_in(scene: bpy.types.Scene, boxes: Sequence[NDArray[np.float64]], views: Iterable[Camera]) -> bool:
    """Return whether rays of any of the views may begin in one of the boxes (8, 3) of a working scene. An infinite box
    may be anywhere. Boxes count as large as those around them along the world's axes. Rays of spherical stereo begin on
    a circle around the camera.
    """
    camera = evaluated(scene.camera, scene).data
    reach = camera.clip_start + aperture_radius(camera) / min(camera.dof.aperture_ratio, 1.0)
    places = [(view.world_from_camera[:3, 3], reach + circle_of(view)) for view in views]
    return any(
        not np.isfinite(box).all()
        or any(
            bool(np.all((box.min(axis=0) - around <= place) & (place <= box.max(axis=0) + around)))
            for place, around in places
        )
        for box in boxes
    )


def circle_of(view: Camera) -> float:
    """Return the distance from the camera at which the rays of a view begin."""
    stereo = view.stereo if isinstance(view, PanoramicCamera) else None
    return 0.0 if stereo is None else abs(stereo.offset)


def surely_inside(camera: Camera, boxes: Sequence[NDArray[np.float64]]) -> bool:
    """Return whether the camera is certainly in one of these boxes (8, 3); an infinite box tells nothing."""
    place = camera.world_from_camera[:3, 3]
    finite = (box for box in boxes if np.isfinite(box).all())
    return any(bool(np.all((box.min(axis=0) < place) & (place < box.max(axis=0)))) for box in finite)
