"""Warnings about parts of a scene that its pair lacks, or has otherwise than the user may think."""

from __future__ import annotations

from collections.abc import Iterator

import bpy

from ...errors import BadInputError
from ...settings.frame import SceneOverrides
from ...words import Words
from .compositor import compositor_blocker, gives_a_picture, has_compositor
from .denoiser import NO_DENOISER, has_denoiser
from .engine_support import engine_warnings
from .instancing import brought_along
from .missing import missing_files, missing_libraries
from .rendered import CYCLES, EEVEE, camera_at, check_layers, layers_to_render
from .rig import frame_region
from .vr_cameras import vr_warnings
from .working import changed, working_scene

PLAIN = SceneOverrides()


def warnings_ahead(scene: bpy.types.Scene, overrides: SceneOverrides, *, strict: bool = False) -> list[str]:
    """Return a line for all that is known, before the first render, to be missing from a pair of this scene.

    Raises BadInputError if there is any such line and `strict` is set, and when the scene cannot be rendered as a pair.
    """
    warnings = scene_warnings(scene, overrides)
    if _engine_of(scene, overrides) in EEVEE:
        for layer in check_layers(scene):
            with working_scene(scene, overrides, layer=layer) as working:
                warnings += engine_warnings(working)
    warnings = list(dict.fromkeys(warnings))
    if strict and warnings:
        raise BadInputError(Words("strict, and so nothing is rendered: {warnings}", warnings="; ".join(warnings)))
    return warnings


def _engine_of(scene: bpy.types.Scene, overrides: SceneOverrides) -> str:
    """Return Blender's name of the engine that renders the source."""
    by_name = {"cycles": CYCLES, "eevee": EEVEE[0], None: scene.render.engine}
    return by_name[overrides.source_engine]


def scene_warnings(scene: bpy.types.Scene, overrides: SceneOverrides = PLAIN) -> list[str]:
    """Return a line for each part of the scene that its pair will lack or have otherwise than Blender's own render:
    missing files, an unusable compositor, unbaked simulations and so on. Nothing is rendered.
    """
    warnings = missing_libraries()
    if scene.render.use_compositing and has_compositor(scene):
        blocker = compositor_blocker(scene)
        if blocker is not None:
            warnings.append(f"the scene's compositor is left out: {blocker}")
        elif not gives_a_picture(scene):
            warnings.append("nothing is linked to the compositor's output: only its File Output nodes show the pair")
    denoised = scene.cycles.use_denoising if overrides.denoise is None else overrides.denoise
    if _engine_of(scene, overrides) == CYCLES and denoised and not has_denoiser(scene):
        warnings.append(NO_DENOISER)
    warnings += _unbaked(scene)
    warnings += missing_files(scene)
    if bpy.app.autoexec_fail:
        warnings.append("scripts of the .blend were not run: drivers that need them stand still")
    if scene.render.use_freestyle:
        warnings.append("Freestyle lines are not drawn")
    if _renders_strips(scene):
        warnings.append("the Video Sequencer's strips are left out: the pair is of the scene itself")
    frame = scene.frame_current if overrides.frame is None else overrides.frame
    return warnings + vr_warnings(camera_at(scene, frame), overrides) + _cropped(scene, overrides)


def _renders_strips(scene: bpy.types.Scene) -> bool:
    """Return whether Blender itself would render the Video Sequencer's strips instead of the scene
    (`RE_seq_render_active`).
    """
    editor = scene.sequence_editor
    if not scene.render.use_sequencer or editor is None:
        return False
    return any(
        strip.type != "SOUND" and not strip.mute and not editor.channels[strip.channel].mute for strip in editor.strips
    )


def _cropped(scene: bpy.types.Scene, overrides: SceneOverrides) -> list[str]:
    """Return a warning when a render region makes frames smaller than the scene's own render would be; else an empty
    list. For headsets such a region is refused, and nothing is said of it.
    """
    size = {}
    if overrides.size is not None:
        size = {"resolution_x": overrides.size[0], "resolution_y": overrides.size[1], "resolution_percentage": 100}
    with changed(scene.render, **size):
        region = frame_region(scene.render)
    part, whole = f"{region.width} x {region.height}", f"{region.full_width} x {region.full_height}"
    if overrides.panorama is not None or scene.render.use_crop_to_border or part == whole:
        return []
    own = f"Blender's own have {whole}, empty outside of it, for Crop to Render Region is off"
    return [f"frames are cropped to the Render Region, {part} pixels: {own}"]


def first_layer_alone(scene: bpy.types.Scene, what: str) -> list[str]:
    """Return a warning when the scene has several view layers, for a command that looks at the first alone; else an
    empty list. what is the beginning of the sentence: it says what is of the first layer only.
    """
    layers = layers_to_render(scene)
    return [f"{what} of the first of {len(layers)} view layers, {layers[0]!r}"] if len(layers) > 1 else []


def _unbaked(scene: bpy.types.Scene) -> list[str]:
    """Return a warning when a simulation is not baked: its state is not in the file, and frames are not rendered in
    order. Else an empty list.
    """
    found = [name for item in brought_along(scene.objects) for name in _unbaked_on(item)]
    world = scene.rigidbody_world
    if world is not None and world.enabled and world.collection and not world.point_cache.is_baked:
        found.append("the rigid body world")
    if not found:
        return []
    more = f" and {len(found) - 1} more" if len(found) > 1 else ""
    return [f"a simulation is not baked, {found[0]}{more}: bake it, or it may look different here"]


def _unbaked_on(item: bpy.types.Object) -> Iterator[str]:
    """Yield the names of an object's simulations that are not baked."""
    for modifier in item.modifiers:
        if modifier.type in ("CLOTH", "SOFT_BODY"):
            unbaked = not modifier.point_cache.is_baked
        else:
            simulated = modifier.type == "NODES" and _has_simulation(modifier.node_group)
            unbaked = simulated and not len(modifier.bakes)
        if unbaked:
            yield f"{modifier.name!r} on {item.name!r}"
    for system in item.particle_systems:
        if _moves(system) and not system.point_cache.is_baked:
            yield f"{system.name!r} on {item.name!r}"


def _moves(system: bpy.types.ParticleSystem) -> bool:
    """Return whether a particle system is simulated: it emits particles, or its hair has dynamics."""
    return system.settings.type == "EMITTER" or system.use_hair_dynamics


def _has_simulation(tree: bpy.types.NodeTree | None) -> bool:
    """Return whether geometry nodes simulate anything; None do not."""
    return tree is not None and any(node.bl_idname == "GeometryNodeSimulationInput" for node in tree.nodes)
