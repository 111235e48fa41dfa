"""Settings that an artist chooses on the scene, each with its meaning."""

import bpy

from ..stereo_reproject.report.verdict import accuracy_name
from ..stereo_reproject.settings.accuracy import SETTINGS
from ..stereo_reproject.settings.frame import FILL_METHODS, INTERPOLATIONS, PACKED_CAMERAS, StereoSettings

FILLS = {
    "auto": "Whichever is likely to be fastest for this frame on this device",
    "packed": "Only the missing pixels are rendered, gathered in a small picture",
    "card": "The missing pixels are rendered through a card with openings (any device)",
    "full": "The other eye is rendered whole, as Blender's multiview does",
}

MIN_PREVIEW_PX = 480
"""Pixels of a preview's longer side, at least, unless the full picture has fewer."""

CAMERAS = {
    "auto": ("Automatic", "An OSL camera where Cycles has one that can trace the scene, else a Ray Portal"),
    "osl": ("OSL", "A camera in OSL (CPU and OptiX)"),
    "portal": ("Ray Portal", "A plain camera that looks through a Ray Portal (every device)"),
}

ENGINES = {
    "scene": ("The Scene's", "Render with the engine that the scene is set to"),
    "cycles": ("Cycles", "Render with Cycles, whatever the scene is set to"),
    "eevee": (
        "EEVEE",
        (
            "Render with EEVEE, for a quick preview. Cycles traces missing pixels and matches them to EEVEE's light, or"
            " EEVEE renders the other eye as well"
        ),
    ),
}

LOOKUPS = {
    "auto": "Cubic for the colour of a denoised picture and for light that stands above its noise, linear for all else",
    "linear": "Keeps noise as quiet as it is",
    "cubic": "Sharper where textures are fine",
}

WARP_STAGES = {
    "auto": ("Automatic", "In animations of large pictures the faster of the two, which is measured; else NumPy"),
    "numpy": ("NumPy", "On one core of the processor"),
    "gpu": ("GPU", "On the graphics card; as NumPy where none can be used"),
}


def promise(name: str) -> str:
    """Return, in words for artists, the promise of the accuracy setting of this name."""
    accuracy = SETTINGS[name]
    if accuracy.promise is None:
        return "No promise: reflections and glass stay as the first eye sees them"
    text = f"At most {round(100 * (accuracy.promise - 1.0))} % more error than the noise of a plain render"
    return f"{text}, in every part of the picture" if accuracy.promises_worst_tiles else text


def redraw_views(_settings: bpy.types.PropertyGroup, context: bpy.types.Context) -> None:
    """Have all 3D Views drawn again, also those of other windows."""
    for window in context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "VIEW_3D":
                area.tag_redraw()


class StereoReprojectSettings(bpy.types.PropertyGroup):
    """Settings of the extension, kept with each scene. Eye distance and convergence are not here: they are Blender's
    own settings of the camera.
    """

    accuracy: bpy.props.EnumProperty(
        name="Accuracy",
        description="How close the second eye comes to one that is rendered whole",
        items=[(name, accuracy_name(name), promise(name)) for name in SETTINGS],
        default=StereoSettings.accuracy,
    )
    source: bpy.props.EnumProperty(
        name="Rendered Eye",
        description="The eye that is rendered whole; the other is made from it",
        items=[("left", "Left", "Render the left eye whole"), ("right", "Right", "Render the right eye whole")],
        default=StereoSettings.source,
    )
    source_engine: bpy.props.EnumProperty(
        name="Engine",
        description="Engine that renders the rendered eye",
        items=[(name, *words) for name, words in ENGINES.items()],
        default="scene",
    )
    fill: bpy.props.EnumProperty(
        name="Hole Rendering",
        description="How pixels that the rendered eye does not show are rendered",
        items=[(name, name.capitalize(), FILLS[name]) for name in FILL_METHODS],
        default=StereoSettings.fill,
    )
    packed_by: bpy.props.EnumProperty(
        name="Packed by",
        description="What shoots the rays of missing pixels that are gathered in a small picture",
        items=[(name, *CAMERAS[name]) for name in PACKED_CAMERAS],
        default=StereoSettings.packed_by,
    )
    compare: bpy.props.BoolProperty(
        name="Compare",
        description="Also render the pair with Blender's multiview, and measure time and error against it."
        " Takes about three more renders",
        default=StereoSettings.compare,
    )
    grid_threshold: bpy.props.FloatProperty(
        name="Grid Threshold",
        description="Binocular parallax, in arc minutes, from which a cell of the grid is subdivided to single pixels",
        default=StereoSettings.grid_threshold,
        min=0.0,
        soft_max=10.0,
    )
    interpolation: bpy.props.EnumProperty(
        name="Interpolation",
        description="How colours between the rendered eye's pixels are found",
        items=[(name, name.capitalize(), LOOKUPS[name]) for name in INTERPOLATIONS],
        default=StereoSettings.interpolation,
    )
    warp: bpy.props.EnumProperty(
        name="Warp",
        description="What carries pixels from one eye to the other",
        items=[(name, title, text) for name, (title, text) in WARP_STAGES.items()],
        default=StereoSettings.warp,
    )
    use_scripts: bpy.props.BoolProperty(
        name="Run Scripts of the File",
        description="Run the Python scripts of this .blend when its copy is rendered, for drivers that need them."
        " Only for files that you trust",
        default=False,
    )
    preview_percentage: bpy.props.IntProperty(
        name="Resolution",
        description="Size of the preview, of the scene's own resolution. The longer side has at least"
        f" {MIN_PREVIEW_PX} pixels, or as many as the scene's own",
        subtype="PERCENTAGE",
        default=25,
        min=1,
        max=100,
    )
    preview_samples: bpy.props.IntProperty(
        name="Samples", description="Samples of each pixel of the preview", default=16, min=1, soft_max=1024
    )
    screen_width: bpy.props.FloatProperty(
        name="Screen Width (m)",
        description="Width of the picture where it will be seen, in metres: 0.6 for a monitor, 10 for a cinema",
        default=0.6,
        min=0.01,
        soft_max=30.0,
    )
    eye_distance: bpy.props.FloatProperty(
        name="Viewer's Eyes (m)",
        description="Distance between the viewer's eyes, in metres: 0.065 for adults, 0.05 for children",
        default=0.065,
        min=0.001,
        soft_max=0.08,
        precision=3,
    )
    viewing_distance: bpy.props.FloatProperty(
        name="Viewing Distance (Widths)",
        description="Distance of the viewer from the screen, in widths of the screen: 1 to 1.5 for a monitor, 1.5 to 2"
        " in the middle of a cinema, 2 to 3 for a television",
        default=1.7,
        min=0.1,
        soft_max=5.0,
        precision=1,
        step=10,
    )
    show_depth: bpy.props.BoolProperty(
        name="Show in 3D View",
        description="Draw the screen, and where comfort ends before and behind it, in the 3D View; an arrow at the"
        " screen's corner drags the convergence",
        default=False,
        update=redraw_views,
    )
