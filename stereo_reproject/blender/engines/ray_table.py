"""The rays of packed pixels of panoramas, for the shaders of both packed cameras: a table, and what all rays share.

Within a pixel, the directions in which the camera alone would look change evenly enough to be interpolated: the table
has the one at the pixel's centre, and its change per pixel to the right and per pixel down. A shader makes the eye's
ray of it as Cycles does (`camera_sample_panorama`, `spherical_stereo_transform`): it moves the ray's origin over the
lens's aperture, and then to the eye on the circle of spherical stereo.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import bpy
import numpy as np
from numpy.typing import NDArray

from ...images.passes import DEPTH_PASS, Passes
from ...trace.pixel_filter import sample_offsets
from ...views.camera import Camera, Vector
from ...views.panorama import PANORAMA_FROM_CAMERA, PanoramicCamera
from ..scene.visible import aperture_radius, volume_boxes
from ..scene.working import evaluated
from .denoise import NORMAL
from .packed_camera import PackedTask
from .packed_views import FORWARD, POSITION, PackedPixels, focus_distance_of, may_begin_in, surely_inside

TEXELS = 4
"""Texels of the table that a packed pixel has. Their first three numbers are vectors in the shader's space: the
camera's place, the direction at the pixel's centre (0 where there is no pixel), its change to the right, and its
change down. Their fourth numbers are: how far the eye is to the right of the camera, in scene units; how far the
pixel's centre lies within the lens's edge; the change of that to the right, and down."""

PIXELS_AT_ONCE = 1 << 16
"""Pixels whose rays are worked out at once: temporaries take some hundred bytes for each."""

TABLE_STEP = 64
"""Every so many entries of the pixel filter's table one is taken, to find how much of a pixel lies within the lens."""

SAME_TURN = 1e-6
"""Difference of the axes of cameras up to which they count as turned alike: single precision."""


@dataclass(frozen=True)
class SharedRays:
    """Properties that the rays of all pixels of a packed render share. Vectors are in the shader's space, lengths in
    scene units.

    up: unit vector around which spherical stereo turns. ahead: unit vector straight ahead; the first axis of the
    aperture lies in the plane of it and the ray. per_convergence: 1 / convergence distance, 0 for parallel rays.
    poles: angles at which the pole merge begins and ends, in radians; None without. in_stereo: False where no eye is
    moved. is_unit: directions count as long as 1. by_plane: the near clip is a plane, and a ray begins as many near
    clips away as its direction is long in the table. has_edge: there is an edge of the lens. near_clip, focus and
    aperture are the near clip, the distance that is in focus and the radius of the aperture, 0 without depth of field.
    """

    up: tuple[float, float, float]
    ahead: tuple[float, float, float]
    per_convergence: float
    poles: tuple[float, float] | None
    in_stereo: bool
    is_unit: bool
    by_plane: bool
    has_edge: bool
    near_clip: float
    focus: float
    aperture: float


def panoramic(camera: Camera) -> PanoramicCamera:
    """Return the camera itself: no other kind has rays in a table."""
    assert isinstance(camera, PanoramicCamera)
    return camera


def shared_rays(scene: bpy.types.Scene, task: PackedTask, shader_from_camera: NDArray[np.float64]) -> SharedRays:
    """Return what the rays of a task share. shader_from_camera is the turn (3, 3) from the rendered view's camera space
    to the shader's."""
    camera = panoramic(task.rendered)
    stereo = camera.stereo
    poles = None if stereo is None or stereo.poles is None else (stereo.poles.begin, stereo.poles.end)
    return SharedRays(
        up=_vector(shader_from_camera @ camera.up),
        ahead=_vector(shader_from_camera @ PANORAMA_FROM_CAMERA[0]),
        per_convergence=0.0 if stereo is None else 1.0 / stereo.convergence,
        poles=poles,
        in_stereo=stereo is not None,
        is_unit=camera.projection.is_unit,
        by_plane=camera.around_world,
        has_edge=camera.has_lens_edge,
        near_clip=task.clip_start,
        focus=focus_distance_of(scene, task.rendered),
        aperture=aperture_radius(evaluated(scene.camera, scene).data),
    )


