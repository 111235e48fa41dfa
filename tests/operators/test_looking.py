"""Looking at a pair without glasses, as far as it needs no window: images, the export, and multiview's slot."""

import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import bpy
import imageio_ffmpeg
import numpy as np
import pytest
from PIL import Image

from tests.blender.snapshot import everything
from tests.blender.toolbox import add_camera, add_plane, add_sun, diffuse, empty_scene, noise_image
from tests.delivery.movies import described

SIZE = (96, 54)

GIF_LEVELS = 10.0
"""Mean difference of a GIF's channels from the eyes, at most: half of its dither's range."""

MOVIE_LEVELS = 12.0
"""Mean difference of a movie's channels from the eyes, at most: H.264 at Blender's own quality, with half the colour
along each side, of a noisy picture."""


class Drawn:
    """A layout that notes labels, and buttons with whether they are pressed; it stands for its parts too."""

    def __init__(self):
        self.labels, self.buttons = [], []

    def label(self, *, text, **_):
        self.labels.append(text)

    def operator(self, _name, *, depress, **_):
        self.buttons.append((SimpleNamespace(), depress))
        return self.buttons[-1][0]

    def __getattr__(self, name):
        return lambda *_, **__: self


@pytest.fixture
def scene(tmp_path):
    scene = empty_scene(*SIZE, samples=4)
    add_plane(scene, diffuse(image=noise_image(tmp_path)), size=(30, 20), location=(0, 0, -8), rotation=(-0.5, 0, 0))
    add_plane(scene, diffuse(colour=(0.8, 0.2, 0.1)), size=(1, 2), location=(0.3, 0.2, -4))
    add_sun(scene, strength=1.5)
    add_camera(scene)
    scene.render.dither_intensity = 0.0
    return scene


@pytest.fixture
def pair(extension, scene):
    """A scene whose pair is the Render Result."""
    assert bpy.ops.render.stereo_reproject_image() == {"FINISHED"}
    return scene


def render_result():
    return next(image for image in bpy.data.images if image.type == "RENDER_RESULT")


def eyes(scene, folder):
    """Both eyes as a screen shows them, in bytes."""
    from stereo_reproject_extension.stereo_reproject.blender.output.saved_views import shown_views

    folder.mkdir(exist_ok=True)
    return {name: 255.0 * view for name, view in shown_views(scene, render_result(), folder).items()}


def pixels(image):
    width, height = image.size
    return np.array(image.pixels[:], np.float32).reshape(height, width, 4)[::-1]


def test_after_a_plain_render_in_its_slot_there_is_no_pair_to_look_at(pair):
    from stereo_reproject_extension.operators import drawing
    from stereo_reproject_extension.operators.results import result_of
    from stereo_reproject_extension.operators.view_modes import pair_in

    context = SimpleNamespace(scene=pair, space_data=None, region=None, preferences=bpy.context.preferences)
    assert pair_in(context) == render_result()
    assert drawing.slot_words(context, result_of(pair).delivery) is None
    assert bpy.ops.render.render() == {"FINISHED"}
    assert pair_in(context) is None
    assert drawing.slot_words(context, result_of(pair).delivery) == "Another render has taken its slot."


def test_our_images_hold_the_eyes_and_are_not_saved(pair, tmp_path):
    from stereo_reproject_extension.operators.view_images import ARRANGEMENTS, made_images
    from stereo_reproject_extension.stereo_reproject.blender.output.saved_views import linear_views

    views = linear_views(pair, render_result(), tmp_path)
    assert np.abs(views["left"] - views["right"]).mean() > 0.0
    images = made_images(pair, render_result(), list(ARRANGEMENTS))
    for kind, order in ARRANGEMENTS.items():
        expected = np.concatenate([views[view] for view in order], axis=1)
        np.testing.assert_array_equal(pixels(images[kind]), expected)
        assert not images[kind].is_dirty
        assert images[kind].use_view_as_render
    names = {image.name for image in images.values()}
    assert names == {"Stereo Left", "Stereo Right", "Stereo Side by Side", "Stereo Cross-Eyed"}
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "saved.blend"), copy=True)
    with bpy.data.libraries.load(str(tmp_path / "saved.blend")) as (there, _):
        assert names.isdisjoint(there.images)


