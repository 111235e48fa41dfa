"""The pictures that explain a pair, as images of the file, and only when they are asked for."""

import bpy

from .results import PICTURES, result_of

NAME = "Stereo {}"


class STEREO_REPROJECT_OT_show_picture(bpy.types.Operator):
    """Show a picture that explains the last stereo pair in this editor"""

    bl_idname = "stereo_reproject.show_picture"
    bl_label = "Show"

    which: bpy.props.EnumProperty(
        name="Picture",
        items=[
            ("PAIR", "Stereo Pair", "The Render Result, with both eyes"),
            *((key, name, description) for key, (_, name, description) in PICTURES.items()),
        ],
    )

    @classmethod
    def description(cls, _context: bpy.types.Context, properties: bpy.types.OperatorProperties) -> str:
        return cls.bl_rna.properties["which"].enum_items[properties.which].description

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return context.space_data is not None and context.space_data.type == "IMAGE_EDITOR"

    def execute(self, context: bpy.types.Context) -> set[str]:
        space = context.space_data
        if self.which == "PAIR":
            image = next((image for image in bpy.data.images if image.type == "RENDER_RESULT"), None)
        else:
            image = load_picture(context.scene, self.which)
        if image is None:
            self.report({"ERROR"}, "There is no such picture: render a stereo pair first")
            return {"CANCELLED"}
        space.image = image
        return {"FINISHED"}


def load_picture(scene: bpy.types.Scene, which: str) -> bpy.types.Image | None:
    """The picture as an image that the file keeps, in place of the one of an earlier pair; None when there is none."""
    path = result_of(scene).picture(which)
    if path is None:
        return None
    name = NAME.format(PICTURES[which][1])
    old = bpy.data.images.get(name)
    image = bpy.data.images.load(str(path))
    image.pack()
    # The file that it came from is temporary.
    image.filepath = image.filepath_raw = ""
    if old is not None:
        old.user_remap(image)
        bpy.data.images.remove(old)
    image.name = name
    return image
