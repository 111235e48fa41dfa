"""Export a pair as a wiggle: a file that shows the eyes one after the other wherever pictures or movies play."""

from __future__ import annotations

import itertools
import math
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import bpy
from bpy_extras.io_utils import ExportHelper

from ..stereo_reproject.blender.commands.processes import module_in_blender
from ..stereo_reproject.blender.output.saved_views import shown_views
from ..stereo_reproject.blender.output.wiggle import GIF, check_wiggle_path, wiggle_pictures, wiggle_size
from ..stereo_reproject.delivery.gif import write_gif
from ..stereo_reproject.errors import StereoReprojectError
from ..stereo_reproject.files import whole_file
from ..stereo_reproject.images.exr import VIEWS
from ..stereo_reproject.images.png import write_png
from ..stereo_reproject.jobs.wiggle_movie import make_wiggle_movie
from ..stereo_reproject.jobs.work_folder import is_full_disk_error, work_folder
from ..stereo_reproject.jobs.worker_process import module_command
from ..stereo_reproject.words import Words
from .jobs import running
from .pictures import frame_shown, image_editors
from .preferences import temporary_folder
from .results import result_of
from .slots import content_now
from .text import reported, sentence, shown
from .view_modes import NO_PAIR, pair_in
from .wiggling import WIGGLE_SECONDS
from .zoom_and_place import picture_size

LEAST_PX = 480
"""Pixels of the longer side that a wiggle has at least, unless a size is chosen or the pair has fewer."""

USUAL_PERCENTAGE = 50
"""Size of a wiggle in percent of the pair, where that has so many pixels."""

SUFFIXES = {"GIF": GIF, "MP4": ".mp4"}
"""Endings of files by their format."""


def named_as(path: str, kind: str) -> str:
    """Return a path, or a name, with the ending of a format in place of another format's; "" where it is empty."""
    suffix = Path(path).suffix
    stem = path.removesuffix(suffix) if suffix.lower() in SUFFIXES.values() else path
    return f"{stem}{SUFFIXES[kind]}" if stem else ""


def _rename(operator: STEREO_REPROJECT_OT_export_wiggle, context: bpy.types.Context) -> None:
    """Give the file the ending of the format that was chosen, in the File Browser too; a name that was suggested loses
    the number that it needs only with the other ending."""
    chosen = getattr(context.space_data, "params", None)
    folder = os.fsdecode(chosen.directory) if chosen is not None else str(Path(operator.filepath).parent)
    operator.filepath = _renamed(operator.filepath, operator, folder)
    if chosen is not None:
        chosen.filename = _renamed(chosen.filename, operator, folder)


def _renamed(path: str, operator: STEREO_REPROJECT_OT_export_wiggle, folder: str) -> str:
    """Return a path, or a name, with the ending of the operator's format. Where it was suggested, with another ending,
    it is suggested anew for this folder."""
    named = named_as(path, operator.format)
    if named == path or not operator.stem or Path(path).stem not in _suggested:
        return named
    free = suggested_path("", str(Path(folder, operator.stem)), SUFFIXES[operator.format])
    return str(Path(path).with_name(Path(free).name))