def test_images_made_anew_take_the_place_of_the_earlier_ones(pair):
    from stereo_reproject_extension.operators.view_images import made_images, remove_all

    before = len(bpy.data.images)
    for _ in range(2):
        made_images(pair, render_result(), ["LEFT"])
    assert len(bpy.data.images) == before + 1
    remove_all()
    assert len(bpy.data.images) == before


def test_a_user_s_own_image_of_that_name_is_left_alone(pair):
    from stereo_reproject_extension.operators.view_images import made_images, remove_all

    own = bpy.data.images.new("Stereo Left", 4, 4)
    made_images(pair, render_result(), ["LEFT"])
    made_images(pair, render_result(), ["LEFT"])
    assert own.name == "Stereo Left"
    assert tuple(own.size) == (4, 4)
    remove_all()
    assert bpy.data.images["Stereo Left"] == own


def test_a_gif_shows_left_and_right_for_ever_and_changes_nothing(pair, tmp_path):
    path = tmp_path / "wiggle.gif"
    before = everything()
    assert bpy.ops.stereo_reproject.export_wiggle(filepath=str(path), percentage=100, seconds=0.25) == {"FINISHED"}
    assert everything() == before
    expected = eyes(pair, tmp_path / "eyes")
    with Image.open(path) as file:
        assert (file.size, file.n_frames, file.info["loop"], file.info["duration"]) == (SIZE, 2, 0, 250)
        for number, view in enumerate(("left", "right")):
            file.seek(number)
            off = {name: np.abs(np.array(file.convert("RGB")) - eye).mean() for name, eye in expected.items()}
            assert off[view] < GIF_LEVELS
            assert off[view] == min(off.values())


def test_a_gif_follows_the_view_transform(pair, tmp_path):
    means = []
    for transform in ("Raw", "Standard"):
        pair.view_settings.view_transform = transform
        bpy.ops.stereo_reproject.export_wiggle(filepath=str(tmp_path / f"{transform}.gif"))
        with Image.open(tmp_path / f"{transform}.gif") as file:
            means.append(np.array(file.convert("RGB")).mean())
    assert means[1] > means[0] + 10.0


def test_a_movie_alternates_and_has_even_sides(pair, tmp_path):
    path = tmp_path / "wiggle.mp4"
    assert bpy.ops.stereo_reproject.export_wiggle(filepath=str(path), percentage=99, seconds=0.2) == {"FINISHED"}
    width, height = 94, 52
    assert f"{width}x{height}" in described(path)
    assert "30 fps" in described(path)
    command = [imageio_ffmpeg.get_ffmpeg_exe(), "-v", "error", "-i", path, "-f", "rawvideo", "-pix_fmt", "rgb24", "-"]
    raw = subprocess.run(command, capture_output=True, check=True).stdout
    shown = np.frombuffer(raw, np.uint8).reshape(-1, height, width, 3).astype(float)
    assert len(shown) == 300
    from stereo_reproject.images.resizing import made_smaller

    expected = {name: made_smaller(eye, width, height) for name, eye in eyes(pair, tmp_path / "eyes").items()}
    # Six frames for each eye: the middle one of each turn.
    for number, frame in enumerate(shown[3::6]):
        view = ("left", "right")[number % 2]
        off = {name: np.abs(frame - eye).mean() for name, eye in expected.items()}
        assert off[view] == min(off.values())
        assert off[view] < MOVIE_LEVELS


