"""A Blender camera and its stereo settings as the two cameras of a rig, the way Blender's own multiview sets them up.

Source: Blender, `BKE_camera_multiview_model_matrix`, `BKE_camera_multiview_shift_x` and Cycles' view plane; a test
holds the result against a multiview render.
"""

from __future__ import annotations

from dataclasses import dataclass

import bpy
import numpy as np
from numpy.typing import NDArray

from ...errors import BadInputError
from ...views.camera import Camera, OrthographicCamera, PerspectiveCamera, ViewPlane, planar
from ...views.panorama import PanoramicCamera
from ...views.projections import Rectilinear
from ...words import Words
from .panoramas import PROJECTIONS, has_no_screen, panorama_projection, spherical_stereo
from .rendered import CYCLES

MODES = {"off-axis": "OFFAXIS", "parallel": "PARALLEL", "toe-in": "TOE"}

PIXEL_ROUNDINGS = 64
"""A pixel of a view plane is at least so many times as wide as what the plane's coordinates are rounded by."""


@dataclass(frozen=True)
class FrameRegion:
    """The pixels that are rendered, row 0 at the top: the size of the whole frame, and within it the left, top and size
    of the part that is rendered (the render border, or all).
    """

    full_width: int
    full_height: int
    left: int
    top: int
    width: int
    height: int


def frame_region(render: bpy.types.RenderSettings) -> FrameRegion:
    """Return the pixels that these settings render, with Blender's own rounding of resolution percentage and render
    border.
    """
    full_width = render.resolution_x * render.resolution_percentage // 100
    full_height = render.resolution_y * render.resolution_percentage // 100
    if not render.use_border:
        return FrameRegion(full_width, full_height, 0, 0, full_width, full_height)
    single = np.float32
    left, right = (int(single(edge) * single(full_width)) for edge in (render.border_min_x, render.border_max_x))
    bottom, top = (int(single(edge) * single(full_height)) for edge in (render.border_min_y, render.border_max_y))
    return FrameRegion(full_width, full_height, left, full_height - top, right - left, top - bottom)


def check_camera(camera: bpy.types.Object | None) -> bpy.types.Object:
    """Return the camera if a pair can be made with it. Raises BadInputError that says what is in the way."""
    if camera is None:
        raise BadInputError("the scene has no camera: set one in Scene properties > Camera")
    if camera.is_missing:
        raise BadInputError(
            Words(
                "camera {camera} is linked from a file that is missing: find it, or make one here",
                camera=repr(camera.name),
            )
        )
    if camera.type != "CAMERA":
        raise BadInputError(
            Words(
                "the scene looks through {camera}, which is no camera: choose one as scene camera",
                camera=repr(camera.name),
            )
        )
    if camera.data.type not in ("PERSP", "ORTHO", "PANO"):
        kind = {"CUSTOM": "custom"}.get(camera.data.type, camera.data.type)
        raise BadInputError(
            Words(
                "camera {camera} is {kind}: only perspective, orthographic and panoramic cameras are supported yet",
                camera=repr(camera.name),
                kind=Words(kind),
            )
        )
    if camera.data.type == "PANO" and camera.data.panorama_type not in PROJECTIONS:
        raise BadInputError(
            Words(
                "camera {camera} is a panoramic mirror ball, which is not supported: choose another panorama type",
                camera=repr(camera.name),
            )
        )
    return camera


def check_engine_shows(camera: bpy.types.Object, engine: str) -> None:
    """Raise BadInputError if the engine, by its name in Blender, does not render a camera that `check_camera` takes as
    Cycles does: EEVEE knows neither panoramas nor spherical stereo."""
    data = camera.data
    if engine != CYCLES and has_no_screen(data):
        what = "a panorama" if data.type == "PANO" else "spherical stereo"
        message = "camera {camera} is set to {what}, which Cycles alone renders: set Cycles as engine"
        raise BadInputError(Words(message, camera=repr(camera.name), what=Words(what)))


def stereo_cameras(camera: bpy.types.Object, render: bpy.types.RenderSettings) -> dict[str, Camera]:
    """Return both eyes of an evaluated camera object, by view name: 'left' and 'right'.

    Raises BadInputError where the numbers of an eye are too coarse to tell its pixels apart.
    """
    region = frame_region(render)
    eyes = {view: _eye(camera, render, region, view) for view in ("left", "right")}
    for view, eye in eyes.items():
        if not _is_wide(eye):
            raise BadInputError(
                Words(
                    "the {view} eye of camera {camera} has no view: {why}",
                    view=Words(view),
                    camera=repr(camera.name),
                    why=_why_narrow(camera.data),
                )
            )
    return eyes


def _is_wide(eye: Camera) -> bool:
    """Return whether double precision can tell the pixels of the eye's view plane, or panorama, apart."""
    plane = eye.window if isinstance(eye, PanoramicCamera) else planar(eye).plane
    sides = ((plane.left, plane.right, eye.width), (plane.bottom, plane.top, eye.height))
    return all(
        (high - low) / count > PIXEL_ROUNDINGS * np.finfo(np.float64).eps * max(abs(low), abs(high))
        for low, high, count in sides
    )


def _why_narrow(data: bpy.types.Camera) -> Words:
    """Return which camera setting may be why an eye has no view, in words."""
    if data.type == "ORTHO" and data.ortho_scale == 0.0:
        return Words("its orthographic scale is 0: raise it in Camera properties > Lens")
    stereo = data.stereo
    if stereo.convergence_mode == "OFFAXIS" and stereo.interocular_distance > stereo.convergence_distance:
        return Words(
            "interocular and convergence distance ({interocular} and {convergence}) do not go together: take a smaller"
            " interocular one",
            interocular=f"{stereo.interocular_distance:g}",
            convergence=f"{stereo.convergence_distance:g}",
        )
    return Words("check focal length, sensor and shift in Camera properties")


