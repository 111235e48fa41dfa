"""Makers of scenes with odd materials, nodes and volumes.

Where no exit status is named a pair must come of it: Blender renders such a scene too. What is odd about a scene is
said in the case's name, and so the makers have none.
"""

from __future__ import annotations

import bpy

from tests.blender.toolbox import Material, add_cube, add_sphere
from tests.hostile.blends import DONE, EITHER, odd, several
from tests.hostile.small_scenes import NAN, broken_number, odd_material


@several("emission of", ["infinite", "nan"])
def _(scene, kind):
    made = odd_material(scene)
    shader = made.node("Emission")
    made.link(broken_number(made, kind), shader.inputs["Strength"])
    made.surface(shader)


@several("colour of", ["infinite", "nan"])
def _(scene, kind):
    made = odd_material(scene)
    shader = made.node("BsdfDiffuse")
    made.link(broken_number(made, kind), shader.inputs["Color"])
    made.surface(shader)


@several("bump of", ["infinite", "nan"])
def _(scene, kind):
    made = odd_material(scene)
    shader = made.node("BsdfPrincipled")
    bump = made.node("Bump")
    made.link(broken_number(made, kind), bump.inputs["Height"])
    made.link(bump.outputs[0], shader.inputs["Normal"])
    made.surface(shader)


@several("displacement of", ["infinite", "nan"])
def _(scene, kind):
    made = odd_material(scene)
    made.surface(made.node("BsdfPrincipled"))
    made.block.displacement_method = "DISPLACEMENT"
    made.link(broken_number(made, kind), made.output.inputs["Displacement"])


@several("refraction index", [0.0, -1.0, 1e20])
def _(scene, index):
    made = odd_material(scene)
    made.surface(made.node("BsdfGlass", IOR=index))


@several("roughness of a mirror", [-1.0, 1e20])
def _(scene, roughness):
    made = odd_material(scene)
    made.surface(made.node("BsdfGlossy", Roughness=roughness))


@several("strength of emission", [-5.0, 1e30])
def _(scene, strength):
    made = odd_material(scene)
    made.surface(made.node("Emission", Strength=strength))


@odd("a world that shines NaN")
def _(scene):
    tree = scene.world.node_tree
    node = tree.nodes.new("ShaderNodeMath")
    node.operation = "SUBTRACT"
    for socket in node.inputs[:2]:
        huge = tree.nodes.new("ShaderNodeMath")
        huge.operation = "MULTIPLY"
        huge.inputs[0].default_value = huge.inputs[1].default_value = 3e38
        tree.links.new(huge.outputs[0], socket)
    tree.links.new(node.outputs[0], tree.nodes["Background"].inputs["Strength"])


@odd("an AOV of NaN")
def _(scene):
    scene.view_layers[0].aovs.add().name = "odd"
    made = odd_material(scene)
    made.surface(made.node("BsdfDiffuse"))
    aov = made.node("OutputAOV")
    aov.aov_name = "odd"
    made.link(broken_number(made, "nan"), aov.inputs["Color"])


@odd("shader nodes linked in a circle")
def _(scene):
    made = odd_material(scene)
    first, second = made.node("MixShader"), made.node("MixShader")
    made.link(first.outputs[0], second.inputs[1])
    made.link(second.outputs[0], first.inputs[1])
    made.surface(first)


@odd("reroutes linked in a circle")
def _(scene):
    made = odd_material(scene)
    first, second = made.tree.nodes.new("NodeReroute"), made.tree.nodes.new("NodeReroute")
    made.link(first.outputs[0], second.inputs[0])
    made.link(second.outputs[0], first.inputs[0])
    made.link(second.outputs[0], made.output.inputs["Surface"])


@odd("a node group that is in itself", EITHER)
def _(scene):
    made = odd_material(scene)
    tree = bpy.data.node_groups.new("Loop", "ShaderNodeTree")
    inner = tree.nodes.new("ShaderNodeGroup")
    outer = made.tree.nodes.new("ShaderNodeGroup")
    outer.node_tree = tree
    inner.node_tree = tree
    made.surface(made.node("Emission"))