@pytest.mark.parametrize(
    ("name", "words"),
    [("wiggle.avi", "must end in"), ("no/where/wiggle.gif", "There is no folder"), ("a.gif", "folder")],
)
def test_a_path_that_cannot_be_is_one_line_and_leaves_nothing(pair, tmp_path, name, words):
    place = tmp_path / "place"
    (place / "a.gif").mkdir(parents=True)
    with pytest.raises(RuntimeError, match=words) as error:
        bpy.ops.stereo_reproject.export_wiggle(filepath=str(place / name))
    assert len(str(error.value).strip().splitlines()) == 1
    assert [path.name for path in place.iterdir()] == ["a.gif"]
    assert list((place / "a.gif").iterdir()) == []


@pytest.mark.skipif(sys.platform == "win32", reason="limits of names are others there")
def test_an_earlier_file_stays_where_the_new_one_cannot_be_written(pair, tmp_path):
    """Its name fits, but not the longer one of the file that takes its place."""
    place = tmp_path / "place"
    place.mkdir()
    path = place / f"{240 * 'w'}.gif"
    path.write_bytes(b"earlier")
    with pytest.raises(RuntimeError, match="cannot be written"):
        bpy.ops.stereo_reproject.export_wiggle(filepath=str(path))
    assert path.read_bytes() == b"earlier"
    assert list(place.iterdir()) == [path]


@pytest.mark.parametrize(("percentage", "name", "sides"), [(50, "a.gif", (48, 27)), (99, "a.mp4", (94, 52))])
def test_the_export_says_how_many_pixels_it_writes(extension, percentage, name, sides):
    from stereo_reproject_extension.operators.wiggle_export import STEREO_REPROJECT_OT_export_wiggle

    drawn = Drawn()
    operator = SimpleNamespace(layout=drawn, percentage=percentage, filepath=name, sides=SIZE)
    STEREO_REPROJECT_OT_export_wiggle.draw(operator, bpy.context)
    assert f"{sides[0]} x {sides[1]} pixels" in drawn.labels


def test_of_another_render_that_no_editor_shows_the_export_names_no_pixels(pair):
    from stereo_reproject_extension.operators.wiggle_export import STEREO_REPROJECT_OT_export_wiggle, _sides_of_pair

    assert _sides_of_pair(bpy.context) == SIZE
    bpy.ops.render.render()
    assert _sides_of_pair(bpy.context) is None
    drawn = Drawn()
    operator = SimpleNamespace(layout=drawn, percentage=50, filepath="a.gif", sides=(0, 0))
    STEREO_REPROJECT_OT_export_wiggle.draw(operator, bpy.context)
    assert drawn.labels == []


def test_of_an_animation_s_frame_the_export_knows_size_and_number(extension, scene, tmp_path):
    from stereo_reproject_extension.operators.wiggle_export import _sides_of_pair, _stem_of

    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "film.blend"))
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end = 12, 12
    scene.render.filepath = str(tmp_path / "shots" / "shot_")
    assert bpy.ops.render.stereo_reproject_animation() == {"FINISHED"}
    assert _sides_of_pair(bpy.context) == SIZE
    assert _stem_of(bpy.context) == str(tmp_path / "film_0012")
    bpy.ops.render.render()
    assert _sides_of_pair(bpy.context) is None
    assert _stem_of(bpy.context) == str(tmp_path / "film")


def test_a_name_that_was_typed_stays_and_a_suggested_one_follows_the_frame(extension, tmp_path):
    from stereo_reproject_extension.operators.wiggle_export import suggested_path

    assert suggested_path("", "/a/film_0012", ".gif") == "/a/film_0012.gif"
    assert suggested_path("/b/film_0012.mp4", "/a/film_0020", ".gif") == str(Path("/b/film_0020.gif"))
    assert suggested_path("/b/mine.gif", "/a/film_0021", ".gif") == "/b/mine.gif"
    (tmp_path / "film.gif").touch()
    assert suggested_path("", str(tmp_path / "film"), ".gif") == str(tmp_path / "film_2.gif")
    (tmp_path / "film_2.gif").touch()
    again = suggested_path(str(tmp_path / "film_2.gif"), str(tmp_path / "film"), ".gif")
    assert again == str(tmp_path / "film_3.gif")


