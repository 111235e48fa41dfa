"""The output of an animation whose frames are many views: names, folder, and the movie that is made of their quilts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from ...delivery.layouts import LAYOUTS
from ...delivery.marks import write_marks_of
from ...delivery.quilts import Quilt, with_smaller_views
from ...errors import BadInputError, StereoReprojectError
from ...sequence.quilt_frames import FRAMES_NAME, SCENE_VIEWS_NAME, QuiltFrames
from ...settings.animation import AnimationSettings
from ...settings.views import VIEWS_LAYOUTS, ViewsSettings
from ...words import Words
from ..scene.rig import frame_region
from ..scene.working import changed
from .animation_output import Output, check_output, movie_path
from .movie import encode, movie_scene, read_opaque
from .quilt_files import quilt_of

SQUARE_PIXELS = {"pixel_aspect_x": 1.0, "pixel_aspect_y": 1.0}
"""A quilt's own: what shape its views have is said by its name alone."""


@dataclass(frozen=True)
class QuiltOutput(Output):
    """The output of an animation of many views; `files` are the PNGs of the quilts, one for each frame, or those of the
    views where frames have no quilt. Then no movie is made."""

    frames: QuiltFrames

    @property
    def _quilt(self) -> Quilt:
        """The grid of the frames' quilts, of which a movie is made."""
        assert self.frames.quilt is not None
        return self.frames.quilt

    def movie_warnings(self, path: Path) -> list[str]:
        """Return a warning where the movie's name does not end as players read it; else an empty list."""
        tag = self._quilt.tag
        if path.stem.endswith(tag):
            return []
        return [f"players know a quilt by its name alone: {path.stem}_{tag}{path.suffix} tells it"]

    def movie_size(self, scene: bpy.types.Scene, size: tuple[int, int] | None) -> tuple[int, int]:  # noqa: ARG002
        """Return the width and height of the movie in pixels, by the quilt alone."""
        return self._quilt.movie_size

    def write_movie(self, scene: bpy.types.Scene, path: Path, folder: Path) -> list[Path]:
        """Write the movie of all quilts into `folder`, under the name that `path` has, and return its path. Raises
        BadInputError and StereoReprojectError."""
        folder.mkdir(exist_ok=True)
        with movie_scene(scene, path.suffix.lower()) as copy, changed(copy.render, **SQUARE_PIXELS):
            made, _ = encode(copy, self.files, self._shown, folder, linear=False)
            finished = made.replace(folder / path.name)
        # Blender 5.2 marks some movies as stereo ones.
        write_marks_of(finished, LAYOUTS["individual"])
        return [finished]

    def _shown(self, frame: int) -> NDArray[np.float32]:
        """Return the picture (H, W, 4) of a frame as the movie shows it. Raises StereoReprojectError where its file
        cannot be read, or has another size."""
        (path,), quilt = self.files[frame], self._quilt
        picture = read_opaque(path, linear=False)
        (width, height), (rows, columns) = quilt.view_size, picture.shape[:2]
        if (columns, rows) != (width * quilt.columns, height * quilt.rows):
            raise StereoReprojectError(Words("{path} has another size than the quilt: render it anew", path=path))
        return with_smaller_views(picture, quilt)


def quilt_output_of(
    scene: bpy.types.Scene,
    options: AnimationSettings,
    views: ViewsSettings,
    size: tuple[int, int] | None,
    view_files: Mapping[str, str],
) -> tuple[AnimationSettings, QuiltOutput]:
    """Return the options completed by what the scene says, and the output of frames of many views. The options name
    frames and folder; size is that of a view, (width, height), None for the scene's own; view_files are the names of
    the views' files, without an extension, by view. The scene's pixels must have their shape. Raises BadInputError when
    files cannot be written, or a quilt is needed and the views have none.
    """
    assert options.output is not None
    assert options.frames is not None
    quilt, layout = _quilt(scene, views, size), _stored(views, options)
    if quilt is None and layout is None:
        raise BadInputError("frames of many views are quilts: name the quilt's columns and rows")
    if quilt is None and options.movie is not None:
        raise BadInputError("a movie of many views shows their quilts: name the quilt's columns and rows")
    folder, files = Path(options.output), QuiltFrames(quilt, view_files, layout)
    values = {"views": asdict(replace(views, display=None)), "quilt": None if quilt is None else asdict(quilt)}
    if views.from_scene:
        # They are in no fingerprint of the scene: pairs do not depend on them.
        values["scene_views"] = [(name, scene.render.views[name].camera_suffix) for name in view_files]
    output = QuiltOutput(
        folder=folder,
        name=SCENE_VIEWS_NAME if views.from_scene else FRAMES_NAME,
        files={frame: [folder / name for name in files.pictures(frame)] for frame in options.frames},
        layout=None,
        file_format="PNG" if quilt is not None else "OPEN_EXR",
        movie_layout=None,
        values=values,
        half_floats=True,
        panorama=None,
        lacks_mark=False,
        frames=files,
    )
    if quilt is not None and options.movie is not None:
        stem = Path(bpy.data.filepath).stem or scene.name
        options = replace(options, movie=str(movie_path(options.movie, folder, f"{stem}_{quilt.tag}.mp4")))
    check_output(output, options)
    return options, output


def _stored(views: ViewsSettings, options: AnimationSettings) -> str | None:
    """Return how the views of a frame are stored besides their quilt, one of `VIEWS_LAYOUTS`; None where they are
    not."""
    return views.layout if options.views or views.from_scene or views.layout != VIEWS_LAYOUTS[0] else None


def _quilt(scene: bpy.types.Scene, views: ViewsSettings, size: Sequence[int] | None) -> Quilt | None:
    """Return the grid of the quilt; None where the views have none."""
    render = scene.render
    own = {} if size is None else {"resolution_x": size[0], "resolution_y": size[1], "resolution_percentage": 100}
    with changed(render, **own):
        region = frame_region(render)
    return quilt_of(scene, views, (region.width, region.height))