def _eye(camera: bpy.types.Object, render: bpy.types.RenderSettings, region: FrameRegion, view: str) -> Camera:
    """Return one eye of an evaluated camera object as a camera in the world, for the pixels of the region."""
    data = camera.data
    world = np.array(camera.matrix_world, np.float64)
    world[:3, :3] /= np.linalg.norm(world[:3, :3], axis=0)
    if has_no_screen(data):
        return _eye_with_rays(data, render, region, view, world)
    plane = _region_plane(_view_plane(data, render, region, data.shift_x + _stereo_shift(data, view)), region)
    model = OrthographicCamera if data.type == "ORTHO" else PerspectiveCamera
    return model(region.width, region.height, world @ camera_from_eye(data, view), plane)


def _eye_with_rays(
    data: bpy.types.Camera,
    render: bpy.types.RenderSettings,
    region: FrameRegion,
    view: str,
    world: NDArray[np.float64],
) -> PanoramicCamera:
    """Return one eye of a panoramic camera, or of a perspective one with spherical stereo, for the pixels of the
    region. world is the camera's pose without its scale."""
    stereo = spherical_stereo(data, view)
    if data.type == "PERSP":
        plane = _region_plane(_view_plane(data, render, region, data.shift_x), region)
        return PanoramicCamera(region.width, region.height, world, plane, Rectilinear(), stereo, around_world=True)
    # In a panorama a shift is in pictures, and off-axis convergence shifts nothing.
    whole = ViewPlane(data.shift_x, 1.0 + data.shift_x, data.shift_y, 1.0 + data.shift_y)
    pose = world if stereo is not None else world @ camera_from_eye(data, view)
    projection = panorama_projection(data, render)
    return PanoramicCamera(region.width, region.height, pose, _region_plane(whole, region), projection, stereo)


def camera_from_eye(data: bpy.types.Camera, view: str) -> NDArray[np.float64]:
    """Return the transform (4, 4) from the eye's space to that of the camera object, whose scale is left out."""
    side = _side(data, view)
    result = np.eye(4)
    if side == 0.0:
        return result
    stereo = data.stereo
    offset = np.eye(4)
    offset[0, 3] = side * stereo.interocular_distance
    if stereo.convergence_mode != "TOE":
        return offset
    # Turned towards the convergence point; away from a pivot at one eye, by half the angle before the step and half
    # after it, so that both eyes lie on a circle around that point.
    angle = -np.sign(side) * np.arctan(0.5 * stereo.interocular_distance / stereo.convergence_distance)
    turn = np.eye(4)
    turn[0, 0] = turn[2, 2] = np.cos(angle)
    turn[0, 2], turn[2, 0] = -np.sin(angle), np.sin(angle)
    return offset @ turn if stereo.pivot == "CENTER" else turn @ offset @ turn


def _side(data: bpy.types.Camera, view: str) -> float:
    """Return where the eye stands beside the camera, in interocular distances, positive to the right."""
    by_pivot = {"LEFT": (0.0, 1.0), "RIGHT": (-1.0, 0.0), "CENTER": (-0.5, 0.5)}
    return by_pivot[data.stereo.pivot][view == "right"]


def _stereo_shift(data: bpy.types.Camera, view: str) -> float:
    """Return the lens shift that off-axis convergence gives an eye, in sensor widths as the camera's Shift X; 0 in
    other modes.
    """
    stereo = data.stereo
    if stereo.convergence_mode != "OFFAXIS":
        return 0.0
    per_distance = data.lens / stereo.convergence_distance / data.sensor_width
    return -_side(data, view) * stereo.interocular_distance * per_distance


def convergence_of_screen(data: bpy.types.Camera, depth: float) -> float:
    """Return the convergence distance that puts the screen at this depth; both are in scene units.

    It is the depth itself but for off-axis cameras with a vertical sensor fit: Blender divides the shift of their eyes
    by the sensor's width, and the view plane by its height.
    """
    vertical = data.sensor_fit == "VERTICAL" and data.stereo.convergence_mode == "OFFAXIS" and data.type == "PERSP"
    return depth * data.sensor_height / data.sensor_width if vertical else depth


def _view_plane(
    data: bpy.types.Camera, render: bpy.types.RenderSettings, region: FrameRegion, shift_x: float
) -> ViewPlane:
    """Return the view plane of the whole frame, after sensor fit, pixel aspect and shift. shift_x is the camera's own
    with that of the eye.
    """
    wide = region.full_width * render.pixel_aspect_x
    high = region.full_height * render.pixel_aspect_y
    horizontal = data.sensor_fit == "HORIZONTAL" or (data.sensor_fit == "AUTO" and wide > high)
    sensor = data.sensor_height if data.sensor_fit == "VERTICAL" else data.sensor_width
    extent = data.ortho_scale if data.type == "ORTHO" else sensor / data.lens
    unit = extent / (wide if horizontal else high)
    centre_x, centre_y = shift_x * extent, data.shift_y * extent
    half_x, half_y = 0.5 * wide * unit, 0.5 * high * unit
    return ViewPlane(centre_x - half_x, centre_x + half_x, centre_y - half_y, centre_y + half_y)


def _region_plane(plane: ViewPlane, region: FrameRegion) -> ViewPlane:
    """Return the part of the frame's view plane that the region's pixels cover."""
    step_x = (plane.right - plane.left) / region.full_width
    step_y = (plane.top - plane.bottom) / region.full_height
    left = plane.left + step_x * region.left
    top = plane.top - step_y * region.top
    return ViewPlane(left, left + step_x * region.width, top - step_y * region.height, top)
