"""Any frame of a stereo animation, looked at in the Image Editor from its files. A Blender without a display has
windows too, which nobody sees."""

import bpy
import numpy as np
import pytest

from tests.blender.toolbox import add_camera, empty_scene

SIZE = (16, 8)
EYES = {"left": 0.2, "right": 0.45}
"""Grey of each eye in the first frame; in the second it is twice that."""

QUANTISATION = 0.5 / 255.0


@pytest.fixture
def scene(extension, tmp_path):
    """A scene whose stereo animation has two frames, as files for each eye; its Stereoscopy is off."""
    scene = empty_scene(*SIZE)
    add_camera(scene)
    scene.frame_end = 3
    scene.view_settings.view_transform = "Standard"
    scene.render.filepath = str(tmp_path / "shot_")
    scene.render.image_settings.file_format = "PNG"
    bpy.ops.render.render()
    for frame in (1, 2):
        for view, ending in (("left", "L"), ("right", "R")):
            save_grey(tmp_path / f"shot_{frame:04d}_{ending}.png", [frame * EYES[view]])
    return scene


@pytest.fixture
def area(scene):
    """The only Image Editor, which shows the Render Result."""
    area = bpy.context.window_manager.windows[0].screen.areas[0]
    area.type = "IMAGE_EDITOR"
    area.spaces.active.image = bpy.data.images["Render Result"]
    return area


def save_grey(path, greys):
    """Save a picture of these greys beside each other, as they are in a file."""
    width, height = SIZE
    image = bpy.data.images.new("grey", width * len(greys), height)
    row = np.repeat(np.asarray(greys, np.float32), width)[:, None] * np.ones(4, np.float32)
    row[:, 3] = 1.0
    image.pixels.foreach_set(np.tile(row, (height, 1)).ravel())
    image.filepath_raw, image.file_format = str(path), "PNG"
    image.save()
    bpy.data.images.remove(image)


def look(area):
    region = next(region for region in area.regions if region.type == "WINDOW")
    window = bpy.context.window_manager.windows[0]
    with bpy.context.temp_override(window=window, area=area, region=region):
        return bpy.ops.stereo_reproject.look_at_frame()


def show(area, mode):
    with bpy.context.temp_override(window=bpy.context.window_manager.windows[0], area=area):
        bpy.ops.stereo_reproject.show_view(mode=mode)


def linear(grey):
    return grey / 12.92 if grey <= 0.04045 else ((grey + 0.055) / 1.055) ** 2.4


def seen(area):
    """The greys of a picture's first and last column, as light."""
    image = area.spaces.active.image
    pixels = np.empty(4 * image.size[0] * image.size[1], np.float32)
    image.pixels.foreach_get(pixels)
    row = pixels.reshape(image.size[1], image.size[0], 4)[0, :, 0]
    return float(row[0]), float(row[-1])


def near(*greys):
    return pytest.approx([linear(grey) for grey in greys], abs=2.0 * QUANTISATION)


def test_a_frame_with_a_file_for_each_eye_is_a_pair_that_follows_the_timeline(scene, area):
    assert look(area) == {"FINISHED"}
    space = area.spaces.active
    assert (space.image.name, space.image.is_stereo_3d, space.show_stereo_3d) == ("Stereo Frames", True, True)
    assert not scene.render.use_multiview
    show(area, "SIDE_BY_SIDE")
    assert seen(area) == near(0.2, 0.45)
    scene.frame_set(2)
    assert space.image.name == "Stereo Side by Side of Stereo Frames"
    assert seen(area) == near(0.4, 0.9)
    # Not rendered yet: what was shown stays.
    scene.frame_set(3)
    assert seen(area) == near(0.4, 0.9)
    scene.frame_set(1)
    assert seen(area) == near(0.2, 0.45)


def test_the_way_of_looking_stays_and_a_second_press_shows_the_render_result(scene, area):
    look(area)
    show(area, "RIGHT")
    scene.frame_current = 2
    look(area)
    assert (area.spaces.active.image.name, seen(area)) == ("Stereo Right of Stereo Frames", near(0.9, 0.9))
    show(area, "ANAGLYPH")
    look(area)
    assert area.spaces.active.image.type == "RENDER_RESULT"


def test_a_file_with_both_eyes_beside_each_other_is_a_pair(scene, area, tmp_path):
    settings = scene.render.image_settings
    settings.views_format = "STEREO_3D"
    settings.stereo_3d_format.display_mode = "SIDEBYSIDE"
    settings.stereo_3d_format.use_sidebyside_crosseyed = True
    save_grey(tmp_path / "shot_0001.png", [0.7, 0.1])
    look(area)
    assert tuple(area.spaces.active.image.size) == SIZE
    show(area, "SIDE_BY_SIDE")
    assert seen(area) == near(0.1, 0.7)


def test_what_cannot_be_looked_at_says_why(scene, area):
    from stereo_reproject_extension.operators.frames_shown import missing_frame

    scene.frame_set(3)
    with pytest.raises(RuntimeError, match=r"Frame 3 is not there: .*shot_0003_L\.png does not exist"):
        look(area)
    if hasattr(scene.render.image_settings, "media_type"):
        scene.render.image_settings.media_type = "VIDEO"
    else:
        scene.render.image_settings.file_format = "FFMPEG"
    assert missing_frame(scene, 1) == "A movie has no files of single frames: play it"


def test_at_a_frame_that_is_not_there_the_panel_says_which_is_shown_and_a_press_goes_back(scene, area):
    from stereo_reproject_extension.operators.frames_shown import stays_words

    def said():
        with bpy.context.temp_override(window=bpy.context.window_manager.windows[0], area=area):
            return stays_words(bpy.context)

    scene.frame_set(2)
    look(area)
    assert said() is None
    scene.frame_set(3)
    assert said() == "Frame 2 is shown: frame 3 has no file."
    assert look(area) == {"FINISHED"}
    assert area.spaces.active.image.type == "RENDER_RESULT"
    assert said() is None


def test_a_wiggle_of_a_frame_has_its_number(scene, area):
    from stereo_reproject_extension.operators.wiggle_export import _stem_of

    scene.frame_set(2)
    look(area)
    with bpy.context.temp_override(window=bpy.context.window_manager.windows[0], area=area):
        assert _stem_of(bpy.context) == "untitled_0002"


def test_the_user_s_image_of_the_same_name_stays_as_it_is(scene, area):
    own = bpy.data.images.new("Stereo Frames", *SIZE)
    look(area)
    scene.frame_set(2)
    assert area.spaces.active.image.name == "Stereo Frames.001"
    show(area, "SIDE_BY_SIDE")
    assert seen(area) == near(0.4, 0.9)
    assert (own.source, own.filepath) == ("GENERATED", "")


def test_switched_off_it_leaves_no_image(scene, area, extension):
    look(area)
    extension.unregister()
    try:
        assert "Stereo Frames" not in bpy.data.images
        scene.frame_set(2)
    finally:
        extension.register()
