"""Export a pair as a wiggle: a file that shows the eyes one after the other wherever pictures or movies play."""

from __future__ import annotations

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
from .preferences import temporary_folder
from .results import result_of
from .slots import content_now
from .text import reported, sentence, shown
from .view_modes import NO_PAIR, pair_in
from .wiggling import WIGGLE_SECONDS


class STEREO_REPROJECT_OT_export_wiggle(bpy.types.Operator, ExportHelper):
    """Save the stereo pair as a file that shows one eye after the other, for ever: an animated GIF, or a movie (MP4)"""

    bl_idname = "stereo_reproject.export_wiggle"
    bl_label = "Export Wiggle"

    # The name says which: an extension that is there is kept.
    filename_ext = GIF
    check_extension = None
    filter_glob: bpy.props.StringProperty(default="*.gif;*.mp4", options={"HIDDEN"})

    percentage: bpy.props.IntProperty(
        name="Size",
        description="Size of the file's pictures, in percent of the pair's",
        subtype="PERCENTAGE",
        default=50,
        min=1,
        max=100,
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

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Return whether there is a pair."""
        cls.poll_message_set(shown(NO_PAIR))
        return context.scene is not None and pair_in(context) is not None

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the settings beside the files, and the size in pixels where the pair's is known."""
        column = self.layout.column()
        column.use_property_split, column.use_property_decorate = True, False
        column.prop(self, "percentage")
        sides = _sides_of_pair(context)
        if sides is not None:
            width, height = wiggle_size(sides, self.percentage, suffix=Path(self.filepath).suffix.lower() or GIF)
            row = column.row()
            row.alignment = "RIGHT"
            row.label(text=shown(Words("{width} x {height} pixels", width=width, height=height)))
        column.prop(self, "seconds")
        for line in (
            "A name that ends in .mp4 is a movie, with all colours;",
            "any other is a GIF, which plays anywhere",
        ):
            self.layout.label(text=line)

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Write the file, whole or not at all; report an error in one line."""
        path = Path(bpy.path.abspath(self.filepath))
        path = path if path.suffix else path.with_suffix(GIF)
        pair = pair_in(context)
        assert pair is not None
        try:
            check_wiggle_path(path)
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


def _sides_of_pair(context: bpy.types.Context) -> tuple[int, int] | None:
    """Return width and height of the pair that would be exported, in pixels; None where they are not known: Blender
    does not tell them of a Render Result that is not ours.
    """
    pair = pair_in(context)
    if pair is None or pair.type != "RENDER_RESULT":
        sides = (0, 0) if pair is None else tuple(pair.size)
        return sides if all(sides) else None
    result, content = result_of(context.scene), content_now()
    delivery = result.delivery
    if result.report is None or delivery is None or content is None:
        return None
    if content not in (delivery.content, delivery.multiview):
        return None
    return tuple(result.report["size"])


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
