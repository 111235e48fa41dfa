"""The settings of a working scene: those by which single stereo views are rendered, and the user's overrides."""

from __future__ import annotations

import bpy

from ...settings.frame import EYES, SceneOverrides
from .animated import hold
from .rendered import CYCLES
from .rig import MODES
from .vr_cameras import set_up_panorama

DRIVEN_SEED = "stereo_reproject_seed"
"""A working scene's property that has the driver of its seed."""


def set_up(scene: bpy.types.Scene, layer: str) -> None:
    """Set a working scene up to render one view layer for stereo: with colour and depth, and without compositor or
    sequencer.
    """
    render = scene.render
    render.use_persistent_data = True
    render.use_compositing = False
    render.use_sequencer = False
    render.use_stamp = False
    render.use_single_layer = False
    render.use_freestyle = False
    render.use_crop_to_border = render.use_border
    render.use_multiview = True
    render.views_format = "STEREO_3D"
    for eye in EYES:
        # A scene with views of its own may have neither.
        if eye not in render.views:
            render.views.new(eye)
    for view in render.views:
        view.use = view.name in EYES
    for view_layer in scene.view_layers:
        view_layer.use = view_layer.name == layer
    scene.view_layers[layer].use_pass_combined = True
    scene.view_layers[layer].use_pass_z = True


def apply_overrides(scene: bpy.types.Scene, camera: bpy.types.Camera, overrides: SceneOverrides) -> None:
    """Set a working scene and its camera's stereo settings as the overrides say."""
    if overrides.size is not None:
        scene.render.resolution_x, scene.render.resolution_y = overrides.size
        scene.render.resolution_percentage = 100
    if overrides.samples is not None:
        if scene.render.engine == CYCLES:
            scene.cycles.samples = overrides.samples
            for layer in scene.view_layers:
                # A layer's own number would win.
                layer.samples = 0
        else:
            scene.eevee.taa_render_samples = overrides.samples
    if scene.render.engine == CYCLES:
        _apply_to_cycles(scene, overrides)
    if overrides.panorama is not None:
        set_up_panorama(scene.render, camera, overrides)
    _apply_to_stereo(camera, overrides)


def _apply_to_stereo(camera: bpy.types.Camera, overrides: SceneOverrides) -> None:
    """Set the stereo settings of a working scene's camera as the overrides say."""
    stereo = camera.stereo
    if overrides.mono:
        # The left eye is then the camera itself, to the bit.
        hold(camera, "stereo.", {"interocular_distance": 0.0, "use_spherical_stereo": False})
        stereo.pivot = "LEFT"
    if overrides.interocular_distance is not None:
        stereo.interocular_distance = overrides.interocular_distance
    if overrides.convergence_distance is not None:
        stereo.convergence_distance = overrides.convergence_distance
    if overrides.convergence_mode is not None:
        stereo.convergence_mode = MODES[overrides.convergence_mode]


def _apply_to_cycles(scene: bpy.types.Scene, overrides: SceneOverrides) -> None:
    """Set seed and denoising of a working scene that Cycles renders as the overrides say."""
    _take_over_seed(scene)
    if overrides.seed is not None:
        scene.pop(DRIVEN_SEED, None)
        scene.cycles.seed = overrides.seed
    if overrides.denoise is not None:
        scene.cycles.use_denoising = overrides.denoise
        for layer in scene.view_layers:
            layer.cycles.use_denoising = overrides.denoise


def _take_over_seed(scene: bpy.types.Scene) -> None:
    """Move a driver of the scene's seed to another property, from which `move_to` reads it: each render of a frame
    needs a seed of its own, which the driver would overwrite.
    """
    drivers = scene.animation_data.drivers if scene.animation_data else ()
    driver = next((curve for curve in drivers if curve.data_path == "cycles.seed"), None)
    if driver is not None:
        scene[DRIVEN_SEED] = 0
        scene.animation_data.drivers.from_existing(src_driver=driver).data_path = f'["{DRIVEN_SEED}"]'
        scene.driver_remove("cycles.seed")
