"""What Image Editors show while a job runs, and after an undo. A Blender without a display has windows too, which
nobody sees."""

from types import SimpleNamespace

import bpy
import numpy as np
import pytest

from tests.blender.toolbox import add_camera, empty_scene

SIZE = (16, 8)

ZOOM_ROUNDING = 2.0**-22
"""Of a zoom in single precision, relative. Blender's own operator leaves a margin of some pixels: more than that."""


@pytest.fixture
def scene(extension):
    """A scene whose pair was rendered with F12."""
    scene = empty_scene(*SIZE)
    add_camera(scene)
    scene.render.use_multiview = True
    bpy.ops.render.render()
    return scene


@pytest.fixture
def area(scene):
    """The only Image Editor, which shows the Render Result."""
    area = bpy.context.window_manager.windows[0].screen.areas[0]
    area.type = "IMAGE_EDITOR"
    area.spaces.active.image = result()
    return area


@pytest.fixture
def opened(scene):
    """An image that holds a pair and is no render."""
    return bpy.data.images.new("opened", *SIZE)


@pytest.fixture
def picture(scene, tmp_path):
    """An event with a picture of an eye under way."""
    image = bpy.data.images.new("eye", *SIZE)
    image.filepath_raw, image.file_format = str(tmp_path / "eye.png"), "PNG"
    image.save()
    bpy.data.images.remove(image)
    return {"event": "picture", "view": "left", "file": str(tmp_path / "eye.png")}


@pytest.fixture
def job(scene):
    """A job that runs, as it does behind the panel's buttons."""
    from stereo_reproject_extension.operators import jobs
    from stereo_reproject_extension.operators.render import RENDER_OT_stereo_reproject_image as operator

    jobs._running.append(operator.start(SimpleNamespace(preview=False), scene))
    yield jobs.running()
    jobs.stop_running()


def result():
    return next(image for image in bpy.data.images if image.type == "RENDER_RESULT")


def left_eye(pair):
    """The image of ours with a pair's left eye."""
    from stereo_reproject_extension.operators.view_images import _made

    return _made(pair, "LEFT", {"left": np.ones((*SIZE[::-1], 4), np.float32)})


def kind_and_pair(image):
    """Which image of ours it is, and the name of the image that holds its pair."""
    from stereo_reproject_extension.operators.pictures import KIND, PAIR

    return image[KIND], image[PAIR]


def undo(takes):
    """Have images taken away as by an undo."""
    for handlers, state in ((bpy.app.handlers.undo_pre, "before"), (bpy.app.handlers.undo_post, "after")):
        if state == "after":
            for image in takes:
                bpy.data.images.remove(image)
        for handler in [function for function in handlers if "stereo_reproject" in function.__module__]:
            handler()


def look(area, pair):
    """Look at a pair's left eye, as the button has it."""
    from stereo_reproject_extension.operators.view_modes import show

    with bpy.context.temp_override(window=bpy.context.window_manager.windows[0], area=area):
        show(bpy.context, pair, "LEFT")


def begun(picture):
    """Begin to show the pictures of a job."""
    from stereo_reproject_extension.operators import under_way

    under_way.open_editor(fit=True)
    under_way.update(picture)
    return under_way


@pytest.mark.parametrize("holds_pair", ["render", "opened"])
def test_a_job_that_fails_after_a_wiggle_leaves_the_pair(area, opened, picture, holds_pair):
    from stereo_reproject_extension.operators.view_images import remove_unused

    pair = result() if holds_pair == "render" else opened
    space = area.spaces.active
    space.image = left_eye(pair)
    under_way = begun(picture)
    assert space.image.name == "Stereo Render (left eye)"
    remove_unused()
    under_way.give_back()
    assert space.image == pair


def test_a_job_that_fails_gives_back_what_was_shown(area, picture):
    space = area.spaces.active
    ours = space.image = left_eye(result())
    begun(picture).give_back()
    assert space.image == ours


def test_a_new_pair_is_shown_as_the_render_before_it(area, picture):
    space = area.spaces.active
    ours = space.image = left_eye(result())
    assert begun(picture).hand_over()
    assert space.image == ours


@pytest.mark.parametrize("known", [False, True])
def test_a_new_pair_is_looked_at_as_another_image_s_before_it(area, opened, picture, known):
    space = area.spaces.active
    left_eyes = [left_eye(result())] if known else []
    space.image = left_eye(opened)
    assert begun(picture).hand_over()
    assert (space.image.name, kind_and_pair(space.image)) == ("Stereo Left", ("LEFT", result().name))
    assert not known or space.image in left_eyes


def test_a_picture_is_fitted_by_no_operator_while_a_job_runs(area, job):
    from stereo_reproject_extension.operators.pictures import fit_editor, fit_result

    space, window = area.spaces.active, bpy.context.window_manager.windows[0]
    space.zoom_percentage = 100.0
    fit_result()
    assert space.zoom_percentage == 100.0, "Blender does not tell the Render Result's size"
    space.image = left_eye(result())
    assert not job.finished
    fit_editor(window, area)
    region = next(region for region in area.regions if region.type == "WINDOW")
    whole = 100.0 * min(region.width / SIZE[0], region.height / SIZE[1])
    assert space.zoom_percentage == pytest.approx(whole, rel=ZOOM_ROUNDING)


def test_a_pair_that_an_undo_takes_away_is_shown_again(area):
    look(area, result())
    undo([area.spaces.active.image])
    assert area.spaces.active.image.name == "Stereo Left"


def test_an_undo_brings_no_pair_to_an_editor_that_was_turned_to_something_else(area, opened):
    look(area, result())
    area.spaces.active.image = opened
    undo([opened])
    assert area.spaces.active.image is None


def test_an_undo_while_a_job_runs_shows_nothing(area, job):
    look(area, result())
    undo([area.spaces.active.image])
    assert area.spaces.active.image is None
