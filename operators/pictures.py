"""The pictures that explain a pair, as images of the file, and only when they are asked for."""

import bpy

from .results import PICTURES, result_of

NAME = "Stereo {}"

SHOWN = [
    ("PAIR", "Stereo Pair", "The Render Result, with both eyes"),
    *((key, name, description) for key, (_, name, description) in PICTURES.items()),
]
"""What can be shown, as an enumeration has it."""


class STEREO_REPROJECT_OT_show_picture(bpy.types.Operator):
    """Show a picture that explains the last stereo pair in this editor"""

    bl_idname = "stereo_reproject.show_picture"
    bl_label = "Show"

    which: bpy.props.EnumProperty(
        name="Picture",
        items=SHOWN,
    )

    @classmethod
    def description(cls, _context: bpy.types.Context, properties: bpy.types.OperatorProperties) -> str:
        return next(text for key, _, text in SHOWN if key == properties.which)

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return context.space_data is not None and context.space_data.type == "IMAGE_EDITOR"

    def execute(self, context: bpy.types.Context) -> set[str]:
        space = context.space_data
        image = render_result() if self.which == "PAIR" else load_picture(context.scene, self.which)
        if image is None:
            self.report({"ERROR"}, "There is no such picture: render a stereo pair first")
            return {"CANCELLED"}
        space.image = image
        return {"FINISHED"}


def render_result() -> bpy.types.Image | None:
    return next((image for image in bpy.data.images if image.type == "RENDER_RESULT"), None)


def show_pair() -> None:
    """Show the Render Result where it or one of our pictures is shown, or else where the user's preferences say."""
    names = {NAME.format(name) for _, name, _ in PICTURES.values()}
    spaces = [area.spaces.active for window in bpy.context.window_manager.windows for area in window.screen.areas]
    editors = [space for space in spaces if space.type == "IMAGE_EDITOR" and space.image is not None]
    # Asking Blender to show what is shown would close it.
    if any(editor.image.type == "RENDER_RESULT" for editor in editors):
        return
    ours = next((editor for editor in editors if editor.image.name in names), None)
    if ours is not None:
        ours.image = render_result()
    else:
        bpy.ops.render.view_show("INVOKE_DEFAULT")


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
