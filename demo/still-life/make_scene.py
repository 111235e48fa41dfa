"""The demo's scene, made from nothing: a table by a window, with books, fruit, a jug of twigs, a candle and a cup.

    python demo/still-life/make_scene.py demo/still-life/still-life.blend

Lengths are in metres. Everything is matte, as clay, paper, cloth and oiled wood are.
"""

from __future__ import annotations

import math
import random
import sys
from collections.abc import Sequence
from functools import partial

import bpy
from mathutils import Vector

Triple = tuple[float, float, float]
Profile = Sequence[tuple[float, float]]


def matte(name: str, dark: Triple, light: Triple | None = None, *, scale: Triple = (1.0, 1.0, 1.0), bands: float = 0.0):
    """Return a diffuse material between two colours (linear RGB), mixed by noise in the object's own space.

    scale is that of the noise along each axis. bands, if not 0, is the scale of a wave texture in its place: stripes
    across X, 20 / 2π × bands of them a metre.
    """
    material = bpy.data.materials.new(name)
    material.use_nodes = True
    nodes, links = material.node_tree.nodes, material.node_tree.links
    nodes.clear()
    output, diffuse = nodes.new("ShaderNodeOutputMaterial"), nodes.new("ShaderNodeBsdfDiffuse")
    links.new(diffuse.outputs["BSDF"], output.inputs["Surface"])
    diffuse.inputs["Color"].default_value = (*dark, 1.0)
    if light is None:
        return material
    place, stretch = nodes.new("ShaderNodeTexCoord"), nodes.new("ShaderNodeMapping")
    ramp = nodes.new("ShaderNodeValToRGB")
    stretch.inputs["Scale"].default_value = scale
    links.new(place.outputs["Object"], stretch.inputs["Vector"])
    if bands:
        pattern = nodes.new("ShaderNodeTexWave")
        pattern.inputs["Scale"].default_value = bands
        ramp.color_ramp.interpolation = "CONSTANT"
    else:
        pattern = nodes.new("ShaderNodeTexNoise")
        pattern.inputs["Detail"].default_value = 8.0
    links.new(stretch.outputs["Vector"], pattern.inputs["Vector"])
    links.new(pattern.outputs["Factor" if "Factor" in pattern.outputs else "Fac"], ramp.inputs["Fac"])
    links.new(ramp.outputs["Color"], diffuse.inputs["Color"])
    for element, colour, position in zip(ramp.color_ramp.elements, (dark, light), (0.35, 0.65), strict=True):
        element.color, element.position = (*colour, 1.0), position
    return material


def mesh(name: str, vertices: Sequence[Sequence[float]], faces: Sequence[Sequence[int]], material, *, smooth=False):
    """Return a new object of these vertices and faces, with a material, in the scene."""
    data = bpy.data.meshes.new(name)
    data.from_pydata(vertices, [], faces)
    data.materials.append(material)
    data.polygons.foreach_set("use_smooth", [smooth] * len(data.polygons))
    made = bpy.data.objects.new(name, data)
    bpy.context.scene.collection.objects.link(made)
    return made


def box(name: str, middle: Sequence[float], size: Sequence[float], material, *, turn: float = 0.0, bevel: float = 0.0):
    """Return a box around `middle`, turned by `turn` degrees around Z, its edges rounded by `bevel` metres."""
    x, y, z = (0.5 * length for length in size)
    corners = [(i * x, j * y, k * z) for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)]
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    made = mesh(name, corners, faces, material)
    made.location, made.rotation_euler = middle, (0.0, 0.0, math.radians(turn))
    if bevel:
        rounded = made.modifiers.new("Bevel", "BEVEL")
        rounded.width, rounded.segments = bevel, 3
    return made


def subdivided(made):
    """Return an object, made smoother by one level of subdivision."""
    smooth = made.modifiers.new("Subdivision", "SUBSURF")
    smooth.levels = smooth.render_levels = 1
    return made


