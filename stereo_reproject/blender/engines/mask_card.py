"""The card fill: a plane before the target camera, open at the holes and a holdout elsewhere.

It needs no OSL and works on every device: the frame is rendered as a whole, but the rays of a masked pixel end at once.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix
from numpy.typing import NDArray

from ...images.exr import write_table
from ...images.masks import dilate
from ...images.passes import Passes
from ...trace.pixel_filter import filter_support
from ...views.camera import OrthographicCamera
from ..scene.effects import has_grease_pencil, is_animated, uses_output
from ..scene.motion import BLUR_SETTINGS
from ..scene.panoramas import has_no_screen
from ..scene.rig import camera_from_eye, stereo_cameras
from ..scene.working import evaluated, focus_distance, rendered_layer
from .render import Rendered, render_views

CARD_NAME = "Stereo Reproject mask"
"""Name of the card's object, mesh and material."""


def card_blocker(scene: bpy.types.Scene) -> str | None:
    """Return why pixels cannot be traced behind a card in this scene, in words; None if they can."""
    if has_no_screen(scene.camera.data):
        return "a card cannot stand before each ray of a panorama"
    if any(layer.material_override is not None for layer in scene.view_layers if layer.use):
        return "a material override would replace the card's material"
    if uses_output("ShaderNodeLightPath", "Transparent Depth"):
        return "a shader counts transparent surfaces, and the card is one"
    if has_grease_pencil(scene):
        return "Grease Pencil is drawn over the finished render"
    if scene.render.use_simplify and scene.cycles.texture_limit_render != "OFF":
        return "the scene's texture limit would scale the card's mask"
    if scene.render.use_motion_blur and is_animated(scene.camera.data):
        return "the lens is animated and motion blur is on"
    return None


def trace_card(
    scene: bpy.types.Scene, view: str, pixels: NDArray[np.bool_], folder: Path, *, seed: int
) -> tuple[Rendered, Passes]:
    """Trace the pixels of a view that are set in `pixels` (H, W), by a render behind a card. Return the render, and the
    passes (N, C) of those pixels, row by row. folder is private.
    """
    support = filter_support(scene.cycles.pixel_filter_type, scene.cycles.filter_width)
    opening = dilate(pixels, int(np.ceil(0.5 * support)))
    with tempfile.TemporaryDirectory(dir=folder) as tables:
        mask = Path(tables) / "mask.exr"
        value = opening.astype(np.float32)[..., None]
        write_table(mask, np.broadcast_to(value, (*opening.shape, 4)))
        with _card(scene, view, mask):
            rendered = render_views(scene, (view,), folder, seed=seed)
    return rendered, {name: image[pixels] for name, image in rendered.views[view].items()}


@contextmanager
def _card(scene: bpy.types.Scene, view: str, mask: Path) -> Iterator[None]:
    """Have a card before the scene's camera, for the time of a `with` block; it is removed afterwards, also after an
    error. mask is an EXR of the frame's size: 1 where the card is open, 0 where it hides the scene.
    """
    image = bpy.data.images.load(str(mask))
    mesh = bpy.data.meshes.new(CARD_NAME)
    material = bpy.data.materials.new(CARD_NAME)
    card = bpy.data.objects.new(CARD_NAME, mesh)
    most, fewest = scene.cycles.transparent_max_bounces, scene.cycles.min_transparent_bounces
    try:
        image.colorspace_settings.name = "Non-Color"
        _build_mesh(mesh, scene, view)
        _build_material(material, image)
        mesh.materials.append(material)
        _place(card, scene, view)
        scene.collection.objects.link(card)
        # The card is a transparent surface more.
        scene.cycles.transparent_max_bounces = most + 1
        scene.cycles.min_transparent_bounces = fewest + 1
        yield
    finally:
        scene.cycles.transparent_max_bounces = most
        scene.cycles.min_transparent_bounces = fewest
        bpy.data.objects.remove(card)
        bpy.data.meshes.remove(mesh)
        bpy.data.materials.remove(material)
        bpy.data.images.remove(image)
        # Else Blender crashes when it lists what the scene shows: the card that it has evaluated is gone. And
        # scene.view_layers.update() passes over a scene that no window shows.
        rendered_layer(scene).update()


def _build_mesh(mesh: bpy.types.Mesh, scene: bpy.types.Scene, view: str) -> None:
    """Build the card's mesh: the view's plane at a depth at which all rays of a pixel meet. That is the depth in focus,
    or without depth of field any; then it is just behind the near clip.
    """
    camera = evaluated(scene.camera, scene)
    eye = stereo_cameras(camera, scene.render)[view]
    depth = focus_distance(scene) if camera.data.dof.use_dof else 2.0 * camera.data.clip_start
    scale = 1.0 if isinstance(eye, OrthographicCamera) else depth
    plane = eye.plane
    low, high = plane.bottom, plane.top
    corners = [(plane.left, low), (plane.right, low), (plane.right, high), (plane.left, high)]
    mesh.from_pydata([(x * scale, y * scale, -depth) for x, y in corners], [], [(0, 1, 2, 3)])
    uv = mesh.uv_layers.new(name="UVMap")
    uv.data.foreach_set("uv", [0.0, 0.0, 1.0, 0.0, 1.0, 1.0, 0.0, 1.0])


def _build_material(material: bpy.types.Material, image: bpy.types.Image) -> None:
    """Make the material of the card: transparent where the image is 1, a holdout where it is 0."""
    if material.node_tree is None:
        material.use_nodes = True
    nodes, links = material.node_tree.nodes, material.node_tree.links
    nodes.clear()
    texture = nodes.new("ShaderNodeTexImage")
    texture.image, texture.interpolation, texture.extension = image, "Closest", "EXTEND"
    mix, output = nodes.new("ShaderNodeMixShader"), nodes.new("ShaderNodeOutputMaterial")
    links.new(texture.outputs["Color"], mix.inputs[0])
    links.new(nodes.new("ShaderNodeHoldout").outputs[0], mix.inputs[1])
    links.new(nodes.new("ShaderNodeBsdfTransparent").outputs[0], mix.inputs[2])
    links.new(mix.outputs[0], output.inputs["Surface"])


def _place(card: bpy.types.Object, scene: bpy.types.Scene, view: str) -> None:
    """Hang the card on the camera, so that both move together while the shutter is open, and show it to camera rays
    alone.
    """
    camera = evaluated(scene.camera, scene)
    card.parent = scene.camera
    scale = Matrix.Diagonal((*camera.matrix_world.to_scale(), 1.0))
    card.matrix_parent_inverse = scale.inverted()
    card.matrix_basis = Matrix(camera_from_eye(camera.data, view).tolist())
    for name in BLUR_SETTINGS:
        setattr(card.cycles, name, getattr(scene.camera.cycles, name))
    for kind in ("diffuse", "glossy", "transmission", "volume_scatter", "shadow"):
        setattr(card, f"visible_{kind}", False)
