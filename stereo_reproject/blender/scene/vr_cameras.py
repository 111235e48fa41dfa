"""Cameras for headsets: VR180 and 360° pictures from the place of a scene's own camera, which may be a perspective one.

They stand upright and follow the scene's camera by a constraint and a driver, so in each moment that Blender evaluates:
frames, the times while a shutter is open, and the frames around one that motion vectors are measured against.
"""

from __future__ import annotations

import math

import bpy

from ...errors import BadInputError
from ...settings.frame import SceneOverrides
from ...views.comfort import MAX_VERGENCE_DEGREES, turned_apart_degrees
from ...words import Words
from .animated import hold
from .panoramas import pole_merge_crosses
from .rendered import CYCLES

NAMES = {"vr180": "VR180", "vr360": "360°"}
"""Words for the panoramas of `SceneOverrides`."""

HALF_WIDTHS = {"vr180": 0.5 * math.pi, "vr360": math.pi}
"""Greatest longitude of each panorama, in radians; the least is the same to the other side."""

POLE_MERGE = (math.radians(60.0), math.radians(75.0))
"""Latitudes, in radians, from which on the eyes come together, and where they have: Blender's defaults."""

WHOLE_FRAME = (0.0, 0.0, 1.0, 1.0)

CAMERA_AXES = {"x": (2, 0), "y": (2, 1), "z": (2, 2), "up_x": (1, 0), "up_y": (1, 1)}
"""Variables of the driver of the heading: axis and part of the camera's matrix in the world. x, y and z point backwards
from the camera, up_x and up_y upwards in its picture."""

HEADING = "atan2(x, -y) if x*x + y*y > 1e-8 * z*z else (atan2(-up_x, up_y) if z > 0 else atan2(up_x, -up_y))"
"""Turn about the world's Z axis, in radians, that has an upright camera look where another does. Of one that looks
straight down or up, what is up or down in its picture counts. Blender evaluates so simple an expression without
Python, so that it holds where scripts are not run."""


def check_vr(
    camera: bpy.types.Object, render: bpy.types.RenderSettings, engine: str, overrides: SceneOverrides
) -> None:
    """Raise BadInputError unless the overrides ask for no panorama, or for one that this camera, which `check_camera`
    takes, and the engine of this name in Blender can give."""
    if overrides.panorama is None:
        return
    what, data = Words(NAMES[overrides.panorama]), camera.data
    if engine != CYCLES:
        raise BadInputError(Words("a {what} panorama is rendered by Cycles alone: set Cycles as engine", what=what))
    if data.type == "ORTHO":
        message = "camera {camera} is orthographic: a {what} panorama needs a perspective or an equirectangular one"
        raise BadInputError(Words(message, camera=repr(camera.name), what=what))
    if data.type == "PANO" and data.panorama_type != "EQUIRECTANGULAR":
        message = "camera {camera} is a panorama of another type: for {what} set it to Equirectangular, or Perspective"
        raise BadInputError(Words(message, camera=repr(camera.name), what=what))
    border = (render.border_min_x, render.border_min_y, render.border_max_x, render.border_max_y)
    if render.use_border and border != WHOLE_FRAME:
        message = "a headset shows whole {what} panoramas: switch Render Region off in Output properties"
        raise BadInputError(Words(message, what=what))


