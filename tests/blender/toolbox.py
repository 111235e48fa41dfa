"""What the tests that need Blender share: scenes built from nothing, plain renders of them, and statistics.

A plain render here is Blender's own multiview of the user's scene, untouched by anything of ours: the ruler.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from stereo_reproject.images.exr import read_render
from stereo_reproject.images.passes import COLOUR_PASS, DEPTH_PASS, Passes
from stereo_reproject.views.camera import Camera

EYES = ("left", "right")

FINEST_FILTER = 0.01
"""The smallest pixel filter that Blender takes: a pixel then shows its centre, to a hundredth of a pixel."""


def empty_scene(width: int = 160, height: int = 90, *, samples: int = 1) -> bpy.types.Scene:
    """A new file with nothing in it, set to Cycles without denoising and without adaptive sampling."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.render.resolution_x, scene.render.resolution_y = width, height
    scene.render.threads_mode, scene.render.threads = "FIXED", 2
    scene.cycles.samples = samples
    scene.cycles.use_denoising = False
    scene.cycles.use_adaptive_sampling = False
    scene.view_layers[0].use_pass_z = True
    scene.world = bpy.data.worlds.new("World")
    set_background(scene, 0.0)
    return scene


def add(scene: bpy.types.Scene, item: bpy.types.Object) -> bpy.types.Object:
    scene.collection.objects.link(item)
    return item


def add_camera(
    scene: bpy.types.Scene,
    *,
    interocular: float = 0.3,
    convergence: float = 6.0,
    mode: str = "OFFAXIS",
    pivot: str = "LEFT",
    lens: float = 35.0,
) -> bpy.types.Object:
    """The scene's camera, at the origin and looking along -z."""
    data = bpy.data.cameras.new("Camera")
    camera = add(scene, bpy.data.objects.new("Camera", data))
    data.lens = lens
    data.stereo.interocular_distance, data.stereo.convergence_distance = interocular, convergence
    data.stereo.convergence_mode, data.stereo.pivot = mode, pivot
    scene.camera = camera
    return camera


def set_background(scene: bpy.types.Scene, strength: float) -> None:
    if scene.world.node_tree is None:
        scene.world.use_nodes = True
    nodes = scene.world.node_tree.nodes
    background = next((n for n in nodes if n.bl_idname == "ShaderNodeBackground"), None)
    if background is None:
        background = nodes.new("ShaderNodeBackground")
        output = nodes.new("ShaderNodeOutputWorld")
        scene.world.node_tree.links.new(background.outputs[0], output.inputs[0])
    background.inputs["Color"].default_value = (0.6, 0.8, 1.0, 1.0)
    background.inputs["Strength"].default_value = strength


def empty_compositor(scene: bpy.types.Scene) -> tuple[bpy.types.NodeTree, bpy.types.NodeSocket]:
    """The scene's compositing nodes with nothing in them but their end; the tree, and the socket for the picture."""
    if hasattr(scene, "compositing_node_group"):
        tree = bpy.data.node_groups.new("Compositing", "CompositorNodeTree")
        scene.compositing_node_group = tree
        tree.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
        end = tree.nodes.new("NodeGroupOutput")
    else:
        scene.use_nodes = True
        tree = scene.node_tree
        tree.nodes.clear()
        end = tree.nodes.new("CompositorNodeComposite")
    return tree, end.inputs[0]


def add_compositor(scene: bpy.types.Scene) -> tuple[bpy.types.NodeTree, bpy.types.Node, bpy.types.NodeSocket]:
    """The same with a Render Layers node of this scene, nothing linked: the tree, that node and the socket."""
    tree, result = empty_compositor(scene)
    layers = tree.nodes.new("CompositorNodeRLayers")
    layers.scene = scene
    return tree, layers, result


def mirror_before_wall(width: int, height: int, *, samples: int) -> bpy.types.Scene:
    """A mirror ball before a matte wall: holes, probes and something to refine."""
    scene = empty_scene(width, height, samples=samples)
    add_plane(scene, diffuse("wall"), size=(30, 20), location=(0, 0, -9))
    mirror = Material("mirror")
    add_sphere(scene, mirror.surface(mirror.node("BsdfGlossy")), radius=1.4, location=(0.3, 0.2, -6.0))
    add_sun(scene)
    add_camera(scene)
    return scene


def set_border(scene: bpy.types.Scene, border: tuple[float, float, float, float]) -> None:
    """Render only from left to right and from bottom to top, in shares of the frame."""
    render = scene.render
    render.use_border = True
    render.border_min_x, render.border_max_x, render.border_min_y, render.border_max_y = border