def test_the_number_of_a_suggested_name_is_that_of_its_ending(extension, tmp_path):
    """And a name that was typed keeps its number."""
    from stereo_reproject_extension.operators.wiggle_export import _renamed, suggested_path

    (tmp_path / "film.gif").touch()
    folder, as_movie = str(tmp_path), SimpleNamespace(format="MP4", stem="film")
    path = suggested_path("", str(tmp_path / "film"), ".gif")
    assert path == str(tmp_path / "film_2.gif")
    assert _renamed(path, as_movie, folder) == str(tmp_path / "film.mp4")
    assert _renamed("film_2.gif", as_movie, folder) == "film.mp4"
    assert _renamed("film_2.mp4", as_movie, folder) == "film_2.mp4"
    assert _renamed("mine_2.gif", as_movie, folder) == "mine_2.mp4"
    assert _renamed("film.mp4", SimpleNamespace(format="GIF", stem="film"), folder) == "film_2.gif"
    assert _renamed("film_2.gif", SimpleNamespace(format="MP4", stem=""), folder) == "film_2.mp4"


def test_the_button_of_the_picture_that_is_shown_is_pressed(pair):
    from stereo_reproject_extension.operators.image_panels import IMAGE_PT_stereo_reproject
    from stereo_reproject_extension.operators.pictures import load_picture
    from stereo_reproject_extension.operators.results import result_of

    shown = {"PAIR": render_result(), "HOLES": load_picture(pair, "HOLES"), "GRID": load_picture(pair, "GRID")}
    for which, image in shown.items():
        drawn = Drawn()
        space = SimpleNamespace(image=image)
        context = SimpleNamespace(space_data=space, region=None, preferences=bpy.context.preferences)
        IMAGE_PT_stereo_reproject._draw_pictures(SimpleNamespace(layout=drawn), context, result_of(pair))
        assert [button.which for button, pressed in drawn.buttons if pressed] == [which]
        assert len(drawn.buttons) == 5


def test_a_button_that_is_not_drawn_takes_no_room(pair, monkeypatch):
    """Of panoramas alone there is one more, whose name may be longer than all others."""
    from stereo_reproject_extension.operators.image_panels import IMAGE_PT_stereo_reproject
    from stereo_reproject_extension.operators.results import OF_PANORAMAS, PICTURES, result_of

    class Columns(Drawn):
        def grid_flow(self, *, columns, **_):
            self.columns = columns
            return self

    def columns():
        drawn, space = Columns(), SimpleNamespace(image=None)
        # Without a window Blender's own scale is 0.
        styles = bpy.context.preferences.ui_styles
        preferences = SimpleNamespace(system=SimpleNamespace(ui_scale=1.0), ui_styles=styles)
        context = SimpleNamespace(space_data=space, region=SimpleNamespace(width=500), preferences=preferences)
        IMAGE_PT_stereo_reproject._draw_pictures(SimpleNamespace(layout=drawn), context, result_of(pair))
        return drawn.columns

    assert columns() == 2
    monkeypatch.setitem(PICTURES, OF_PANORAMAS, ("cutouts.png", "In a Headset " * 9, ""))
    assert columns() == 2
    monkeypatch.setitem(PICTURES, "GRID", ("grid.png", "Grid " * 20, ""))
    assert columns() == 1


def test_without_a_pair_nothing_can_be_exported(extension, scene):
    assert not bpy.ops.stereo_reproject.export_wiggle.poll()


