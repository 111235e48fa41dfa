"""The folder of many views follows from the scene's output path."""

from pathlib import Path

import bpy
import pytest

from stereo_reproject.blender.output.views_output import views_folder
from stereo_reproject.errors import BadInputError
from tests.blender.snapshot import everything
from tests.blender.toolbox import empty_scene


@pytest.mark.parametrize(
    ("path", "wanted"),
    [
        ("shot_", "shot_0007_views"),
        ("shot_##.png", "shot_07.png_views"),
        ("", "Room_0007_views"),
        ("####", "Room_0007_views"),
    ],
)
@pytest.mark.parametrize("multiview", [False, True])
def test_it_is_called_as_the_picture_of_the_frame(tmp_path, path, wanted, multiview):
    scene = empty_scene(8, 8)
    scene.name, scene.render.use_multiview = "Room", multiview
    scene.render.filepath = f"{tmp_path}/{path}"
    before = everything()
    assert views_folder(scene, 7) == tmp_path / wanted
    assert everything() == before


@pytest.mark.parametrize("name", ["shot_.mp4", "shot_", "shot_####.mp4"])
def test_a_movie_s_name_has_one_frame_and_no_ending(tmp_path, name):
    scene = empty_scene(8, 8)
    settings = scene.render.image_settings
    if hasattr(settings, "media_type"):
        settings.media_type = "VIDEO"
    settings.file_format = "FFMPEG"
    scene.render.filepath, scene.frame_end = str(tmp_path / name), 48
    before = everything()
    assert views_folder(scene, 7) == tmp_path / "shot_0007_views"
    assert everything() == before


def test_a_path_beside_a_file_that_was_never_saved_is_refused():
    scene = empty_scene(8, 8)
    scene.render.filepath = "//shot_"
    with pytest.raises(BadInputError, match="never saved"):
        views_folder(scene, 1)


def test_a_path_beside_the_file(tmp_path):
    scene = empty_scene(8, 8)
    scene.render.filepath = "//"
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "house.blend"))
    assert views_folder(bpy.context.scene, 3) == Path(tmp_path) / "house_0003_views"
