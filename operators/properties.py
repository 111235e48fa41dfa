"""Settings that an artist chooses on the scene, each with its meaning."""

from collections.abc import Callable
from typing import Any

import bpy

from ..stereo_reproject.report.verdict import accuracy_name
from ..stereo_reproject.settings.accuracy import SETTINGS
from ..stereo_reproject.settings.animation import MAX_REUSE
from ..stereo_reproject.settings.frame import FILL_METHODS, INTERPOLATIONS, MAX_SIZE, PACKED_CAMERAS, StereoSettings
from .headset import CHOICES, FLAT, HEIGHT_PX, LEAST_HEIGHT_PX
from .plane_drawing import redraw_views
from .preferences import EYE_DISTANCE, MIN_PREVIEW_PX, SCREEN_WIDTH, VIEWING_DISTANCE, preferred, promise
from .views_properties import StereoReprojectViews

FILLS = {
    "auto": "Whichever is likely to be fastest for this frame on this device",
    "packed": "All missing pixels of the picture are rendered together, as one small picture",
    "card": "The picture is rendered behind a card that is open where pixels are missing (any device)",
    "full": "The other eye is rendered whole, as Blender's multiview does",
}

CAMERAS = {
    "auto": ("Auto", "An OSL camera where Cycles has one that can trace the scene, else a Ray Portal"),
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
    "auto": ("Auto", "In animations of large pictures the faster of the two, which is measured; else NumPy"),
    "numpy": ("NumPy", "On one core of the processor"),
    "gpu": ("GPU", "On the graphics card; as NumPy where none can be used"),
}


def _number(name: str) -> dict[str, Callable[..., Any]]:
    """Return the accessors of a number that is the preferences' until another is set in the scene, in own_`name`."""

    def get(settings: bpy.types.PropertyGroup) -> Any:
        return getattr(settings, f"own_{name}") or preferred(name)

    def put(settings: bpy.types.PropertyGroup, value: Any) -> None:
        setattr(settings, f"own_{name}", value)

    return {"get": get, "set": put}


def _accuracy(settings: bpy.types.PropertyGroup) -> int:
    """Return the number of the scene's accuracy among its items: the one that was chosen, or else the preferences'."""
    return list(SETTINGS).index(settings.own_accuracy or preferred("accuracy"))


def _choose_accuracy(settings: bpy.types.PropertyGroup, item: int) -> None:
    """Keep the accuracy that was chosen in the scene, given by its number among the items."""
    settings.own_accuracy = list(SETTINGS)[item]


class StereoReprojectSettings(bpy.types.PropertyGroup):
    """Settings of the extension, kept with each scene. Interocular distance and convergence are not here: they are
    Blender's own settings of the camera.

    Those with an own_… beside them follow the preferences until they are set in the scene; own_… is then what was set.
    """

    accuracy: bpy.props.EnumProperty(
        name="Accuracy",
        description="How close the second eye comes to one that is rendered whole",
        items=[(name, accuracy_name(name), promise(name)) for name in SETTINGS],
        get=_accuracy,
        set=_choose_accuracy,
    )
    own_accuracy: bpy.props.StringProperty(options={"HIDDEN"})
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
        description="How holes are rendered: the parts of the other eye's picture that the rendered eye does not show",
        items=[(name, name.capitalize(), FILLS[name]) for name in FILL_METHODS],
        default=StereoSettings.fill,
    )
    packed_by: bpy.props.EnumProperty(
        name="Packed by",
        description="The camera that renders the small picture of all missing pixels, where Hole Rendering is Packed",
        items=[(name, *CAMERAS[name]) for name in PACKED_CAMERAS],
        default=StereoSettings.packed_by,
    )
    headset: bpy.props.EnumProperty(
        name="Render as",
        description="What is rendered of the scene. The camera itself is not changed",
        items=CHOICES,
        default=FLAT,
    )
    headset_height: bpy.props.IntProperty(
        name="Height",
        description="Height of one eye's picture in pixels; VR180 is as wide as that, 360° twice as wide. Counts in"
        " place of the resolution in Output",
        subtype="PIXEL",
        default=HEIGHT_PX,
        min=LEAST_HEIGHT_PX,
        max=MAX_SIZE // 2,
        soft_max=2 * HEIGHT_PX,
    )
    compare: bpy.props.BoolProperty(
        name="Compare",
        description="Also render the pair with Blender's multiview, and measure time and error against it."
        " Takes about three more renders: both eyes, and one of them once more, which tells how much is noise",
        default=StereoSettings.compare,
    )
    key_frame_distance: bpy.props.IntProperty(
        name="Frames per Rendered Eye",
        description="Of so many frames in a row of an animation, one eye of the first is rendered whole, and the others"
        " are made from it: what moves, and what comes into view, is rendered. A cut begins anew, and where a light or"
        " a material changes, each frame is rendered. At 1, one eye of each frame is rendered",
        default=1,
        min=1,
        max=MAX_REUSE,
        soft_max=24,
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
        f" the pixels that the preferences ask for, {MIN_PREVIEW_PX} if nothing else is set, or those of the scene",
        subtype="PERCENTAGE",
        default=25,
        min=1,
        max=100,
    )
    preview_samples: bpy.props.IntProperty(
        name="Samples",
        description="Samples of each pixel of the preview, but never more than the scene has",
        min=1,
        soft_max=1024,
        **_number("preview_samples"),
    )
    own_preview_samples: bpy.props.IntProperty(options={"HIDDEN"})
    screen_width: bpy.props.FloatProperty(**SCREEN_WIDTH, **_number("screen_width"))
    own_screen_width: bpy.props.FloatProperty(options={"HIDDEN"})
    eye_distance: bpy.props.FloatProperty(**EYE_DISTANCE, **_number("eye_distance"))
    own_eye_distance: bpy.props.FloatProperty(options={"HIDDEN"})
    viewing_distance: bpy.props.FloatProperty(**VIEWING_DISTANCE, **_number("viewing_distance"))
    own_viewing_distance: bpy.props.FloatProperty(options={"HIDDEN"})
    show_depth: bpy.props.BoolProperty(
        name="Show in 3D View",
        description="Draw the screen, and where comfort ends before it (Near) and behind it (Far), in the 3D View; an"
        " arrow at the screen's corner drags the convergence. Far is missing where all depths behind the screen, up to"
        " infinity, are comfortable",
        default=False,
        update=redraw_views,
    )
    views: bpy.props.PointerProperty(type=StereoReprojectViews)