class STEREO_REPROJECT_OT_export_wiggle(bpy.types.Operator, ExportHelper):
    """Save the stereo pair as a file that shows one eye after the other: an animated GIF, which plays for ever, or a
    movie (MP4) of ten seconds"""

    bl_idname = "stereo_reproject.export_wiggle"
    bl_label = "Export Wiggle"

    # The name says which: an extension that is there is kept.
    filename_ext = GIF
    check_extension = None
    filter_glob: bpy.props.StringProperty(default="*.gif;*.mp4", options={"HIDDEN"})

    format: bpy.props.EnumProperty(
        name="Format",
        description="What is written; the name's ending follows it",
        items=[
            ("GIF", "Animated GIF", "Plays for ever wherever pictures are shown, in 256 colours"),
            ("MP4", "Movie (MP4)", "Plays for ten seconds in all colours"),
        ],
        default="GIF",
        update=_rename,
        options={"SKIP_SAVE"},
    )
    percentage: bpy.props.IntProperty(
        name="Size",
        description="Size of the file's pictures, in percent of the pair's",
        subtype="PERCENTAGE",
        default=USUAL_PERCENTAGE,
        min=1,
        max=100,
        # Of the last pair it may be too small for this one.
        options={"SKIP_SAVE"},
    )
    seconds: bpy.props.FloatProperty(
        name="Time per Eye (s)",
        description="Time for which each eye is shown, in seconds",
        default=WIGGLE_SECONDS,
        min=0.02,
        soft_max=1.0,
        max=5.0,
        step=5,
    )
    stem: bpy.props.StringProperty(
        name="Name",
        description="Name that fits the pair, without ending and number",
        options={"HIDDEN", "SKIP_SAVE"},
    )
    sides: bpy.props.IntVectorProperty(
        name="Sides of the Pair",
        description="Width and height of the pair in pixels; 0 where they are not known",
        size=2,
        min=0,
        options={"HIDDEN", "SKIP_SAVE"},
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Return whether there is a pair."""
        cls.poll_message_set(shown(NO_PAIR))
        return context.scene is not None and pair_in(context) is not None

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Open a File Browser, with a name that says of which frame the wiggle is, and a size at which depth is
        seen.
        """
        stem = _stem_of(context)
        self.filepath = suggested_path(self.filepath, stem, SUFFIXES[self.format])
        # The File Browser tells no more where the pair is.
        self.stem = Path(stem).name
        # The File Browser may take the place of the editor that shows the pair.
        self.sides = _sides_of_pair(context) or (0, 0)
        if not self.properties.is_property_set("percentage"):
            self.percentage = usual_percentage(tuple(self.sides))
        return set(super().invoke(context, event))

    def check(self, context: bpy.types.Context) -> bool:
        """Take the format from the name's ending, as the user may type it. Blender calls this after each change in the
        File Browser; return True if something was changed here.
        """
        typed = next((name for name, suffix in SUFFIXES.items() if self.filepath.lower().endswith(suffix)), None)
        changed = typed is not None and typed != self.format
        if typed is not None and changed:
            self.format = typed
        return bool(super().check(context)) or changed

    def draw(self, _context: bpy.types.Context) -> None:
        """Draw the settings beside the files, and the size in pixels where the pair's is known."""
        column = self.layout.column()
        column.use_property_split, column.use_property_decorate = True, False
        column.prop(self, "format")
        column.prop(self, "percentage")
        if all(self.sides):
            width, height = wiggle_size(
                tuple(self.sides), self.percentage, suffix=Path(self.filepath).suffix.lower() or GIF
            )
            row = column.row()
            row.alignment = "RIGHT"
            row.label(text=shown(Words("{width} x {height} pixels", width=width, height=height)))
        column.prop(self, "seconds")

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Write the file, whole or not at all; report an error in one line."""
        path = Path(bpy.path.abspath(self.filepath))
        path = path if path.suffix else path.with_suffix(SUFFIXES[self.format])
        pair = pair_in(context)
        assert pair is not None
        try:
            check_wiggle_path(path)
            with _said_to_be_saved(context, path):
                _export(context.scene, pair, path, self.percentage, self.seconds)
        except OSError as error:
            reason = Words("the disk is full") if is_full_disk_error(error) else error.strerror or str(error)
            self.report({"ERROR"}, reported(Words("{path} cannot be written: {reason}", path=path, reason=reason)))
            return {"CANCELLED"}
        except StereoReprojectError as error:
            self.report({"ERROR"}, sentence(reported(error)))
            return {"CANCELLED"}
        self.report({"INFO"}, reported(Words("Wiggle saved: {path}", path=path)))
        return {"FINISHED"}


@contextmanager
def _said_to_be_saved(context: bpy.types.Context, path: Path) -> Iterator[None]:
    """Say in the status bar, and by the mouse cursor, that a file is being saved: Blender stands still meanwhile, of a
    movie for some seconds.
    """
    window = context.window
    # While a job runs, the status bar is the job's, and its thread bears no drawing by an operator.
    if window is None or bpy.app.background or running() is not None:
        yield
        return
    try:
        window.cursor_set("WAIT")
        context.workspace.status_text_set(shown(Words("Saving {name}", name=path.name)))
        # The File Browser would stay there until all is over.
        bpy.ops.wm.redraw_timer(type="DRAW_WIN_SWAP", iterations=1)
        yield
    finally:
        context.workspace.status_text_set(None)
        window.cursor_set("DEFAULT")


def usual_percentage(sides: tuple[int, int]) -> int:
    """Return the size of a wiggle, in percent of a pair of this width and height in pixels, unless one is chosen; it is
    100 where they are 0, not known."""
    return min(max(USUAL_PERCENTAGE, math.ceil(100.0 * LEAST_PX / max(*sides, 1))), 100)


_suggested: set[str] = set()
"""Names of files, without ending, that were suggested since the extension was loaded."""


def suggested_path(last: str, stem: str, suffix: str) -> str:
    """Return the path that the File Browser begins with. last is the one of the export before, "" at the first, whose
    name stays where the user has typed it; stem is the name that fits the pair, with its folder, without ending. A
    number follows it where a file has that name: it may be of another pair.
    """
    path = Path(last)
    if last and path.stem not in _suggested:
        return last
    begun = str(path.with_name(Path(stem).name)) if last else stem
    names = itertools.chain([begun], (f"{begun}_{number}" for number in itertools.count(2)))
    free = next(name for name in names if not Path(f"{name}{suffix}").exists())
    _suggested.add(Path(free).name)
    return f"{free}{suffix}"


def _stem_of(context: bpy.types.Context) -> str:
    """Return the name that fits a wiggle of the pair that would be exported, with the folder of the .blend and without
    ending: of an animation's frame, with its number.
    """
    stem = str(Path(bpy.data.filepath).with_suffix("")) if bpy.data.filepath else "untitled"
    result = result_of(context.scene)
    frame = frame_shown(pair_in(context))
    if result.animation is not None and result.delivery is not None and _is_last_result(context):
        frame = result.delivery.frame
    return stem if frame is None else f"{stem}_{frame:04d}"


def _is_last_result(context: bpy.types.Context) -> bool:
    """Return whether the pair that would be exported is the scene's last result, or multiview's to compare with it."""
    pair, content, delivery = pair_in(context), content_now(), result_of(context.scene).delivery
    if pair is None or pair.type != "RENDER_RESULT" or content is None or delivery is None:
        return False
    return content in (delivery.content, delivery.multiview)


def _sides_of_pair(context: bpy.types.Context) -> tuple[int, int] | None:
    """Return width and height of the pair that would be exported, in pixels; None where they are not known: Blender
    tells them of a Render Result that is not ours only where an Image Editor shows it.
    """
    pair = pair_in(context)
    if pair is None or pair.type != "RENDER_RESULT":
        sides = (0, 0) if pair is None else tuple(pair.size)
        return sides if all(sides) else None
    result = result_of(context.scene)
    if not _is_last_result(context):
        return _drawn_sides(context, pair)
    if result.report is not None:
        return tuple(result.report["size"])
    assert result.delivery is not None
    rows = () if result.animation is None else result.animation["frames"]
    # A record of an earlier version may have no size.
    of_frame = (row for row in rows if row["frame"] == result.delivery.frame and row.get("size"))
    return next((tuple(row["size"]) for row in of_frame), None)


def _drawn_sides(context: bpy.types.Context, pair: bpy.types.Image) -> tuple[int, int] | None:
    """Return width and height of the pair in this image, in pixels, from the Image Editor of the context, or else from
    any that shows it; None where none does.
    """
    areas = [area for _, area in image_editors()]
    areas.sort(key=lambda area: area != context.area)
    sizes = (picture_size(area) for area in areas if area.spaces.active.image == pair)
    return next(filter(None, sizes), None)


def _export(scene: bpy.types.Scene, pair: bpy.types.Image, path: Path, percentage: float, seconds: float) -> None:
    """Write the pair in this image as a wiggle. Raises StereoReprojectError and OSError; then no file is left, and one
    that was there before stays.
    """
    suffix = path.suffix.lower()
    with work_folder(temporary_folder(), ()) as work, whole_file(path) as beside:
        pictures = wiggle_pictures(shown_views(scene, pair, work), percentage, suffix=suffix)
        if suffix == GIF:
            write_gif(beside, pictures, seconds)
            return
        paths = [work / f"{view}.png" for view in VIEWS]
        for picture, png in zip(pictures, paths, strict=True):
            write_png(png, picture)
        name = "programs.wiggle"
        command = module_in_blender(name) or module_command(name)
        make_wiggle_movie(command, paths, beside, seconds, work=work)