def test_a_comparison_puts_multiview_s_pair_into_a_slot_of_its_own(extension, scene, tmp_path):
    from stereo_reproject_extension.operators.results import result_of

    scene.stereo_reproject.compare = True
    second = scene.view_layers.new("Second")
    second.use_pass_normal = True
    before = everything()
    assert bpy.ops.render.stereo_reproject_image() == {"FINISHED"}
    assert everything() == before
    slots = render_result().render_slots
    count, active = len(slots), slots.active_index
    assert [slot.name for slot in slots].index("Multiview") == count - 1 != active
    delivery = result_of(scene).delivery
    assert result_of(scene).warnings == []
    assert (delivery.content.place, delivery.multiview.place) == (active, count - 1)
    ours = eyes(scene, tmp_path / "ours")
    slots.active_index = delivery.multiview.place
    multiview = eyes(scene, tmp_path / "multiview")
    assert not np.array_equal(multiview["left"], ours["left"]), "another seed"
    apart = np.abs(ours["right"] - multiview["right"]).mean()
    assert 0.0 < apart < 0.5 * np.abs(multiview["right"] - multiview["left"]).mean() + apart
    # Once more while multiview's slot is active: each goes where it was.
    assert bpy.ops.render.stereo_reproject_image() == {"FINISHED"}
    assert len(slots) == count
    again = result_of(scene).delivery
    assert (again.content.place, again.multiview.place) == (active, delivery.multiview.place)
    assert slots.active_index == active


def test_a_user_s_render_in_multiview_s_slot_is_left_alone(extension, scene):
    from stereo_reproject_extension.operators.results import result_of

    scene.stereo_reproject.compare = True
    bpy.ops.render.stereo_reproject_image()
    slots, place = render_result().render_slots, result_of(scene).delivery.multiview.place
    slots.active_index = place
    bpy.ops.render.render()
    slots.active_index = 0
    bpy.ops.render.stereo_reproject_image()
    assert result_of(scene).delivery.multiview.place != place
    assert slots[result_of(scene).delivery.multiview.place].name == "Multiview 2"


@pytest.mark.parametrize("known", [False, True], ids=["another scene's", "where a render has taken the pair's slot"])
def test_a_pair_beside_multiview_s_takes_nobody_s_slot(extension, scene, known):
    from stereo_reproject_extension.operators.results import result_of
    from stereo_reproject_extension.operators.slots import holds

    scene.stereo_reproject.compare = True
    bpy.ops.render.stereo_reproject_image()
    slots, first = render_result().render_slots, result_of(scene).delivery
    rendered = scene if known else scene.copy()
    if known:
        slots.active_index = first.content.place
        bpy.ops.render.render()
    else:
        # Blender saves no scene that nothing uses.
        rendered.use_fake_user = True
        bpy.context.window_manager.windows[0].scene = rendered
    rendered.stereo_reproject.compare = False
    slots.active_index = first.multiview.place
    with bpy.context.temp_override(scene=rendered):
        assert bpy.ops.render.stereo_reproject_image() == {"FINISHED"}
    content = result_of(rendered).delivery.content
    assert (content.place, content.name) == (len(slots) - 1, "Stereo Pair")
    assert holds(first.multiview)
    assert holds(first.content) == (not known)


@pytest.mark.parametrize(
    ("path", "kind", "named"),
    [
        ("/a/w.gif", "MP4", "/a/w.mp4"),
        ("w.MP4", "GIF", "w.gif"),
        ("shot.v2", "GIF", "shot.v2.gif"),
        ("", "MP4", ""),
        ("w.mp4", "MP4", "w.mp4"),
    ],
)
def test_a_wiggle_s_name_follows_its_format(extension, path, kind, named):
    from stereo_reproject_extension.operators.wiggle_export import named_as

    assert named_as(path, kind) == named


@pytest.mark.parametrize(
    ("sides", "percentage"), [((384, 216), 100), ((640, 360), 75), ((1920, 1080), 50), ((0, 0), 100)]
)
def test_a_wiggle_is_not_smaller_than_depth_is_seen_at(extension, sides, percentage):
    from stereo_reproject_extension.operators.wiggle_export import usual_percentage

    assert usual_percentage(sides) == percentage


def test_the_size_of_the_last_wiggle_is_not_that_of_the_next(extension):
    """Of a small pair, the share of a large one would be too small to see depth in."""
    properties = bpy.ops.stereo_reproject.export_wiggle.get_rna_type().properties
    assert properties["percentage"].is_skip_save
    assert not properties["seconds"].is_skip_save