def vr_warnings(camera: bpy.types.Object | None, overrides: SceneOverrides) -> list[str]:
    """Return a line for what is not as a viewer with a headset needs it, where the overrides ask for a panorama: a
    depth of field that is left out, and eyes that turn apart. Of a camera that is refused nothing is said."""
    if overrides.panorama is None or camera is None or camera.type != "CAMERA":
        return []
    data, warnings = camera.data, []
    if data.type == "PANO" and (data.panorama_type != "EQUIRECTANGULAR" or _has_crossed_limits(data.stereo)):
        return []
    if data.type == "PERSP" and data.dof.use_dof:
        how = f"the {NAMES[overrides.panorama]} panorama is sharp everywhere, since a headset cannot focus"
        warnings.append(f"depth of field is switched off: {how}")
    stereo = data.stereo
    mode = overrides.convergence_mode or ("parallel" if made_parallel(data, overrides) else stereo.convergence_mode)
    if data.type == "PERSP" or stereo.use_spherical_stereo:
        asked = overrides.interocular_distance, overrides.convergence_distance
        own = stereo.interocular_distance, stereo.convergence_distance
        interocular, convergence = (value if given is None else given for given, value in zip(asked, own, strict=True))
        apart = turned_apart_degrees(interocular, math.inf if mode.upper() == "PARALLEL" else convergence)
        if apart > MAX_VERGENCE_DEGREES:
            how = "set the convergence mode to parallel, or the convergence distance farther away"
            warnings.append(f"in a headset, eyes turn apart by {apart:.1f}° to look at what is far away: {how}")
    return warnings


def _has_crossed_limits(stereo: bpy.types.CameraStereoData) -> bool:
    """Return whether a panorama is refused for its own stereo settings."""
    return stereo.use_spherical_stereo and pole_merge_crosses(stereo)


def made_parallel(data: bpy.types.Camera, overrides: SceneOverrides) -> bool:
    """Return whether a camera that is set up for headsets gets parallel eyes: a perspective one does, whose convergence
    is a screen's, unless the overrides say how its eyes converge."""
    asked = overrides.convergence_mode is not None or overrides.convergence_distance is not None
    return overrides.panorama is not None and data.type == "PERSP" and not asked


def copy_of_camera(camera: bpy.types.Object, overrides: SceneOverrides) -> bpy.types.Object:
    """Return a copy of the user's camera, with data of its own: for a working scene, to which it is not yet linked.
    Where the overrides ask for a panorama and it is none yet, the copy stands upright, and follows it."""
    if overrides.panorama is None or camera.data.type == "PANO":
        eye = camera.copy()
        eye.data = camera.data.copy()
        return eye
    return _upright(camera)


def _upright(camera: bpy.types.Object) -> bpy.types.Object:
    """Return a new camera with a copy of the data of the user's, at its place and with its heading, without pitch and
    roll."""
    eye = bpy.data.objects.new(camera.name, camera.data.copy())
    for name in ("use_motion_blur", "motion_steps"):
        setattr(eye.cycles, name, getattr(camera.cycles, name))
    eye.constraints.new("COPY_LOCATION").target = camera
    eye.rotation_euler = (0.5 * math.pi, 0.0, 0.0)
    heading = eye.driver_add("rotation_euler", 2).driver
    for name, (axis, part) in CAMERA_AXES.items():
        variable = heading.variables.new()
        variable.name = name
        variable.targets[0].id = camera
        # Unlike in Python, the first index is the column's.
        variable.targets[0].data_path = f"matrix_world[{axis}][{part}]"
    heading.expression = HEADING
    return eye


def set_up_panorama(render: bpy.types.RenderSettings, data: bpy.types.Camera, overrides: SceneOverrides) -> None:
    """Make the data of a working scene's camera the panorama that the overrides ask for; of a camera that was one
    already only the angles are set."""
    render.pixel_aspect_x = render.pixel_aspect_y = 1.0
    assert overrides.panorama is not None
    half, parallel = HALF_WIDTHS[overrides.panorama], made_parallel(data, overrides)
    hold(data, "", {"longitude_min": -half, "longitude_max": half})
    hold(data, "", {"latitude_min": -0.5 * math.pi, "latitude_max": 0.5 * math.pi})
    if data.type == "PANO":
        return
    data.type, data.panorama_type = "PANO", "EQUIRECTANGULAR"
    # A panorama would be moved by whole pictures.
    hold(data, "", {"shift_x": 0.0, "shift_y": 0.0})
    hold(data, "dof.", {"use_dof": False})
    first, last = POLE_MERGE
    merge = {"use_pole_merge": True, "pole_merge_angle_from": first, "pole_merge_angle_to": last}
    hold(data, "stereo.", {"use_spherical_stereo": True, **merge})
    if parallel:
        data.stereo.convergence_mode = "PARALLEL"