class Material:
    """A material and the few things that tests do to one."""

    def __init__(self, name: str) -> None:
        self.block = bpy.data.materials.new(name)
        if self.block.node_tree is None:
            self.block.use_nodes = True
        self.tree = self.block.node_tree
        self.tree.nodes.clear()
        self.output = self.node("OutputMaterial")

    def node(self, kind: str, **inputs: object) -> bpy.types.Node:
        node = self.tree.nodes.new(f"ShaderNode{kind}")
        for name, value in inputs.items():
            node.inputs[name].default_value = value
        return node

    def link(self, source: bpy.types.NodeSocket, target: bpy.types.NodeSocket) -> None:
        self.tree.links.new(source, target)

    def surface(self, shader: bpy.types.Node) -> Material:
        self.link(shader.outputs[0], self.output.inputs["Surface"])
        return self

    def texture(self, image: bpy.types.Image) -> bpy.types.NodeSocket:
        texture = self.node("TexImage")
        texture.image = image
        coordinates = self.node("TexCoord")
        self.link(coordinates.outputs["UV"], texture.inputs["Vector"])
        return texture.outputs["Color"]


def diffuse(name: str = "diffuse", colour: tuple = (0.8, 0.8, 0.8), image: bpy.types.Image | None = None) -> Material:
    material = Material(name)
    shader = material.node("BsdfDiffuse", Color=(*colour, 1.0))
    if image is not None:
        material.link(material.texture(image), shader.inputs["Color"])
    return material.surface(shader)


def emission(
    name: str = "emission", colour: tuple = (1.0, 1.0, 1.0), image: bpy.types.Image | None = None, strength: float = 1.0
) -> Material:
    material = Material(name)
    shader = material.node("Emission", Color=(*colour, 1.0), Strength=strength)
    if image is not None:
        material.link(material.texture(image), shader.inputs["Color"])
    return material.surface(shader)


def add_plane(
    scene: bpy.types.Scene,
    material: Material,
    *,
    size: tuple[float, float] = (2.0, 2.0),
    location: tuple = (0.0, 0.0, 0.0),
    rotation: tuple = (0.0, 0.0, 0.0),
) -> bpy.types.Object:
    mesh = bpy.data.meshes.new("Plane")
    x, y = 0.5 * size[0], 0.5 * size[1]
    mesh.from_pydata([(-x, -y, 0), (x, -y, 0), (x, y, 0), (-x, y, 0)], [], [(0, 1, 2, 3)])
    mesh.uv_layers.new(name="UVMap").data.foreach_set("uv", [0.0, 0.0, 1.0, 0.0, 1.0, 1.0, 0.0, 1.0])
    mesh.materials.append(material.block)
    plane = add(scene, bpy.data.objects.new("Plane", mesh))
    plane.location, plane.rotation_euler = location, rotation
    return plane


def add_cube(
    scene: bpy.types.Scene, material: Material, *, size: float = 1.0, location: tuple, rotation: tuple = (0.3, 0.4, 0.5)
) -> bpy.types.Object:
    mesh = bpy.data.meshes.new("Cube")
    h = 0.5 * size
    corners = [(x, y, z) for x in (-h, h) for y in (-h, h) for z in (-h, h)]
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    mesh.from_pydata(corners, [], faces)
    mesh.uv_layers.new(name="UVMap").data.foreach_set("uv", [0.0, 0.0, 1.0, 0.0, 1.0, 1.0, 0.0, 1.0] * 6)
    mesh.materials.append(material.block)
    cube = add(scene, bpy.data.objects.new("Cube", mesh))
    cube.location, cube.rotation_euler = location, rotation
    return cube


def add_sphere(scene: bpy.types.Scene, material: Material, *, radius: float = 0.5, location: tuple) -> bpy.types.Object:
    bpy.ops.mesh.primitive_uv_sphere_add(radius=radius, location=location, segments=32, ring_count=16)
    sphere = bpy.context.object
    sphere.data.materials.append(material.block)
    for polygon in sphere.data.polygons:
        polygon.use_smooth = True
    return sphere


def add_sun(scene: bpy.types.Scene, *, strength: float = 3.0, rotation: tuple = (-0.6, 0.3, 0.0)) -> bpy.types.Object:
    """Unless told otherwise it shines from above and behind a camera that looks along -z."""
    light = bpy.data.lights.new("Sun", "SUN")
    light.energy = strength
    sun = add(scene, bpy.data.objects.new("Sun", light))
    sun.rotation_euler = rotation
    return sun


def noise_image(folder: Path, *, size: int = 64, seed: int = 1, name: str = "noise") -> bpy.types.Image:
    """A picture of random colours from 0.1 to 1, saved, because Cycles reads what it renders from files."""
    values = np.ones((size, size, 4), np.float32)
    values[..., :3] = np.random.default_rng(seed).uniform(0.1, 1.0, (size, size, 3))
    return save_image(folder / f"{name}.png", values)


