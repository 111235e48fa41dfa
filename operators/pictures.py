"""The pictures that explain a pair, as images of the file, and only when they are asked for."""

import bpy

from .results import PICTURES, result_of
from .run import job_has_thread
from .text import reported
from .zoom_and_place import picture_size

NAME = "Stereo {}"

QUILT = NAME.format("Quilt")
"""Name of the image that shows the quilt of many views."""

FRAMES = NAME.format("Frames")
"""Name of the image that shows frames of an animation, from their files."""

SHOWN = [
    ("PAIR", "Stereo Pair", "The Render Result, with both eyes"),
    *((key, name, description) for key, (_, name, description) in PICTURES.items()),
]
"""Pictures that can be shown, as items of an enumeration."""


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
        """Return the button's tooltip, which is that of its picture."""
        return next(text for key, _, text in SHOWN if key == properties.which)

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Return whether the operator is called in an Image Editor."""
        return context.space_data is not None and context.space_data.type == "IMAGE_EDITOR"

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Show the picture in the Image Editor; report an error if there is none."""
        space = context.space_data
        image = render_result() if self.which == "PAIR" else load_picture(context.scene, self.which)
        if image is None:
            self.report({"ERROR"}, reported("There is no such picture: render a stereo pair first"))
            return {"CANCELLED"}
        space.image = image
        if not bpy.app.background:
            fit_editor(context.window, context.area)
        return {"FINISHED"}


def render_result() -> bpy.types.Image | None:
    """Return the file's Render Result, the image into which Blender renders; None if there is none."""
    return next((image for image in bpy.data.images if image.type == "RENDER_RESULT"), None)


KIND = "stereo_reproject_kind"
"""Property of the images in which a pair is seen without glasses: which one it is, a key of
`view_images.ARRANGEMENTS`."""

PAIR = "stereo_reproject_pair"
"""Property of those images, beside `KIND`: the name of the image that holds the pair."""


def kind_of(image: bpy.types.Image | None) -> str | None:
    """Return what an image in which a pair is seen without glasses shows, as `view_images.ARRANGEMENTS` names it; None
    for any other image.
    """
    return image.get(KIND) if image is not None and image.is_runtime_data else None


SHOWN_FRAME = "stereo_reproject_frame"
"""Property of the image of frames: the number of the frame that it holds."""


def frame_shown(image: bpy.types.Image | None) -> int | None:
    """Return the frame of an animation that an image shows, whole or one eye of it; None where it shows none."""
    frames = frames_image()
    if image is None or frames is None:
        return None
    name = image.name if kind_of(image) is None else image[PAIR]
    return frames[SHOWN_FRAME] if name == frames.name else None


def frames_image() -> bpy.types.Image | None:
    """Return the image of frames; None if there is none. The user may have one of the same name."""
    return next((image for image in bpy.data.images if image.is_runtime_data and SHOWN_FRAME in image), None)


def image_editors() -> list[tuple[bpy.types.Window, bpy.types.Area]]:
    """Return the Image Editors of all windows, each with its window."""
    areas = [(window, area) for window in bpy.context.window_manager.windows for area in window.screen.areas]
    return [(window, area) for window, area in areas if area.type == "IMAGE_EDITOR"]


def picture_names() -> set[str]:
    """Return the names of the images that explain a pair."""
    return {NAME.format(name) for _, name, _ in PICTURES.values()}


def is_ours(image: bpy.types.Image) -> bool:
    """Return whether an image explains a pair, shows it without glasses, or is of many views or of an animation."""
    if image.name in {*picture_names(), QUILT} or kind_of(image) is not None:
        return True
    return image == frames_image()


def find_editor() -> bpy.types.Area | None:
    """Return the Image Editor in which a pair is shown: the one that shows the Render Result, or else an image of ours;
    None where there is none.
    """
    editors = [area for _, area in image_editors() if area.spaces.active.image is not None]
    shows_result = (area for area in editors if area.spaces.active.image.type == "RENDER_RESULT")
    ours = (area for area in editors if is_ours(area.spaces.active.image))
    return next(shows_result, None) or next(ours, None)


def bring_forward(window: bpy.types.Window) -> None:
    """Bring a window that Blender has opened for a picture in front of the others, as F12 does; do nothing with any
    other window, and where the user is in it. No job may have its thread, see `zoom_to_fit`.
    """
    if window != bpy.context.window and window.screen.is_temporary:
        # It shows nothing new where there is such a window.
        bpy.ops.render.view_show("INVOKE_DEFAULT")


def show_image(image: bpy.types.Image) -> bool:
    """Show an image in the first Image Editor that is open. Return False if none is open."""
    editors = image_editors()
    if editors:
        editors[0][1].spaces.active.image = image
    return bool(editors)


