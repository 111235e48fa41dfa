"""Makers of scenes with odd names in them: of datablocks, passes, views, files, whatever Blender lets one name.

All are rendered as others are, and nothing of ours is written outside of the output folder.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterable
from pathlib import Path

import bpy

from stereo_reproject.sequence.journal_folder import JOURNAL
from tests.blender.toolbox import Material, add_compositor
from tests.hostile.blends import DONE, EITHER, OUTSIDE, NotInThisBlenderError, odd

MODERN = bpy.app.version >= (5, 0)

PATHS = {
    "slash": "a/b",
    "backslash": "a\\b",
    "dots": "..",
    "a way out": "../../out_of_here",
    "absolute": f"{OUTSIDE}/x",
    "a drive": "C:\\x",
    "beside the blend": "//x",
    "home": "~/x",
}
SIGNS = {
    "template": "{frame} {blend_dir} {nope}",
    "open brace": "{",
    "braces": "}}{{",
    "hashes": "a####b",
    "percent": "%d %s %n %(name)s",
    "line end": "two\nlines",
    "control": "bell\x07 tab\t back\x08",
    "terminal": "\x1b[31mred\x1b[0m\x1b]0;title\x07",
    "quotes": "a'b\"c`d",
    "shell": "$(touch x); rm *",
    "option": "--overwrite",
    "dot": ".",
    "inner dots": "a.b.c",
    "trailing dot": "name.",
    "trailing space": "name ",
    "space": " ",
    "comma": "a,b;c:d=e",
    "markup": "<b>&amp;]]></b>",
    "number suffix": "Cube.001.002",
}
LETTERS = {
    "umlauts": "äöü ÄÖÜ ß",
    "composed of two": "e\u0301o\u0308",
    "Japanese": "日本語の名前",
    "Arabic": "مشهد \u202egnippilf",
    "emoji": "👩\u200d👩\u200d👧 🎬",
    "no width": "\u200b\ufeff",
    "dotless i": "ıİiI",
    "63 bytes": "x" * 63,
    "255 bytes": "y" * 255,
    "255 bytes of umlauts": "ü" * 127,
}
OURS = {
    name: name
    for name in ("stereo_reproject", "left", "right", "Combined", "Depth", "ViewLayer", "Alpha", "R", "A", "None")
}
ALL = {**PATHS, **SIGNS, **LETTERS, **OURS}

ENCODING = b"QQQQQQQQQQ"
BROKEN = {
    "no UTF-8": b"\xff\xfe\x80abc\xc3(zz",
    "half a letter": b"abcdefghi\xc3",
    "a surrogate": b"abc\xed\xa0\x80xyzz",
    "overlong": b"abc\xc0\xafdefgh",
}
"""Bytes that Blender's interface lets nobody enter, and files hold all the same."""


def chosen(*names: str) -> dict[str, str]:
    """Names of all by what is odd about them."""
    return {name: ALL[name] for name in names}


def each(
    kind: str,
    names: dict[str, str],
    *,
    broken: Iterable[str] = (),
    says: tuple[str, ...] = (),
    statuses: tuple[int, ...] = DONE,
    **more,
) -> Callable:
    """A case for each name: the maker gets the scene and the name."""

    def register(maker):
        for what, name in names.items():
            odd(f"{kind}: {what}", statuses, *says, **more)(lambda scene, name=name: maker(scene, name))
        for what in broken:
            # Either is right: to render it, or to say that the name is none.
            odd(f"{kind}: {what}", EITHER, **more)(lambda scene, what=what: in_bytes(maker, scene, BROKEN[what]))
        return maker

    return register


def in_bytes(maker, scene, content: bytes) -> dict[bytes, bytes]:
    """The maker's scene with a name that has a mark in it, and what is to take the mark's place in the file."""
    maker(scene, ENCODING.decode())
    return {ENCODING: content}


def short(name: str, length: int = 63) -> str:
    """Where 4.5 takes no more bytes."""
    return name.encode()[:length].decode(errors="ignore")


# Datablocks


@each("scene", ALL, broken=BROKEN)
def _(scene, name):
    scene.name = name


@each(
    "scene of an animation",
    chosen("slash", "a way out", "absolute", "template", "line end", "terminal"),
    broken=["no UTF-8"],
    command="animate",
)
def _(scene, name):
    scene.name = name