def save_image(path: Path, values: NDArray[np.float32]) -> bpy.types.Image:
    """(H, W, 4), as they are (no colour space), in 8 bits."""
    image = bpy.data.images.new(path.stem, values.shape[1], values.shape[0])
    image.colorspace_settings.name = "Non-Color"
    image.pixels.foreach_set(np.ascontiguousarray(values[::-1], np.float32).ravel())
    image.file_format, image.filepath_raw = "PNG", str(path)
    image.save()
    bpy.data.images.remove(image)
    image = bpy.data.images.load(str(path))
    image.colorspace_settings.name = "Non-Color"
    return image


def keyframes(item: bpy.types.ID, path: str, values: dict[int, object]) -> None:
    """Key `path` to `values` by frame, straight lines in between, so that speed is constant while a shutter is open."""
    for frame, value in values.items():
        setattr(item, path, value)
        item.keyframe_insert(path, frame=frame)
    for curve in fcurves(item):
        for point in curve.keyframe_points:
            point.interpolation = "LINEAR"


def fcurves(item: bpy.types.ID) -> list[bpy.types.FCurve]:
    """The curves of an item's action, in which slots and layers stand from 4.4 on."""
    action, slot = item.animation_data.action, item.animation_data.action_slot
    return [
        curve
        for layer in action.layers
        for strip in layer.strips
        for curve in strip.channelbag(slot, ensure=True).fcurves
    ]


def render_plain(
    scene: bpy.types.Scene, folder: Path, *, seed: int | None = None, views: tuple[str, ...] = EYES
) -> dict[str, Passes]:
    """Blender's own multiview of the scene as it stands, every pass of the first view layer, by view name; sky has the
    depth +inf."""
    eyes = render_plain_layers(scene, folder, seed=seed, views=views)
    return {view: next(iter(layers.values())) for view, layers in eyes.items()}


def render_plain_layers(
    scene: bpy.types.Scene,
    folder: Path,
    *,
    seed: int | None = None,
    views: tuple[str, ...] = EYES,
    texts: dict[str, str] | None = None,
) -> dict[str, dict[str, Passes]]:
    """The same of all view layers, by view and then by layer; texts takes those in the header of Blender's file."""
    render = scene.render
    render.use_multiview, render.views_format = True, "STEREO_3D"
    for view in render.views:
        view.use = view.name in views
    if seed is not None:
        scene.cycles.seed = seed
    settings = render.image_settings
    if hasattr(settings, "media_type"):
        settings.media_type = "MULTI_LAYER_IMAGE"
    settings.file_format, settings.color_depth, settings.exr_codec = "OPEN_EXR_MULTILAYER", "32", "NONE"
    settings.views_format = "MULTIVIEW"
    path = folder / "plain.exr"
    render.filepath = str(path)
    bpy.ops.render.render(scene=scene.name, write_still=True)
    used = [layer.name for layer in scene.view_layers if layer.use]
    result: dict[str, dict[str, Passes]] = {view: {} for view in views}
    for view in views:
        for layer in used:
            result[view][layer], found = read_render(path, layer=layer, view=view)
            (texts if texts is not None else {}).update(found)
    path.unlink()
    for passes in (passes for layers in result.values() for passes in layers.values()):
        if DEPTH_PASS in passes:
            passes[DEPTH_PASS][passes[DEPTH_PASS] >= 1e9] = np.inf
    return result


def evaluated_camera(scene: bpy.types.Scene) -> bpy.types.Object:
    layer = scene.view_layers[0]
    layer.update()
    return scene.camera.evaluated_get(layer.depsgraph)


def pixel_centres(shape: tuple[int, int]) -> tuple[NDArray, NDArray]:
    """x and y, (H, W) each."""
    rows, columns = np.indices(shape)
    return columns + 0.5, rows + 0.5


def px_from_world(camera: Camera, points: NDArray) -> tuple[NDArray, NDArray, NDArray]:
    """Pixel position and depth of world-space points (..., 3)."""
    world = np.asarray(points, np.float64)
    camera_from_world = np.linalg.inv(camera.world_from_camera)
    local = world @ camera_from_world[:3, :3].T + camera_from_world[:3, 3]
    return camera.px_from_point((local[..., 0], local[..., 1], local[..., 2]), np.ones(local.shape[:-1]))


def rms(values: NDArray) -> float:
    return float(np.sqrt(np.mean(np.square(values, dtype=np.float64))))


def colour(passes: Passes) -> NDArray[np.float32]:
    return passes[COLOUR_PASS][..., :3]


SceneChange = Callable[[bpy.types.Scene], None]
"""What a variant of a test does to the scene before it is rendered."""