MAX_FOREIGN_REDRAWS = 50
"""Redraws of a Render Result without two views after which something else than the pair is shown."""


def fit_result() -> None:
    """Zoom every Image Editor that shows the Render Result so that the whole picture fits into it."""
    result = render_result()
    for window, area in image_editors():
        if result is not None and area.spaces.active.image == result:
            fit_editor(window, area)


def fit_editor(window: bpy.types.Window, area: bpy.types.Area) -> None:
    """Zoom an Image Editor so that the whole picture fits into it, and put that into its middle, or into what the
    sidebar leaves free, if that is most of it; while a job runs, do as `zoom_to_fit`.
    """
    if job_has_thread():
        zoom_to_fit(area)
        return
    region = next(region for region in area.regions if region.type == "WINDOW")
    with bpy.context.temp_override(window=window, area=area, region=region):  # pyright: ignore[reportGeneralTypeIssues] - not in the stubs
        bpy.ops.image.view_all(fit_view=True)
        _clear_of_sidebar(area, region)


MAX_COVERED_SHARE = 0.4
"""Widest share of an Image Editor that its sidebar covers for a picture to be fitted beside it: beside a wider one it
would be too small to be looked at, and is fitted to the whole editor."""


def _clear_of_sidebar(area: bpy.types.Area, region: bpy.types.Region) -> None:
    """Make a picture that is in the middle of an Image Editor's region smaller, and move it to the left, until the
    sidebar covers nothing of it; not beside a sidebar that leaves little room. The editor must be that of the context.
    """
    sidebar = next((other for other in area.regions if other.type == "UI" and other.width > 1), None)
    size = picture_size(area)
    if sidebar is None or size is None:
        return
    width, height = size
    covered = region.x + region.width - sidebar.x
    free = region.width - covered
    # The editor's own zoom is that of the picture that was drawn last.
    zoom = min(region.width / width, region.height / height)
    if not 0 < covered <= MAX_COVERED_SHARE * region.width or width * zoom <= free - covered:
        return
    zoom = min(zoom, free / width)
    bpy.ops.image.view_zoom_ratio(ratio=zoom)
    bpy.ops.image.view_pan(offset=(0.5 * covered / zoom, 0.0))


def zoom_to_fit(area: bpy.types.Area) -> None:
    """Zoom an Image Editor so that the whole picture is as large as the editor, without an operator: 4.5 ends where one
    runs under an override of its context while another thread does. Do nothing for a picture whose size Blender does
    not tell, such as the Render Result.
    """
    space = area.spaces.active
    width, height = space.image.size
    if width and height:
        region = next(region for region in area.regions if region.type == "WINDOW")
        space.zoom_percentage = 100.0 * min(region.width / width, region.height / height)


def redraw_with_both_eyes(*, fit: bool = False) -> None:
    """Have the Image Editors drawn again until Blender knows that a new Render Result has two views; with fit, zoomed
    to the picture.

    Blender learns of them as it draws the result, after it has chosen what to draw. So the first time it draws one eye,
    and the button for stereo is missing. F12 draws often while it renders; a pair that was handed over is drawn once.
    """
    left = iter(range(MAX_FOREIGN_REDRAWS))

    def redraw() -> float | None:
        image = render_result()
        editors = image_editors()
        for _, area in editors:
            area.tag_redraw()
        waits = image is not None and editors and not image.is_stereo_3d and next(left, None) is not None
        if fit and not waits:
            fit_result()
        return 0.1 if waits else None

    # After the redraw that is due already.
    bpy.app.timers.register(redraw, first_interval=0.0)


def show_pair(*, fit: bool) -> None:
    """Show the Render Result in an Image Editor: where it is shown already, or in place of one of our pictures, or else
    where the user's preferences say. With fit, the whole picture is fitted to the editor.
    """
    redraw_with_both_eyes(fit=fit)
    area = find_editor()
    if area is None:
        bpy.ops.render.view_show("INVOKE_DEFAULT")
    elif area.spaces.active.image.type != "RENDER_RESULT":
        # Asking Blender to show what is shown would close it.
        area.spaces.active.image = render_result()


def load_picture(scene: bpy.types.Scene, which: str) -> bpy.types.Image | None:
    """Load a picture of the scene's last pair and return it as an image, in place of the earlier one. It is not saved
    with the .blend. which is a key of `PICTURES`. Return None if the scene has no such picture.
    """
    path = result_of(scene).picture(which)
    if path is None:
        return None
    name = NAME.format(PICTURES[which][1])
    old = bpy.data.images.get(name)
    image = bpy.data.images.load(str(path))
    image.is_runtime_data = True
    # The file that it came from is temporary.
    image.pack()
    image.filepath = image.filepath_raw = ""
    if old is not None:
        old.user_remap(image)
        bpy.data.images.remove(old)
    image.name = name
    return image