@each(
    "camera",
    chosen("slash", "dots", "line end", "63 bytes", "left", "Japanese", "stereo_reproject"),
    broken=["no UTF-8"],
)
def _(scene, name):
    scene.camera.name = scene.camera.data.name = name


@each(
    "every object, with cryptomatte",
    chosen(
        "slash", "line end", "quotes", "255 bytes", "emoji", "Combined", "comma", "inner dots", "markup", "terminal"
    ),
    broken=BROKEN,
)
def _(scene, name):
    scene.view_layers[0].use_pass_cryptomatte_object = True
    scene.view_layers[0].use_pass_cryptomatte_material = True
    for item in list(scene.objects):
        item.name = name
        if item.data:
            item.data.name = name


@each("material", chosen("slash", "quotes", "line end", "255 bytes", "Arabic", "None", "template"), broken=["no UTF-8"])
def _(scene, name):
    scene.view_layers[0].use_pass_cryptomatte_material = True
    for material in bpy.data.materials:
        material.name = name


@each("material that cannot be matched", chosen("line end", "terminal", "quotes"), broken=["half a letter"])
def _(scene, name):
    scene.objects["Cube"].data.materials[0].name = name
    made = Material("glass")
    made.block.name = name
    scene.objects["Plane"].data.materials[0] = made.surface(made.node("BsdfGlass")).block


@each("world", chosen("slash", "line end", "63 bytes"), broken=["overlong"])
def _(scene, name):
    scene.world.name = name


@each("collection", chosen("slash", "dots", "line end", "left", "255 bytes"), broken=["no UTF-8"])
def _(scene, name):
    collection = bpy.data.collections.new(name)
    scene.collection.children.link(collection)
    collection.objects.link(scene.objects["Cube"])


@each("action and its slot", chosen("slash", "quotes", "line end"), broken=["a surrogate"])
def _(scene, name):
    scene.objects["Cube"].keyframe_insert("location", frame=1)
    scene.objects["Cube"].animation_data.action.name = name


@each("text block", chosen("slash", "a way out", "line end", "emoji"), broken=["no UTF-8"])
def _(_scene, name):
    bpy.data.texts.new(name).write("import os\nos.abort()\n")


@each("script that would run at once", chosen("slash", "stereo_reproject"))
def _(_scene, name):
    text = bpy.data.texts.new(f"{name}.py")
    text.write("import os\nos.abort()\n")
    text.use_module = True


@each("node group and node", chosen("slash", "quotes", "line end", "None"), broken=["no UTF-8"])
def _(scene, name):
    tree = bpy.data.node_groups.new(name, "ShaderNodeTree")
    made = Material("odd")
    group = made.tree.nodes.new("ShaderNodeGroup")
    group.node_tree, group.name, group.label = tree, name, name
    scene.objects["Cube"].data.materials[0] = made.surface(made.node("Emission")).block


@each(
    "texture coordinates and attributes",
    chosen("slash", "inner dots", "line end", "umlauts", "63 bytes"),
    broken=["half a letter"],
)
def _(scene, name):
    mesh = scene.objects["Cube"].data
    mesh.uv_layers[0].name = name
    made = Material("odd")
    shader, attribute = made.node("Emission"), made.node("Attribute")
    attribute.attribute_name = name
    made.link(attribute.outputs[0], shader.inputs[0])
    mesh.materials[0] = made.surface(shader).block


@each("modifier that is not baked", chosen("line end", "quotes", "terminal"), broken=["no UTF-8"])
def _(scene, name):
    scene.objects["Cube"].modifiers.new(short(name), "CLOTH")


@each("marker that binds the camera", chosen("line end", "template", "umlauts"), broken=["no UTF-8"])
def _(scene, name):
    scene.timeline_markers.new(short(name), frame=1).camera = scene.camera


# Custom properties


@each("custom property of scene, camera, layer", chosen("slash", "quotes", "line end", "63 bytes", "umlauts"))
def _(scene, name):
    for owner in (scene, scene.camera, scene.camera.data, scene.view_layers[0], scene.world):
        owner[short(name)] = {"nested": [1.0, 2.0], name[:20] or "x": "text"}


@odd("custom property: as the seed is kept, but a text")
def _(scene):
    scene["stereo_reproject_seed"] = "none"


@odd("custom property: as the seed is kept, but a group")
def _(scene):
    scene["stereo_reproject_seed"] = {"a": 1}