def turned(name: str, profile: Profile, middle: Sequence[float], material, *, segments: int = 64):
    """Return the surface of revolution, of `segments` sides, of (radius, height) pairs, standing at `middle`."""
    vertices = [
        (radius * math.cos(angle), radius * math.sin(angle), height)
        for radius, height in profile
        for angle in (2.0 * math.pi * k / segments for k in range(segments))
    ]
    faces = [
        (low + k, low + (k + 1) % segments, high + (k + 1) % segments, high + k)
        for low, high in ((row * segments, (row + 1) * segments) for row in range(len(profile) - 1))
        for k in range(segments)
    ]
    made = mesh(name, vertices, faces, material, smooth=True)
    made.location = middle
    return subdivided(made)


def ball(name: str, middle: Sequence[float], radius: float, material, *, flat: float = 0.93):
    """Return a ball, a little flattened, around `middle`. All of one name share a mesh and its material."""
    if name not in bpy.data.meshes:
        steps = [math.pi * k / 16 for k in range(17)]
        turned(name, [(max(math.sin(a), 1e-3), -math.cos(a)) for a in steps], middle, material, segments=24)
        bpy.data.objects.remove(bpy.data.objects[name])
    made = bpy.data.objects.new(name, bpy.data.meshes[name])
    bpy.context.scene.collection.objects.link(made)
    made.location, made.scale = middle, (radius, radius, flat * radius)
    return subdivided(made)


def twig(points: Sequence[Sequence[float]], material, *, radius: float) -> None:
    """Add a twig along these points, thinner towards its end."""
    curve = bpy.data.curves.new("Twig", "CURVE")
    curve.dimensions, curve.bevel_depth, curve.bevel_resolution = "3D", radius, 2
    spline = curve.splines.new("NURBS")
    spline.points.add(len(points) - 1)
    for k, (point, place) in enumerate(zip(spline.points, points, strict=True)):
        point.co, point.radius = (*place, 1.0), 1.0 - 0.6 * k / len(points)
    spline.use_endpoint_u = True
    curve.materials.append(material)
    bpy.context.scene.collection.objects.link(bpy.data.objects.new("Twig", curve))


def books() -> None:
    """Add a stack of three books on the left."""
    paper = matte("Paper", (0.70, 0.65, 0.53), (0.80, 0.75, 0.63), scale=(1.0, 1.0, 220.0))
    covers = [(0.32, 0.07, 0.05), (0.06, 0.16, 0.26), (0.52, 0.36, 0.10)]
    bottom = 0.0
    for k, (colour, turn, thick) in enumerate(zip(covers, (8.0, -6.0, 14.0), (0.045, 0.035, 0.05), strict=True)):
        cloth = matte(f"Cover {k}", colour, tuple(1.25 * c for c in colour), scale=(300.0, 300.0, 300.0))
        wide, deep = 0.27 - 0.03 * k, 0.19 - 0.015 * k
        at = Vector((-0.42, 0.12, bottom + 0.5 * thick))
        box(f"Pages {k}", at, (wide - 0.012, deep - 0.012, thick - 0.008), paper, turn=turn)
        for side in (-1, 1):
            box(f"Board {k}", at + Vector((0, 0, side * (0.5 * thick - 0.002))), (wide, deep, 0.004), cloth, turn=turn)
        spine = Vector((0.0, -0.5 * deep, 0.0))
        spine.rotate(bpy.data.objects[f"Pages {k}"].rotation_euler.to_matrix())
        box(f"Spine {k}", at + spine, (wide, 0.006, thick), cloth, turn=turn)
        bottom += thick


def fruit(clay) -> None:
    """Add a bowl of oranges in the middle, and one beside it."""
    turned("Bowl", [(0.001, 0.0), (0.055, 0.0), (0.06, 0.012), (0.10, 0.045), (0.135, 0.095), (0.14, 0.1),
                    (0.132, 0.098), (0.095, 0.052), (0.05, 0.022), (0.001, 0.018)], (0.02, 0.0, 0.0), clay)  # fmt: skip
    peel = matte("Peel", (0.75, 0.22, 0.02), (0.85, 0.33, 0.04), scale=(60.0, 60.0, 60.0))
    places = [(-0.035, -0.03, 0.072), (0.075, -0.02, 0.075), (0.02, 0.06, 0.075), (0.025, 0.005, 0.135)]
    for place in [*places, (0.215, -0.13, 0.04)]:
        ball("Orange", place, 0.044, peel)