@odd("a node group of nothing, muted nodes, a shader where a number belongs")
def _(scene):
    made = odd_material(scene)
    group, shader = made.tree.nodes.new("ShaderNodeGroup"), made.node("BsdfDiffuse")
    shader.mute = True
    made.link(shader.outputs[0], made.output.inputs["Displacement"])
    made.surface(shader)
    made.node("Value")
    assert group.node_tree is None


@odd("node groups forty deep")
def _(scene):
    tree = None
    for level in range(40):
        outer = bpy.data.node_groups.new(f"Level {level}", "ShaderNodeTree")
        outer.interface.new_socket("Shader", in_out="OUTPUT", socket_type="NodeSocketShader")
        end = outer.nodes.new("NodeGroupOutput")
        inner = outer.nodes.new("ShaderNodeEmission" if tree is None else "ShaderNodeGroup")
        if tree is not None:
            inner.node_tree = tree
        outer.links.new(inner.outputs[0], end.inputs[0])
        tree = outer
    made = odd_material(scene)
    group = made.tree.nodes.new("ShaderNodeGroup")
    group.node_tree = tree
    made.surface(group)


@odd("a node of a kind that nobody knows")
def _(scene):
    class Unknown(bpy.types.ShaderNodeCustomGroup):
        bl_idname, bl_label = "ShaderNodeNobodyKnows", "Unknown"

    bpy.utils.register_class(Unknown)
    made = odd_material(scene)
    made.tree.nodes.new("ShaderNodeNobodyKnows")
    made.surface(made.node("BsdfDiffuse"))
    bpy.utils.unregister_class(Unknown)


@odd("a script node without its script, a texture without its file", DONE, "missing")
def _(scene):
    scene.cycles.shading_system = True
    made = odd_material(scene)
    script = made.node("Script")
    script.mode, script.filepath = "EXTERNAL", "//gone.osl"
    image = bpy.data.images.new("gone", 4, 4)
    image.source, image.filepath = "FILE", "//gone.png"
    texture = made.node("TexImage")
    texture.image = image
    shader = made.node("BsdfDiffuse")
    made.link(texture.outputs[0], shader.inputs["Color"])
    made.surface(shader)


@several("a picture of", ["no pixels", "tiles that are not there", "a film that is not there"])
def _(scene, what):
    made = odd_material(scene)
    image = bpy.data.images.new("odd", 1, 1, tiled="tiles" in what)
    if "film" in what:
        image.source, image.filepath = "MOVIE", "//gone.mp4"
    if "tiles" in what:
        image.filepath = "//gone.<UDIM>.png"
    texture = made.node("TexImage")
    texture.image = None if what == "no pixels" else image
    shader = made.node("BsdfDiffuse")
    made.link(texture.outputs[0], shader.inputs["Color"])
    made.surface(shader)


@odd("volumes everywhere, one in the other")
def _(scene):
    tree = scene.world.node_tree
    fog = tree.nodes.new("ShaderNodeVolumeScatter")
    fog.inputs["Density"].default_value = 0.1
    output = next(node for node in tree.nodes if node.bl_idname == "ShaderNodeOutputWorld")
    tree.links.new(fog.outputs[0], output.inputs["Volume"])
    for size in (1.0, 3.0, 8.0):
        made = Material("fog")
        made.link(made.node("VolumePrincipled", Density=0.5).outputs[0], made.output.inputs["Volume"])
        add_cube(scene, made, size=size, location=(0.0, 0.0, -5.0))


@several("a volume as dense as", [0.0, 1e20])
@several("a volume as dense as", [NAN, -1.0], EITHER)
def _(scene, density):
    made = odd_material(scene)
    made.link(made.node("VolumeScatter", Density=density).outputs[0], made.output.inputs["Volume"])


@odd("a glass ball in a glass ball in a glass ball, without bounces")
def _(scene):
    for radius in (0.4, 0.6, 0.8):
        made = Material("glass")
        add_sphere(scene, made.surface(made.node("BsdfGlass")), radius=radius, location=(0.0, 0.0, -4.0))
    scene.cycles.max_bounces = 0
    scene.cycles.transparent_max_bounces = 0
