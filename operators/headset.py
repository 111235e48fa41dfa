"""Pairs for headsets: the scene rendered as VR180 or 360°, from the place of its camera, which stays as it is."""

from __future__ import annotations

import bpy

from ..stereo_reproject.blender.scene.panoramas import has_no_screen, is_panorama
from ..stereo_reproject.blender.scene.rig import FrameRegion, frame_region
from ..stereo_reproject.blender.scene.vr_cameras import check_vr
from ..stereo_reproject.errors import BadInputError
from ..stereo_reproject.settings.frame import PANORAMAS, SceneOverrides

FLAT = "camera"
"""The choice of what the scene's camera itself sees."""

CHOICES = [
    (FLAT, "Camera", "As the scene's camera sees it, for a screen"),
    (
        "vr180",
        "VR180",
        (
            "The half of the sphere that is in front of the camera, for headsets. It stands upright: how far the camera"
            " looks up or down, and its roll, are left out. Depth of field is off"
        ),
    ),
    (
        "vr360",
        "360°",
        (
            "The whole sphere around the camera, for headsets. It stands upright: how far the camera looks up or down,"
            " and its roll, are left out. Depth of field is off"
        ),
    ),
]
"""Items of the setting that says what is rendered."""

STEREO_SETTINGS = {
    "convergence_mode": "Mode",
    "interocular_distance": "Interocular",
    "convergence_distance": "Convergence",
    "pivot": "Pivot",
}
"""A camera's own stereo settings, with their names in the panel, in its order."""

LEAST_HEIGHT_PX = 4
HEIGHT_PX = 4096


def asked_panorama(scene: bpy.types.Scene) -> str | None:
    """Return the panorama that the panel asks for, by its name in `SceneOverrides`; None for the camera's own view."""
    chosen = scene.stereo_reproject.headset
    return None if chosen == FLAT or is_panorama(scene.camera) else chosen


def is_for_headset(scene: bpy.types.Scene) -> bool:
    """Return whether the scene's pair is for a headset and not for a screen: by its camera, or because the panel asks
    for a panorama."""
    camera = scene.camera
    if asked_panorama(scene) is not None:
        return True
    return camera is not None and camera.type == "CAMERA" and has_no_screen(camera.data)


def stereo_settings_that_count(scene: bpy.types.Scene) -> set[str]:
    """Return the names of those stereo settings of the scene's camera that have an effect on its pair: of a panorama
    that the panel asks for the interocular distance alone, since its eyes are parallel and beside the camera."""
    names = {"interocular_distance"}
    if asked_panorama(scene) is not None:
        return names
    data = scene.camera.data
    mode, no_screen = data.stereo.convergence_mode, has_no_screen(data)
    names.add("convergence_mode")
    # The eyes of spherical stereo stand evenly about the camera; other panoramas are not shifted.
    is_spherical = no_screen and data.stereo.use_spherical_stereo
    if mode == "TOE" or (mode == "OFFAXIS" and (is_spherical or not no_screen)):
        names.add("convergence_distance")
    return names if is_spherical else names | {"pivot"}


def panorama_size(scene: bpy.types.Scene, panorama: str) -> tuple[int, int]:
    """Return the width and height in pixels of one eye of a panorama, by the height that is set in the panel."""
    width, height = PANORAMAS[panorama]
    wanted = scene.stereo_reproject.headset_height
    return wanted * width // height, wanted


def region_to_render(scene: bpy.types.Scene) -> FrameRegion:
    """Return the pixels of one eye that a full render of the scene has: those of the panorama that the panel asks for,
    or else the frame of the scene's camera."""
    panorama = asked_panorama(scene)
    if panorama is None:
        return frame_region(scene.render)
    size = panorama_size(scene, panorama)
    return FrameRegion(*size, 0, 0, *size)


def panorama_obstacle(scene: bpy.types.Scene, engine: str) -> BadInputError | None:
    """Return why the panorama that the panel asks for cannot be rendered of the scene by this engine, a name of
    Blender's; None where it can, or none is asked for."""
    panorama, camera = asked_panorama(scene), scene.camera
    if panorama is None or camera is None or camera.type != "CAMERA":
        return None
    try:
        check_vr(camera, scene.render, engine, SceneOverrides(panorama=panorama))
    except BadInputError as error:
        return error
    return None