def stem_point(foot: Vector, lean: Vector, height: float, t: float) -> Vector:
    """Return the point of a twig at t, from 0 in the jug that stands at `foot` to 1 at its end.

    lean is how far aside the end is; height is that of the end above the foot.
    """
    return foot + lean * t**1.6 + Vector((0.0, 0.0, 0.12 + (height - 0.12) * t))


def jug(glaze) -> None:
    """Add a jug with twigs on the right, which end in small blossoms."""
    foot = Vector((0.38, 0.16, 0.0))
    turned("Jug", [(0.001, 0.0), (0.06, 0.0), (0.075, 0.02), (0.09, 0.08), (0.082, 0.15), (0.045, 0.21), (0.04, 0.24),
                   (0.052, 0.265), (0.046, 0.264), (0.034, 0.238), (0.038, 0.21), (0.07, 0.15)],
           foot, glaze)  # fmt: skip
    bark, petal = matte("Bark", (0.10, 0.06, 0.035)), matte("Petal", (0.78, 0.52, 0.55), (0.88, 0.74, 0.72))
    dice = random.Random(5)
    for _ in range(11):
        angle, lean = dice.uniform(0.0, 2.0 * math.pi), dice.uniform(0.05, 0.22)
        out = Vector((math.cos(angle), math.sin(angle), 0.0))
        height = dice.uniform(0.36, 0.54)
        stem = partial(stem_point, foot, lean * out, height)
        twig([stem(t) for t in (0.0, 0.3, 0.55, 0.8, 1.0)], bark, radius=0.0028)
        for _ in range(6):
            at = stem(dice.uniform(0.55, 1.0)) + 0.012 * Vector(
                (dice.uniform(-1, 1), dice.uniform(-1, 1), dice.uniform(-1, 1))
            )
            ball("Blossom", at, dice.uniform(0.007, 0.012), petal, flat=0.8)


def candle_and_cup(clay) -> None:
    """Add a candlestick on the left, behind the books, and a cup in front."""
    turned("Candlestick", [(0.001, 0.0), (0.06, 0.0), (0.058, 0.012), (0.018, 0.03), (0.014, 0.12), (0.022, 0.15),
                           (0.03, 0.165), (0.03, 0.17), (0.001, 0.168)], (-0.16, 0.3, 0.0), clay)  # fmt: skip
    wax = matte("Wax", (0.82, 0.78, 0.66))
    turned("Candle", [(0.012, 0.165), (0.012, 0.33), (0.008, 0.335), (0.001, 0.334)], (-0.16, 0.3, 0.0), wax)
    turned("Cup", [(0.001, 0.0), (0.028, 0.0), (0.036, 0.01), (0.041, 0.045), (0.042, 0.075), (0.039, 0.075),
                   (0.037, 0.045), (0.03, 0.012), (0.001, 0.008)], (-0.17, -0.16, 0.004), clay)  # fmt: skip