def ray_texels(
    task: PackedTask, shader_from_camera: NDArray[np.float64], *, count: int, first: int = 0
) -> NDArray[np.float32]:
    """Return the table's texels (4, count, TEXELS), by number, packed pixel and texel: those of the packed picture,
    counted row by row, from `first` on, and 0 before and after them. shader_from_camera is as for `shared_rays`.
    """
    texels = np.zeros((4, count, TEXELS), np.float32)
    for pixels, at in zip(task.views, task.packing.at, strict=True):
        for start in range(0, len(at), PIXELS_AT_ONCE):
            some = slice(start, start + PIXELS_AT_ONCE)
            part = PackedPixels(pixels.camera, pixels.places[some])
            texels[:, first + at[some]] = _texels(part, task.rendered, shader_from_camera)
    return texels


def shares_within_lens(task: PackedTask, index: int) -> NDArray[np.float32]:
    """Return the shares (N, 1) of the rays of one view's pixels that are to lie within the lens's edge, by the pixel
    filter: how many of a few samples do differs from them by chance."""
    pixels = task.views[index]
    shares = np.ones((len(pixels.places), 1), np.float32)
    if not panoramic(pixels.camera).has_lens_edge:
        return shares
    # Of as many samples each stands for one; the middle ones of as many equal parts.
    offsets = sample_offsets(*task.pixel_filter)[TABLE_STEP // 2 :: TABLE_STEP] - np.float32(0.5)
    right, down = offsets[None, :, None], offsets[None, None, :]
    for start in range(0, len(shares), PIXELS_AT_ONCE):
        some = slice(start, start + PIXELS_AT_ONCE)
        within = _texels(PackedPixels(pixels.camera, pixels.places[some]), task.rendered, np.eye(3))[3, :, 1:]
        reach = np.abs(within[:, 1:]).sum(axis=1) * np.abs(offsets).max()
        shares[some, 0] = within[:, 0] > 0.0
        beside = np.abs(within[:, 0]) <= reach
        middle, to_right, to_down = within[beside, :, None, None].transpose(1, 0, 2, 3)
        shares[start + np.flatnonzero(beside), 0] = (middle + to_right * right + to_down * down > 0.0).mean(axis=(1, 2))
    return shares


def _texels(pixels: PackedPixels, rendered: Camera, shader_from_camera: NDArray[np.float64]) -> NDArray[np.float32]:
    """Return the texels (4, N, TEXELS) of some pixels of one view; 0 where a pixel shows nothing."""
    camera = panoramic(pixels.camera)
    into = np.linalg.inv(rendered.world_from_camera[:3, :3])
    turn = shader_from_camera @ into @ camera.world_from_camera[:3, :3]
    place = shader_from_camera @ into @ (camera.world_from_camera[:3, 3] - rendered.world_from_camera[:3, 3])
    x, y = pixels.places[:, 1] + 0.5, pixels.places[:, 0] + 0.5

    def told(right: float, down: float) -> NDArray:
        looking = _stacked(camera.looking_in_camera(x + right, y + down), x)
        if camera.around_world:
            looking = looking * camera.near_clips(x + right, y + down)
        within = camera.within_lens(x + right, y + down)
        return np.concatenate([turn @ looking, within[None]])

    rays = np.stack([told(0.0, 0.0), told(0.5, 0.0) - told(-0.5, 0.0), told(0.0, 0.5) - told(0.0, -0.5)], axis=-1)
    texels = np.zeros((4, len(x), TEXELS), np.float32)
    texels[:3, :, 0] = place[:, None]
    texels[3, :, 0] = 0.0 if camera.stereo is None else camera.stereo.offset
    texels[..., 1:] = np.where(np.isfinite(rays).all(axis=(0, 2))[None, :, None], rays, 0.0)
    return texels


def why_no_rays(scene: bpy.types.Scene, eyes: Sequence[Camera]) -> str | None:
    """Return why no table can hold the rays of these views, in words; None if one can."""
    aperture = aperture_radius(evaluated(scene.camera, scene).data)
    turns = [eye.world_from_camera[:3, :3] for eye in eyes]
    checks = {
        "the lens of a perspective camera with spherical stereo has an aperture": aperture > 0.0
        and any(panoramic(eye).around_world for eye in eyes),
        # The aperture's axes are those of one view.
        "the lens has an aperture, and the eyes are turned": aperture > 0.0
        and not all(np.allclose(turn, turns[0], rtol=0.0, atol=SAME_TURN) for turn in turns),
        "the camera's axes are not at right angles": not all(
            np.allclose(turn.T @ turn, np.eye(3), rtol=0.0, atol=SAME_TURN) for turn in turns
        ),
        # Cycles asks whether its own camera is in a volume, and knows nothing of the circle on which the rays begin.
        "an eye may begin in a volume": _may_leave_volumes(scene, eyes),
    }
    return next((reason for reason, blocks in checks.items() if blocks), None)


def _may_leave_volumes(scene: bpy.types.Scene, eyes: Sequence[Camera]) -> bool:
    """Return whether rays of spherical stereo may begin in a volume in which the camera itself is not."""
    if not any(panoramic(eye).stereo for eye in eyes):
        return False
    boxes = volume_boxes(scene)
    return may_begin_in(scene, boxes, eyes) and not all(surely_inside(eye, boxes) for eye in eyes)


def seen_by_eye(
    flat: Passes, task: PackedTask, index: int, *, by_distance: bool, camera_from_normals: NDArray[np.float64]
) -> Passes:
    """Return the passes (N, C) of one view's pixels with the depth of its camera, and the denoiser's normals as a plain
    render of it has them.

    by_distance: the Depth pass has the distance from the rendered view's camera; otherwise it is as that camera's plain
    render has it. camera_from_normals is the turn (3, 3) of the normals into that camera's space.
    """
    pixels = task.views[index]
    camera, converted = panoramic(pixels.camera), dict(flat)
    x, y = pixels.places[:, 1] + 0.5, pixels.places[:, 0] + 0.5
    if DEPTH_PASS in flat:
        value = flat[DEPTH_PASS][:, 0]
        if camera is not task.rendered:
            away = np.linalg.norm(flat[POSITION] - camera.world_from_camera[:3, 3], axis=-1)
            value, by_distance = np.where(np.isfinite(value), away, value), True
        depth_of = camera.depth_from_distance if by_distance else camera.depth_from_pass
        converted[DEPTH_PASS] = depth_of(x, y, value)[:, None].astype(np.float32)
    if NORMAL in flat:
        own_from_rendered = np.linalg.inv(camera.world_from_camera[:3, :3]) @ task.rendered.world_from_camera[:3, :3]
        turn = normals_from_camera(camera) @ own_from_rendered @ camera_from_normals
        converted[NORMAL] = (flat[NORMAL] @ turn.T).astype(np.float32)
    return converted


def normals_from_camera(camera: PanoramicCamera) -> NDArray[np.float64]:
    """Return the turn (3, 3) from camera space to the frame in which Cycles has the denoiser's normals."""
    return FORWARD[:3, :3] if camera.around_world else PANORAMA_FROM_CAMERA


def _stacked(vector: Vector, like: NDArray) -> NDArray:
    """Return a vector's parts as an array (3, N)."""
    return np.stack(np.broadcast_arrays(*vector, like)[:3])


def _vector(values: NDArray[np.float64]) -> tuple[float, float, float]:
    """Return three numbers as Blender takes them."""
    x, y, z = map(float, values)
    return x, y, z