@odd("custom property: as cryptomatte is noted, but a text")
def _(scene):
    scene.view_layers[0]["stereo_reproject_cryptomatte"] = "none"
    scene.view_layers[0].use_pass_cryptomatte_material = True


@odd("custom property: cycles, as a text")
def _(scene):
    scene.camera["cycles"] = "none"
    with contextlib.suppress(TypeError):
        scene["cycles"] = "none"


# View layers and what they hold


@each("view layer", ALL, broken=BROKEN)
def _(scene, name):
    scene.view_layers[0].name = name
    scene.view_layers[0].use_pass_normal = True


@each(
    "one of two view layers",
    chosen("slash", "inner dots", "dot", "Combined", "space", "line end", "63 bytes", "255 bytes", "left"),
    broken=["no UTF-8"],
)
def _(scene, name):
    scene.view_layers.new(name)


@each(
    "second view layer called as the first, but for",
    {
        "case": "viewlayer",
        "a space": "ViewLayer ",
        "a dot": "ViewLayer.",
        "a suffix": "ViewLayer.001",
        "a pass": "ViewLayer.Combined",
        "an eye": "ViewLayer.left",
    },
)
def _(scene, name):
    scene.view_layers.new(name)


@each(
    "AOV",
    {**ALL, "another pass": "Normal", "noise": "Noisy Image", "cryptomatte": "CryptoObject00", "ours": ".Effects"},
    broken=BROKEN,
)
def _(scene, name):
    add_aov(scene, name)


def add_aov(scene, name):
    name = short(name)
    scene.view_layers[0].aovs.add().name = name
    made = Material("aov")
    made.surface(made.node("BsdfDiffuse"))
    aov = made.node("OutputAOV", Color=(0.5, 0.25, 1.0, 1.0))
    aov.aov_name = scene.view_layers[0].aovs[-1].name
    scene.objects["Cube"].data.materials[0] = made.block


@odd("AOVs: two of one name, one without a name")
def _(scene):
    for name in ("twin", "twin", ""):
        add_aov(scene, name)


@odd("AOVs: names that differ in case alone")
def _(scene):
    for name in ("mask", "Mask", "MASK"):
        add_aov(scene, name)


@each(
    "light group",
    chosen("slash", "inner dots", "line end", "Combined", "umlauts", "63 bytes", "template", "space"),
    broken=["no UTF-8"],
)
def _(scene, name):
    name = short(name)
    scene.view_layers[0].lightgroups.add(name=name)
    scene.objects["Sun"].lightgroup = scene.view_layers[0].lightgroups[0].name


# Files that a scene refers to


@each(
    "picture that is missing",
    {**chosen("line end", "terminal", "quotes", "255 bytes", "Japanese"), "template": "{blend_dir}"},
    broken=BROKEN,
    says=("missing",),
)
def _(scene, name):
    show_image(scene, name, f"//{name}.png")


@each(
    "picture's file",
    {
        **PATHS,
        **chosen("template", "line end", "hashes"),
        "a device": "/dev/null",
        "a folder": "//",
        "its own blend": "//odd.blend",
        "a link to itself": "/proc/self/exe",
    },
)
def _(scene, path):
    show_image(scene, "odd", path)


def show_image(scene, name, path):
    image = bpy.data.images.new(name, 4, 4)
    image.source, image.filepath = "FILE", path
    made = Material("odd")
    texture, shader = made.node("TexImage"), made.node("Emission")
    texture.image = image
    made.link(texture.outputs[0], shader.inputs[0])
    scene.objects["Cube"].data.materials[0] = made.surface(shader).block


@each(
    "library that is missing", chosen("slash", "a way out", "line end", "umlauts"), broken=["no UTF-8"], statuses=EITHER
)
def _(scene, name):
    # Linked from a file that is gone by then.
    block = bpy.data.meshes.new("Linked")
    path = f"/tmp/hostile-lib-{ENCODING.decode()}.blend"
    bpy.data.libraries.write(path, {block}, fake_user=True)
    with bpy.data.libraries.load(path, link=True) as (_, to):
        to.meshes = ["Linked"]
    Path(path).unlink()
    scene.objects["Cube"].data = bpy.data.meshes["Linked", path]
    bpy.data.libraries[0].filepath = f"//{name}.blend"


@each("mist, stamp and output of a movie", chosen("line end", "template", "percent"), command="animate")
def _(scene, name):
    scene.render.use_stamp = True
    scene.render.use_stamp_note = True
    scene.render.stamp_note_text = name