def room() -> None:
    """Add the floor, the table, a striped runner on it, the wall behind, and a picture on the wall."""
    wood = matte("Wood", (0.20, 0.10, 0.045), (0.34, 0.19, 0.09), scale=(2.0, 26.0, 26.0))
    for k in range(5):
        box(f"Plank {k}", (0.0, -0.42 + 0.22 * k, -0.02), (1.9, 0.217, 0.04), wood, bevel=0.003)
    stripes = matte("Runner", (0.62, 0.56, 0.45), (0.16, 0.24, 0.27), bands=14.0)
    rows = [(-0.62 + 1.24 * i / 60, -0.26 + 0.40 * j / 20) for i in range(61) for j in range(21)]
    cloth = [(x, y, 0.0025 + 0.0015 * math.sin(26 * x + 9 * y) * math.cos(17 * y)) for x, y in rows]
    quads = [(i * 21 + j, (i + 1) * 21 + j, (i + 1) * 21 + j + 1, i * 21 + j + 1) for i in range(60) for j in range(20)]
    mesh("Runner", cloth, quads, stripes, smooth=True)
    plaster = matte("Plaster", (0.42, 0.45, 0.42), (0.50, 0.53, 0.49), scale=(9.0, 9.0, 9.0))
    box("Wall", (0.0, 1.45, 0.8), (6.0, 0.1, 3.6), plaster)
    box("Floor", (0.0, 0.0, -0.8), (6.0, 4.0, 0.1), wood)
    frame = matte("Frame", (0.12, 0.07, 0.04))
    for x, z, wide, high in (
        (0.0, 0.21, 0.5, 0.03),
        (0.0, -0.21, 0.5, 0.03),
        (-0.235, 0.0, 0.03, 0.4),
        (0.235, 0.0, 0.03, 0.4),
    ):
        box("Frame", (-0.52 + x, 1.385, 0.44 + z), (wide, 0.03, high), frame, bevel=0.004)
    box("Card", (-0.52, 1.392, 0.44), (0.45, 0.01, 0.4), matte("Card", (0.72, 0.70, 0.64)))
    sun, hill = (
        matte("Sun", (0.62, 0.20, 0.06)),
        matte("Hill", (0.10, 0.20, 0.19), (0.16, 0.29, 0.25), scale=(8.0, 8.0, 8.0)),
    )
    disc = [(0.07 * math.cos(a), 0.0, 0.07 * math.sin(a)) for a in (2 * math.pi * k / 48 for k in range(48))]
    mesh("Sun", disc, [tuple(range(48))], sun).location = (-0.46, 1.3855, 0.50)
    ridge = [
        (-0.225 + 0.45 * k / 40, 0.0, -0.07 + 0.035 * math.sin(0.27 * k) + 0.02 * math.sin(0.7 * k)) for k in range(41)
    ]
    low = [(0.225, 0.0, -0.2), (-0.225, 0.0, -0.2)]
    mesh("Hill", [*ridge, *low], [tuple(range(43))], hill).location = (-0.52, 1.3852, 0.44)


def light() -> None:
    """Add a window's light from the left and the sky's faint light around."""
    window = bpy.data.lights.new("Window", "AREA")
    window.shape, window.size, window.size_y, window.energy = "RECTANGLE", 1.1, 1.5, 110.0
    window.color = (1.0, 0.93, 0.82)
    lamp = bpy.data.objects.new("Window", window)
    lamp.location = (-2.0, -0.7, 1.35)
    lamp.rotation_euler = (Vector((0.0, 0.2, 0.1)) - lamp.location).to_track_quat("-Z", "Y").to_euler()
    bpy.context.scene.collection.objects.link(lamp)
    world = bpy.data.worlds.new("Sky")
    world.use_nodes = True
    background = next(n for n in world.node_tree.nodes if n.type == "BACKGROUND")
    background.inputs["Color"].default_value = (0.62, 0.74, 1.0, 1.0)
    background.inputs["Strength"].default_value = 0.35
    bpy.context.scene.world = world


def camera() -> None:
    """Add the camera with its stereo settings: eyes 40 mm apart, zero parallax at the bowl."""
    lens = bpy.data.cameras.new("Camera")
    lens.lens = 40.0
    eye = bpy.data.objects.new("Camera", lens)
    eye.location = (0.05, -1.6, 0.56)
    eye.rotation_euler = (Vector((-0.02, 0.1, 0.205)) - eye.location).to_track_quat("-Z", "Y").to_euler()
    bpy.context.scene.collection.objects.link(eye)
    bpy.context.scene.camera = eye
    lens.stereo.convergence_mode = "OFFAXIS"
    lens.stereo.interocular_distance, lens.stereo.convergence_distance = 0.04, 1.65


def main(path: str) -> None:
    """Make the scene and save it to `path`."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    clay = matte("Clay", (0.50, 0.40, 0.31), (0.56, 0.46, 0.36), scale=(30.0, 30.0, 30.0))
    glaze = matte("Slip", (0.10, 0.22, 0.27), (0.14, 0.28, 0.33), scale=(14.0, 14.0, 5.0))
    room()
    books()
    light()
    camera()
    fruit(clay)
    jug(glaze)
    candle_and_cup(clay)
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.render.resolution_x, scene.render.resolution_y = 960, 540
    scene.cycles.samples, scene.cycles.use_adaptive_sampling, scene.cycles.use_denoising = 64, False, False
    bpy.context.preferences.filepaths.save_version = 0  # no backup beside it
    bpy.ops.wm.save_as_mainfile(filepath=path, compress=True)


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: python make_scene.py FILE.blend")
    main(sys.argv[1])
