"""The extension's preferences: what belongs to a person and a machine, and not to a scene."""

import tempfile
from pathlib import Path
from typing import Any

import bpy

from ..stereo_reproject.blender.scene.user_folder import user_folder
from ..stereo_reproject.report.verdict import accuracy_name
from ..stereo_reproject.settings.accuracy import SETTINGS
from ..stereo_reproject.settings.frame import StereoSettings
from ..stereo_reproject.words import Words
from .text import shown

EXTENSION = __package__.rpartition(".")[0]
"""Name under which Blender knows the extension, such as "bl_ext.user_default.stereo_reproject"."""

MIN_PREVIEW_PX = 480
"""Pixels of a preview's longer side, at least, unless the full picture has fewer: smaller ones show little depth."""

PREVIEW_SAMPLES = 16
"""Samples of each pixel of a preview: few enough to be quick, and enough for a denoiser."""

SCREEN_WIDTH_M = 0.6
"""Width of a monitor of 27 inches, in metres."""

EYE_DISTANCE_M = 0.065
"""Distance between an adult's eyes, in metres, as stereo is usually made for; the mean of adults is 63 mm."""

VIEWING_DISTANCE_WIDTHS = 1.7
"""Distance of the viewer from the screen, in its widths: about 1 m from a monitor of 27 inches, the middle of a
cinema."""

SCREEN_WIDTH: dict[str, Any] = {
    "name": "Screen Width (m)",
    "description": "Width of the picture where it will be seen, in metres: 0.6 for a monitor, 10 for a cinema",
    "min": 0.01,
    "soft_max": 30.0,
}
EYE_DISTANCE: dict[str, Any] = {
    "name": "Viewer's Eyes (m)",
    "description": "Distance between the viewer's eyes, in metres: 0.065 for adults, 0.05 for children",
    "min": 0.001,
    "soft_max": 0.08,
    "precision": 3,
}
VIEWING_DISTANCE: dict[str, Any] = {
    "name": "Viewing Distance (Widths)",
    "description": (
        "Distance of the viewer from the screen, in widths of the screen: 1 to 2 for a monitor, 1.5 to 2"
        " in the middle of a cinema, 2 to 3 for a television"
    ),
    "min": 0.1,
    "soft_max": 5.0,
    "precision": 1,
    "step": 10,
}
"""Names, descriptions and limits of what is a preference, and may be another value in a scene."""

GROUPS = (
    (
        "Defaults for Scenes",
        ("accuracy", "preview_samples", "screen_width", "eye_distance", "viewing_distance"),
    ),
    ("Every Preview", ("preview_pixels",)),
    ("Every Render", ("keep_ready",)),
    ("Folders", ("temporary_folder", "costs_folder")),
)
"""Titles and preferences, in the order in which they are drawn."""


def promise(name: str) -> str:
    """Return, in words for artists, the promise of the accuracy setting of this name."""
    accuracy = SETTINGS[name]
    if accuracy.promise is None:
        return "No promise: reflections and glass stay as the first eye sees them"
    text = f"At most {round(100 * (accuracy.promise - 1.0))} % more error than the noise of a plain render"
    return f"{text}, in every part of the picture" if accuracy.promises_worst_tiles else text


def _end_waiting(preferences: Any, _context: bpy.types.Context) -> None:
    """End the second Blender that waits where the preferences do not want it any more."""
    from .second_blender import end_waiting

    if not preferences.keep_ready:
        end_waiting()


class StereoReprojectPreferences(bpy.types.AddonPreferences):
    """Preferences of the extension, in Preferences > Add-ons."""

    bl_idname = EXTENSION

    accuracy: bpy.props.EnumProperty(
        name="Accuracy",
        description="How close the second eye comes to one that is rendered whole",
        items=[(name, accuracy_name(name), promise(name)) for name in SETTINGS],
        default=StereoSettings.accuracy,
    )
    preview_pixels: bpy.props.IntProperty(
        name="Smallest Size (px)",
        description="Pixels of a preview's longer side, at least, unless the full picture has fewer",
        default=MIN_PREVIEW_PX,
        min=64,
        soft_max=2048,
    )
    preview_samples: bpy.props.IntProperty(
        name="Preview Samples",
        description="Samples of each pixel of a preview, but never more than its scene has",
        default=PREVIEW_SAMPLES,
        min=1,
        soft_max=1024,
    )
    keep_ready: bpy.props.BoolProperty(
        name="Keep a Second Blender Ready",
        description="Start the Blender that renders as soon as the render buttons are seen, and not only when one is"
        " clicked: the first picture comes sooner, for some 150 MB of memory",
        default=True,
        update=_end_waiting,
    )
    screen_width: bpy.props.FloatProperty(default=SCREEN_WIDTH_M, **SCREEN_WIDTH)
    eye_distance: bpy.props.FloatProperty(default=EYE_DISTANCE_M, **EYE_DISTANCE)
    viewing_distance: bpy.props.FloatProperty(default=VIEWING_DISTANCE_WIDTHS, **VIEWING_DISTANCE)
    temporary_folder: bpy.props.StringProperty(
        name="Temporary Files",
        description="Folder for temporary files of a render, some of them large. Empty: Blender's own",
        subtype="DIR_PATH",
    )
    costs_folder: bpy.props.StringProperty(
        name="Measured Times",
        description="Folder in which it is kept how fast this machine renders missing pixels."
        " Empty: the folder that Blender has for the extension",
        subtype="DIR_PATH",
    )

    def draw(self, _context: bpy.types.Context) -> None:
        """Draw the preferences, in groups."""
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        for title, names in GROUPS:
            layout.label(text=title)
            column = layout.column(align=True)
            for name in names:
                column.prop(self, name)
        kept_in = user_folder()
        if kept_in is not None and not self.costs_folder:
            layout.label(text=shown(Words("Measured times are kept in {folder}", folder=kept_in)), icon="INFO")


def preferred(name: str) -> Any:
    """Return the value of a preference; its default where the extension was not switched on as an add-on, and so has no
    preferences.
    """
    addon = bpy.context.preferences.addons.get(EXTENSION)
    if addon is None or addon.preferences is None:
        return StereoReprojectPreferences.bl_rna.properties[name].default
    return getattr(addon.preferences, name)


def temporary_folder() -> Path:
    """Return the folder for temporary files that is set in the extension's preferences, or else in Blender's; the
    system's if there is none of either.
    """
    set_folders = preferred("temporary_folder"), bpy.context.preferences.filepaths.temporary_directory
    folders = [Path(bpy.path.abspath(folder)) for folder in set_folders if folder]
    return next((folder for folder in folders if folder.is_dir()), Path(tempfile.gettempdir()))
