"""Render many views of a frame, for light-field displays and lenticular prints, and show their quilt."""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path

import bpy

from ..stereo_reproject.blender.engines.views_renderer import check_views
from ..stereo_reproject.blender.output.views_output import views_folder
from ..stereo_reproject.blender.scene.rendered import CYCLES, EEVEE
from ..stereo_reproject.blender.scene.rig import check_camera
from ..stereo_reproject.delivery.quilts import QUILT_FILE
from ..stereo_reproject.errors import BadInputError
from ..stereo_reproject.report.views_verdict import verdicts_on_views
from ..stereo_reproject.settings.frame import StereoSettings
from ..stereo_reproject.settings.views import ViewsSettings
from ..stereo_reproject.words import Words
from . import under_way
from .jobs import JobOperator
from .pictures import QUILT, fit_editor, image_editors, show_image
from .render import settings_of
from .results import DeliveredViews, keep_views
from .run import BackgroundJob
from .text import reported, sentence, shown
from .views_job import ViewsJob
from .views_properties import views_settings_of


class RENDER_OT_stereo_reproject_views(JobOperator, bpy.types.Operator):
    """Render the views of a light-field display for the price of a few of them: the others are made from those. Quilt,
    views and a movie go into a folder beside the output path"""

    bl_idname = "render.stereo_reproject_views"
    bl_label = "Render Quilt (Reprojected)"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Return whether a job can start now, and the scene can be rendered as many views."""
        if not super().poll(context):
            return False
        reason = views_obstacle(context.scene)
        if reason is not None:
            cls.poll_message_set(sentence(shown(reason)))
        return reason is None

    def start(self, scene: bpy.types.Scene) -> BackgroundJob:
        """Start a job that renders the views of the present frame, and return it."""
        views = views_settings_of(scene)
        output = views_folder(scene, scene.frame_current)
        pictures = under_way.wanted_pictures(first_look=False)
        return ViewsJob(scene, frame_settings(scene, views), views, output, pictures)

    def fits_pictures(self, _scene: bpy.types.Scene) -> bool:
        """Return that pictures are fitted to the Image Editor: a view is rarely as large as what was shown before."""
        return True

    def take(self, scene: bpy.types.Scene | None, run: BackgroundJob) -> str:
        """Show the quilt, keep the report for the panels, and return a line with the verdict and the folder."""
        assert isinstance(run, ViewsJob)
        assert run.report is not None
        views = DeliveredViews(run.report, run.output, time.strftime("%H:%M"))
        image = load_quilt(views)
        run.close()
        if bpy.context.window is not None and not bpy.app.background:
            _show(image)
        if scene is not None:
            keep_views(scene, views)
        counts, quality, saved = (verdict.words for verdict in verdicts_on_views(run.report))
        message = "{counts}. {quality}. {saved}: {folder}"
        return reported(Words(message, counts=counts, quality=quality, saved=saved, folder=run.output))


def frame_settings(scene: bpy.types.Scene, views: ViewsSettings) -> StereoSettings:
    """Return the settings of each picture: those of the panel, as far as views have them, in the display's size."""
    chosen = settings_of(scene, preview=False)
    overrides = replace(chosen.scene, panorama=None, size=views.view_size)
    return replace(chosen, source=StereoSettings.source, fill=StereoSettings.fill, scene=overrides)


def views_obstacle(scene: bpy.types.Scene) -> BadInputError | None:
    """Return why many views cannot be rendered of the scene with the chosen settings; None where nothing is in the
    way.
    """
    chosen = scene.stereo_reproject.source_engine
    engine = {"cycles": CYCLES, "eevee": EEVEE[0]}.get(chosen, scene.render.engine)
    try:
        check_views(check_camera(scene.camera), engine)
        views_settings_of(scene)
    except BadInputError as error:
        return error
    return None


OURS = "stereo_reproject_quilt"
"""Property of the image of a quilt, by which the next one finds it: its name may be another image's."""


def quilt_of(views: DeliveredViews) -> Path | None:
    """Return the quilt among the files of many views; None where it is gone."""
    names = (name for name in views.report.get("files", ()) if QUILT_FILE.fullmatch(name))
    quilts = (views.folder / name for name in names if name.endswith(".png"))
    return next((path for path in quilts if path.is_file()), None)


def load_quilt(views: DeliveredViews) -> bpy.types.Image | None:
    """Load the quilt of many views and return it as an image, in place of the earlier one. It is not saved with the
    .blend: its file stays. Return None where there is no file.
    """
    path = quilt_of(views)
    if path is None:
        return None
    old = next((image for image in bpy.data.images if OURS in image), None)
    image = bpy.data.images.load(str(path))
    image.is_runtime_data, image[OURS] = True, True
    if old is not None:
        old.user_remap(image)
        bpy.data.images.remove(old)
    image.name = QUILT
    return image


def _show(image: bpy.types.Image | None) -> None:
    """Show the quilt in the editor that was chosen for the job, or else in another Image Editor, fitted to it."""
    if image is None:
        return
    if not under_way.hand_over_to(image):
        show_image(image)
    for window, area in image_editors():
        if area.spaces.active.image == image:
            fit_editor(window, area)
