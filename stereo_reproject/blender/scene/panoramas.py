"""Panoramic cameras, and perspective ones with spherical stereo, as Cycles sets them up for Blender's multiview.

Source: Blender, `intern/cycles/blender/camera.cpp`; a test holds the result against multiview renders.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType

import bpy
import numpy as np

from ...errors import BadInputError
from ...views.projections import (
    CentralCylindrical,
    EquiangularCubeFace,
    Equirectangular,
    FisheyeEquidistant,
    FisheyeEquisolid,
    FisheyePolynomial,
    Projection,
)
from ...views.spherical import PoleMerge, SphericalStereo
from ...words import Words

Sensor = tuple[float, float]


def is_panorama(camera: bpy.types.Object | None) -> bool:
    """Return whether a scene's camera, an object of any type or None, is a panorama by itself, of whatever kind."""
    return camera is not None and camera.type == "CAMERA" and camera.data.type == "PANO"


def has_no_screen(data: bpy.types.Camera) -> bool:
    """Return whether a camera's pair is for no screen: a panorama's, or one of spherical stereo, whose eyes stand on a
    circle around the camera and look in every direction alike."""
    return data.type == "PANO" or (data.type == "PERSP" and data.stereo.use_spherical_stereo)


def spherical_stereo(data: bpy.types.Camera, view: str) -> SphericalStereo | None:
    """Return the spherical stereo of one view of an evaluated camera, by the view's name; None where the camera uses
    none. Raises BadInputError where the limits of its pole merge cross."""
    stereo = data.stereo
    if not stereo.use_spherical_stereo:
        return None
    side = {"left": -0.5, "right": 0.5}.get(view, 0.0)
    parallel = stereo.convergence_mode == "PARALLEL"
    merged = _merges_poles(stereo)
    if pole_merge_crosses(stereo):
        first, last = (f"{np.degrees(a):.3g}°" for a in (stereo.pole_merge_angle_from, stereo.pole_merge_angle_to))
        message = "the pole merge of the camera starts at {first} and ends at {last}: set its end above its start"
        raise BadInputError(Words(message, first=first, last=last))
    poles = PoleMerge(stereo.pole_merge_angle_from, stereo.pole_merge_angle_to) if merged else None
    distance = np.inf if parallel else stereo.convergence_distance
    return SphericalStereo(side * stereo.interocular_distance, distance, poles)


def pole_merge_crosses(stereo: bpy.types.CameraStereoData) -> bool:
    """Return whether the pole merge of spherical stereo starts beyond its end, so that nothing can be rendered."""
    return _merges_poles(stereo) and stereo.pole_merge_angle_from > stereo.pole_merge_angle_to


def _merges_poles(stereo: bpy.types.CameraStereoData) -> bool:
    """Return whether the eyes of spherical stereo come together at the poles: Cycles merges nothing without an end
    above 0."""
    return stereo.use_pole_merge and stereo.pole_merge_angle_to > 0.0


def panorama_projection(data: bpy.types.Camera, render: bpy.types.RenderSettings) -> Projection:
    """Return the projection of an evaluated panoramic camera, whose type is one of `PROJECTIONS`. Raises BadInputError
    if it shows nothing.
    """
    return PROJECTIONS[data.panorama_type](data, panorama_sensor(data, render))


def panorama_sensor(data: bpy.types.Camera, render: bpy.types.RenderSettings) -> Sensor:
    """Return width and height, in millimetres, of what the whole picture covers of a fisheye lens's sensor."""
    wide = (render.resolution_x * render.resolution_percentage // 100) * render.pixel_aspect_x
    high = (render.resolution_y * render.resolution_percentage // 100) * render.pixel_aspect_y
    horizontal = data.sensor_fit == "HORIZONTAL" or (data.sensor_fit == "AUTO" and wide > high)
    size = data.sensor_height if data.sensor_fit == "VERTICAL" else data.sensor_width
    return (size, size * high / wide) if horizontal else (size * wide / high, size)


def _check_extent(what: str, first: float, last: float) -> None:
    """Raise BadInputError where a panorama begins and ends at one place."""
    if not first < last and not last < first:
        message = "the first and the last of the panorama's {what} are the same: set them apart"
        raise BadInputError(Words(message, what=Words(what)))


def _equirectangular(data: bpy.types.Camera, _: Sensor) -> Projection:
    longitudes, latitudes = (data.longitude_min, data.longitude_max), (data.latitude_min, data.latitude_max)
    _check_extent("longitudes", *longitudes)
    _check_extent("latitudes", *latitudes)
    return Equirectangular(longitudes, latitudes)


def _cylindrical(data: bpy.types.Camera, _: Sensor) -> Projection:
    longitudes = data.central_cylindrical_range_u_min, data.central_cylindrical_range_u_max
    low, high = data.central_cylindrical_range_v_min, data.central_cylindrical_range_v_max
    radius = data.central_cylindrical_radius
    _check_extent("longitudes", *longitudes)
    _check_extent("heights", low, high)
    return CentralCylindrical(longitudes, (low / radius, high / radius), is_unit=data.dof.use_dof)


def _equidistant(data: bpy.types.Camera, _: Sensor) -> Projection:
    return FisheyeEquidistant(data.fisheye_fov)


def _equisolid(data: bpy.types.Camera, sensor: Sensor) -> Projection:
    return FisheyeEquisolid(data.fisheye_lens, data.fisheye_fov, sensor)


def _polynomial(data: bpy.types.Camera, sensor: Sensor) -> Projection:
    k0, k1, k2, k3, k4 = (getattr(data, f"fisheye_polynomial_k{power}") for power in range(5))
    return FisheyePolynomial((k0, k1, k2, k3, k4), data.fisheye_fov, sensor)


def _cube_face(_data: bpy.types.Camera, _: Sensor) -> Projection:
    return EquiangularCubeFace()


PROJECTIONS: Mapping[str, Callable[[bpy.types.Camera, Sensor], Projection]] = MappingProxyType(
    {
        "EQUIRECTANGULAR": _equirectangular,
        "EQUIANGULAR_CUBEMAP_FACE": _cube_face,
        "FISHEYE_EQUIDISTANT": _equidistant,
        "FISHEYE_EQUISOLID": _equisolid,
        "FISHEYE_LENS_POLYNOMIAL": _polynomial,
        "CENTRAL_CYLINDRICAL": _cylindrical,
    }
)
"""Projections by Blender's names of panorama types. A mirror ball is none of them."""
