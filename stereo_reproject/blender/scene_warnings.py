"""What a scene asks for that its pair does not have, or has otherwise than the user may think."""

from __future__ import annotations

from pathlib import Path

import bpy

from .compositor import compositor_blocker, gives_a_picture, has_compositor
from .denoise import has_denoiser
from .scene import CYCLES, layers_to_render


def scene_warnings(scene: bpy.types.Scene) -> list[str]:
    """What the scene asks for that a stereo pair does not have yet: a line each."""
    warnings = []
    if scene.render.use_compositing and has_compositor(scene):
        blocker = compositor_blocker(scene)
        if blocker is not None:
            warnings.append(f"the scene's compositor is left out: {blocker}")
        elif not gives_a_picture(scene):
            warnings.append("nothing is linked to the compositor's output: only its File Output nodes show the pair")
    if scene.render.engine == CYCLES and scene.cycles.use_denoising and not has_denoiser(scene):
        warnings.append("this Blender is built without a denoiser: both eyes are left noisy, as by its own render")
    warnings += _unbaked(scene)
    warnings += _missing_images()
    if bpy.app.autoexec_fail:
        warnings.append("scripts of the .blend were not run: drivers that need them stand still")
    if scene.render.use_freestyle:
        warnings.append("Freestyle lines are not drawn")
    return warnings


def first_layer_alone(scene: bpy.types.Scene, what: str) -> list[str]:
    """A line when there are several view layers, for what has a look at the first of them only."""
    layers = layers_to_render(scene)
    return [f"{what} of the first of {len(layers)} view layers, {layers[0]!r}"] if len(layers) > 1 else []


def _missing_images() -> list[str]:
    """A line when there are image files that are used and not there: Blender renders what shows them pink."""
    missing = [
        image.name
        for image in bpy.data.images
        if image.source == "FILE" and image.users and image.filepath and not image.packed_file
        if not Path(bpy.path.abspath(image.filepath, library=image.library)).exists()
    ]
    if not missing:
        return []
    more = f" and {len(missing) - 1} more" if len(missing) > 1 else ""
    return [f"image file missing for {missing[0]!r}{more}: find it with File > External Data > Find Missing Files"]


def _unbaked(scene: bpy.types.Scene) -> list[str]:
    """A line when something is simulated and not baked: its state is not part of a file, and frames are visited to
    and fro."""
    found = [
        f"{modifier.name!r} on {item.name!r}"
        for item in scene.objects
        for modifier in item.modifiers
        if modifier.type in ("CLOTH", "SOFT_BODY") and not modifier.point_cache.is_baked
    ]
    found += [
        f"{system.name!r} on {item.name!r}"
        for item in scene.objects
        for system in item.particle_systems
        if _moves(system) and not system.point_cache.is_baked
    ]
    world = scene.rigidbody_world
    if world is not None and world.enabled and world.collection and not world.point_cache.is_baked:
        found.append("the rigid body world")
    found += [
        f"{modifier.name!r} on {item.name!r}"
        for item in scene.objects
        for modifier in item.modifiers
        if modifier.type == "NODES" and _has_simulation(modifier.node_group) and not len(modifier.bakes)
    ]
    if not found:
        return []
    more = f" and {len(found) - 1} more" if len(found) > 1 else ""
    return [f"a simulation is not baked, {found[0]}{more}: bake it, or it may look different here"]


def _moves(system: bpy.types.ParticleSystem) -> bool:
    return system.settings.type == "EMITTER" or system.use_hair_dynamics


def _has_simulation(tree: bpy.types.NodeTree | None) -> bool:
    return tree is not None and any(node.bl_idname == "GeometryNodeSimulationInput" for node in tree.nodes)
