"""The part of the sphere that a scene's movie shows, by its cameras."""

from __future__ import annotations

import math
from collections.abc import Iterable

import bpy

from ...delivery.projection import MoviePanorama, panorama_of
from ...errors import BadInputError
from ...views.panorama import PanoramicCamera
from ...views.projections import Equirectangular
from ..scene.panoramas import is_panorama
from ..scene.rendered import camera_at
from ..scene.rig import stereo_cameras
from ..scene.vr_cameras import HALF_WIDTHS


def movie_panorama(scene: bpy.types.Scene, frames: Iterable[int], asked: str | None = None) -> MoviePanorama | None:
    """Return the part of the sphere that a movie of these frames shows, by the cameras as they are now; None for other
    cameras than equirectangular ones, and where not all frames show the same part. asked is the panorama that cameras
    are made for the render, as `SceneOverrides` has it.
    """
    shown = {_panorama(camera, scene.render, asked) for camera in _cameras(scene, frames)}
    return shown.pop() if len(shown) == 1 else None


def shows_panorama(scene: bpy.types.Scene, frames: Iterable[int], asked: str | None = None) -> bool:
    """Return whether any of these frames shows a panorama, of whatever projection. asked is as for `movie_panorama`."""
    return asked is not None or any(is_panorama(camera) for camera in _cameras(scene, frames))


def _cameras(scene: bpy.types.Scene, frames: Iterable[int]) -> Iterable[bpy.types.Object]:
    """Return the cameras of these frames, each once."""
    found = (camera_at(scene, frame) for frame in frames)
    return {camera.name_full: camera for camera in found if camera}.values()


def _panorama(camera: bpy.types.Object, render: bpy.types.RenderSettings, asked: str | None) -> MoviePanorama | None:
    """Return the part of the sphere that a camera shows, after shift and render border; None for other cameras than
    equirectangular ones. asked is as for `movie_panorama`.
    """
    data = camera.data
    if camera.type != "CAMERA":
        return None
    if asked is not None and data.type == "PERSP":
        return panorama_of(*_angles(asked))
    if data.type != "PANO" or data.panorama_type != "EQUIRECTANGULAR":
        return None
    try:
        eye = stereo_cameras(camera, render)["left"]
    except BadInputError:
        # Whoever renders with it says why that cannot be.
        return None
    if not isinstance(eye, PanoramicCamera) or not isinstance(eye.projection, Equirectangular):
        return None
    own = eye.projection.longitudes, eye.projection.latitudes
    (west, east), (south, north) = own if asked is None else _angles(asked)
    window = eye.window
    longitudes = west + window.left * (east - west), west + window.right * (east - west)
    latitudes = south + window.bottom * (north - south), south + window.top * (north - south)
    return panorama_of(longitudes, latitudes)


def _angles(asked: str) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return the longitudes and latitudes of a panorama by its name in `SceneOverrides`."""
    half = HALF_WIDTHS[asked]
    return (-half, half), (-0.5 * math.pi, 0.5 * math.pi)