# Views


@each(
    "suffix of an eye's files",
    {
        "slash": "/L",
        "a way out": "/../../L",
        "dots": "..",
        "template": "{frame}",
        "hashes": "##",
        "none": "",
        "umlauts": "äöü",
        "line end": "a\nb",
        "absolute": f"{OUTSIDE}/L",
        "as the other's": "_R",
    },
    broken=["no UTF-8"],
    command="animate",
    statuses=EITHER,
)
def _(scene, suffix):
    scene.render.use_multiview = True
    scene.render.views["left"].file_suffix = suffix


@each("view", chosen("slash", "Combined", "line end", "umlauts", "template"), broken=["no UTF-8"], command="animate")
def _(scene, name):
    scene.render.use_multiview = True
    scene.render.views.new(short(name))


@each("suffix of a view's camera", chosen("slash", "dots", "umlauts", "space"), statuses=EITHER)
def _(scene, suffix):
    scene.render.use_multiview = True
    scene.render.views_format = "MULTIVIEW"
    scene.render.views["left"].camera_suffix = suffix


# Where files go


@each(
    "output path",
    {
        **{what: f"//frames/{name}" for what, name in {**SIGNS, **LETTERS, **OURS}.items()},
        **PATHS,
        "none": "",
        "folder alone": "//frames/",
        "root": "/",
        "null": "/dev/null",
        "blend": "//odd.blend",
        "blend's folder": "{blend_dir}",
        "up and a name": "//../../out_of_here_",
        "up in a template": "{blend_dir}/../out_",
        "an end in dots": "//frames/..",
        "a dot": "//frames/.",
        "a journal": f"//frames/{JOURNAL}",
        "an earlier journal": "//frames/journal",
        "a record": "//x.json",
        "hashes alone": "//####",
        "a number": "//0001",
        "a claim": "//0001.claim",
        "a long path": "//" + "d/" * 300 + "x",
    },
    broken=BROKEN,
    command="animate",
    statuses=EITHER,
)
def _(scene, path):
    scene.render.filepath = path


@each(
    "output path that renders",
    {
        "slash": "//a/b",
        "dots before a name": "//../a",
        "umlauts": "//ä_",
        "a space": "// a ",
        "hashes": "//a##_",
        "name and extension": "//a.png",
        "quotes": "//a'b\"c",
        "percent": "//%d%s",
        "shell": "//$(x);",
        "option": "//--x",
    },
    command="animate",
)
def _(scene, path):
    scene.render.filepath = path


@each(
    "slot of a File Output node",
    {**chosen("slash", "dots", "umlauts", "line end", "hashes", "template", "absolute"), "none": ""},
    broken=["no UTF-8"],
    command="animate",
    statuses=EITHER,
)
def _(scene, name):
    output = add_file_output(scene, "//out/files/")
    if MODERN:
        output.file_output_items[0].name = name
    else:
        output.file_slots[0].path = name


@each(
    "folder of a File Output node",
    {
        "blend's": "//out/files",
        "template": "{blend_dir}/out/files/",
        "hashes": "//out/a##/",
        "umlauts": "//out/äöü/",
        "unknown template": "//out/{nope}/",
        "none": "",
        "up": "//out/x/../files/",
    },
    broken=["no UTF-8"],
    command="animate",
    statuses=EITHER,
)
def _(scene, folder):
    add_file_output(scene, f"//out/{folder}/" if folder == ENCODING.decode() else folder)


@each(
    "node of the compositor",
    chosen("line end", "terminal", "quotes", "Japanese"),
    broken=["no UTF-8"],
    command="animate",
)
def _(scene, name):
    output = add_file_output(scene, "//out/files/")
    output.name = output.label = short(name)


def add_file_output(scene, folder):
    tree, layers, end = add_compositor(scene)
    tree.links.new(layers.outputs[0], end)
    output = tree.nodes.new("CompositorNodeOutputFile")
    if MODERN:
        output.directory = folder
        if not len(output.file_output_items):
            output.file_output_items.new("RGBA", "Image")
    else:
        output.base_path = folder
    tree.links.new(layers.outputs[0], output.inputs[0])
    return output


@odd("compositor: a group that is called as ours might be")
def _(scene):
    if not MODERN:
        raise NotInThisBlenderError
    tree, layers, end = add_compositor(scene)
    tree.links.new(layers.outputs[0], end)
    tree.name = "stereo_reproject"
