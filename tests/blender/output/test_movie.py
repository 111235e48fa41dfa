"""Movies of finished frames: what they show is what the frames are, and players are told the layout."""

import subprocess
from pathlib import Path

import bpy
import imageio_ffmpeg
import numpy as np
import pytest

from stereo_reproject.blender.commands.animation_movie import make_movie
from stereo_reproject.blender.output.animation_output import output_of
from stereo_reproject.blender.output.delivery import deliver_frames
from stereo_reproject.blender.output.layouts import as_ordered, save_display_values
from stereo_reproject.blender.output.movie import check_movie, movie_warnings, write_movie
from stereo_reproject.blender.output.movie_panorama import movie_panorama, shows_panorama
from stereo_reproject.delivery.projection import FRONT, WHOLE, MoviePanorama
from stereo_reproject.errors import BadInputError, StereoReprojectError
from stereo_reproject.images.passes import COLOUR_PASS
from stereo_reproject.sequence.journal import Journal
from stereo_reproject.sequence.progress import Listener
from stereo_reproject.settings.animation import AnimationSettings
from tests.blender.snapshot import everything
from tests.blender.toolbox import add_camera, add_plane, diffuse, empty_scene
from tests.delivery.movies import described, sphere, stereo

WIDTH, HEIGHT = 64, 32

CODEC = 0.06
"""A lossy codec's error in flat colours, in the mean over a picture; two of the test's colours differ by far more."""

COLOURS = [(0.8, 0.2, 0.1), (0.1, 0.7, 0.2), (0.2, 0.1, 0.8), (0.7, 0.7, 0.1)]


@pytest.fixture
def scene():
    scene = empty_scene(WIDTH, HEIGHT)
    add_plane(scene, diffuse(), size=(30, 20), location=(0, 0, -8))
    add_camera(scene)
    scene.render.fps = 24
    # Movies are shown as their frames are: none of these may change them once more.
    scene.view_settings.view_transform = "Standard"
    scene.view_settings.exposure = 1.5
    scene.render.use_stamp = True
    # As long as movies were never asked for, Blender has no settings for them.
    for media, file_format in (("VIDEO", "FFMPEG"), ("IMAGE", "PNG")):
        if hasattr(scene.render.image_settings, "media_type"):
            scene.render.image_settings.media_type = media
        scene.render.image_settings.file_format = file_format
    scene.render.ffmpeg.constant_rate_factor = "PERC_LOSSLESS"
    return scene


def picture(number, *, width=WIDTH, height=HEIGHT):
    """Its left half in the colour of that number, its right half in the next one's."""
    shown = np.empty((height, width, 3), np.float32)
    shown[:, : width // 2] = COLOURS[number % len(COLOURS)]
    shown[:, width // 2 :] = COLOURS[(number + 1) % len(COLOURS)]
    return shown


def save_frames(scene, folder, numbers, ends=("",)):
    """PNGs as an animation leaves them: the files of each frame."""
    found = {}
    for number in numbers:
        found[number] = [folder / f"shot_{number:04d}{end}.png" for end in ends]
        for k, path in enumerate(found[number]):
            save_display_values(scene, picture(number + k), path)
    return found


def make(scene, frames, path, layout, *, file_format="PNG", panorama=None):
    before = everything()
    folder = path.parent / "out"
    made = write_movie(scene, frames, path, layout, folder, file_format=file_format, panorama=panorama)
    assert everything() == before
    assert sorted(path for path in folder.rglob("*") if path.is_file()) == sorted(made)
    return made


def decoded(path, *, width=WIDTH, height=HEIGHT):
    """The movie's pictures by FFmpeg, (N, H, W, 3)."""
    command = [imageio_ffmpeg.get_ffmpeg_exe(), "-v", "error", "-i", str(path), "-f", "rawvideo", "-pix_fmt", "rgb24"]
    done = subprocess.run([*command, "-"], capture_output=True, check=True, timeout=60)
    return np.frombuffer(done.stdout, np.uint8).reshape(-1, height, width, 3) / 255.0


def assert_shows(path, numbers, *, scale=1):
    shown = decoded(path, width=scale * WIDTH)
    assert len(shown) == len(numbers)
    for found, number in zip(shown, numbers, strict=True):
        assert np.abs(found - picture(number, width=scale * WIDTH)).mean() < CODEC


@pytest.mark.parametrize("name", ["film.mp4", "film.mkv", "film.mov", "film.avi", "FILM.MP4"])
def test_its_pictures_are_the_frames(scene, tmp_path, name):
    frames = save_frames(scene, tmp_path, range(1, 4))
    (movie,) = make(scene, frames, tmp_path / name, "side-by-side-half")
    assert movie.name == name
    assert_shows(movie, [1, 2, 3])
    assert "24 fps" in described(movie)


@pytest.mark.parametrize("name", ["film.webm", "film.ogv"])
def test_a_container_that_takes_few_codecs_gets_one_of_them(scene, tmp_path, name):
    scene.render.ffmpeg.codec = "H264"
    frames = save_frames(scene, tmp_path, range(1, 4))
    (movie,) = make(scene, frames, tmp_path / name, "top-bottom")
    assert_shows(movie, [1, 2, 3])
    assert scene.render.ffmpeg.codec == "H264"


@pytest.mark.parametrize(
    ("name", "codec", "stream"),
    [
        ("film.mp4", "H265", "hevc"),
        ("film.mkv", "FFV1", "ffv1"),
        ("film.mov", "H264", "h264"),
    ],
)
def test_a_codec_that_fits_stays_the_scenes_own(scene, tmp_path, name, codec, stream):
    scene.render.ffmpeg.codec = codec
    frames = save_frames(scene, tmp_path, range(1, 3))
    (movie,) = make(scene, frames, tmp_path / name, "side-by-side")
    assert f"Video: {stream}" in described(movie)


def test_av1_stays_in_webm(scene, tmp_path):
    """It takes no picture as small as the others."""
    scene.render.ffmpeg.codec = "AV1"
    frames = {1: [tmp_path / "large.png"]}
    save_display_values(scene, picture(1, width=256, height=128), frames[1][0])
    (movie,) = make(scene, frames, tmp_path / "film.webm", "side-by-side")
    assert "Video: av1" in described(movie)


def test_movies_that_were_never_set_up_have_blenders_usual_codec(tmp_path):
    scene = empty_scene(WIDTH, HEIGHT)
    add_camera(scene)
    frames = save_frames(scene, tmp_path, range(1, 3))
    (movie,) = make(scene, frames, tmp_path / "film.mp4", "side-by-side")
    assert_shows(movie, [1, 2])


def test_a_codec_that_the_container_does_not_take_is_one_line(scene, tmp_path):
    scene.render.ffmpeg.codec = "THEORA"
    frames = save_frames(scene, tmp_path, range(1, 3))
    with pytest.raises(StereoReprojectError) as failed:
        make(scene, frames, tmp_path / "film.mp4", "side-by-side")
    assert "\n" not in str(failed.value)


@pytest.mark.parametrize(
    ("name", "layout", "mark"),
    [
        ("film.mp4", "side-by-side", "side by side"),
        ("film.mp4", "top-bottom-half", "top and bottom"),
        ("film.mp4", "anaglyph-red-cyan", ""),
        ("film.mkv", "cross-eyed", "side by side (inverted)"),
        ("film.mkv", "interlace-checkerboard", "checkerboard (inverted)"),
        ("film.webm", "top-bottom", "top and bottom"),
        ("film.avi", "side-by-side", ""),
        ("film.mkv", None, ""),
    ],
)
def test_players_are_told_the_layout(scene, tmp_path, name, layout, mark):
    frames = save_frames(scene, tmp_path, [1, 2])
    (movie,) = make(scene, frames, tmp_path / name, layout)
    assert stereo(movie) == mark
    assert len(decoded(movie)) == 2


@pytest.mark.parametrize(
    ("name", "codec", "panorama", "shown"),
    [
        ("film.mp4", "H264", FRONT, "tiled equirectangular [32, 0, 31, 0]"),
        ("film.mp4", "H264", WHOLE, "equirectangular"),
        ("film.mp4", "H265", FRONT, "half equirectangular"),
        ("film.mov", "H265", FRONT, "half equirectangular"),
        ("film.mkv", "H264", FRONT, "tiled equirectangular [32, 0, 31, 0]"),
        ("film.webm", "WEBM", WHOLE, "equirectangular"),
        ("film.avi", "H264", WHOLE, ""),
        ("film.mov", "H264", None, ""),
    ],
)
def test_players_are_told_the_part_of_the_sphere(scene, tmp_path, name, codec, panorama, shown):
    scene.render.ffmpeg.codec = codec
    frames = save_frames(scene, tmp_path, [1, 2])
    (movie,) = make(scene, frames, tmp_path / name, "side-by-side", panorama=panorama)
    assert sphere(movie) == shown
    assert stereo(movie) == ("" if name == "film.avi" else "side by side")
    assert_shows(movie, [1, 2])


def set_panoramic(camera, *, degrees=180.0, kind="EQUIRECTANGULAR"):
    camera.data.type = "PANO"
    camera.data.panorama_type = kind
    camera.data.longitude_min, camera.data.longitude_max = np.radians([-degrees / 2, degrees / 2])
    camera.data.latitude_min, camera.data.latitude_max = np.radians([-90, 90])


@pytest.mark.parametrize("spherical", [False, True])
@pytest.mark.parametrize(("degrees", "panorama"), [(180, FRONT), (360, WHOLE), (90, MoviePanorama(0.375, 0.375))])
def test_the_part_of_the_sphere_is_the_cameras(scene, degrees, panorama, spherical):
    set_panoramic(scene.camera, degrees=degrees)
    scene.camera.data.stereo.use_spherical_stereo = spherical
    assert movie_panorama(scene, range(1, 4)) == panorama


def test_planar_pictures_and_other_projections_show_no_part_of_the_sphere(scene):
    assert movie_panorama(scene, [1]) is None
    scene.camera.data.stereo.use_spherical_stereo = True
    assert movie_panorama(scene, [1]) is None
    set_panoramic(scene.camera, kind="FISHEYE_EQUIDISTANT")
    assert movie_panorama(scene, [1]) is None
    scene.camera = None
    assert movie_panorama(scene, [1]) is None


def test_a_panorama_of_any_projection_is_one(scene):
    assert not shows_panorama(scene, [1])
    assert shows_panorama(scene, [1], "vr180")
    scene.camera.data.stereo.use_spherical_stereo = True
    assert not shows_panorama(scene, [1]), "players show it flat, as it is"
    other = scene.camera.copy()
    other.data = scene.camera.data.copy()
    set_panoramic(other, kind="FISHEYE_EQUIDISTANT")
    for frame, camera in ((1, scene.camera), (10, other)):
        scene.timeline_markers.new("", frame=frame).camera = camera
    assert not shows_panorama(scene, range(1, 10))
    assert shows_panorama(scene, range(1, 20))
    scene.timeline_markers.clear()
    scene.camera = None
    assert not shows_panorama(scene, [1])


def test_what_the_frame_leaves_out_is_cut_away(scene):
    set_panoramic(scene.camera, degrees=360)
    render = scene.render
    render.use_border = True
    render.border_min_x, render.border_max_x, render.border_min_y, render.border_max_y = 0.25, 1.0, 0.5, 1.0
    assert movie_panorama(scene, [1]) == MoviePanorama(left=0.25, bottom=0.5)
    render.use_border = False
    scene.camera.data.shift_x = 0.25
    assert movie_panorama(scene, [1]) == WHOLE
    set_panoramic(scene.camera, degrees=180)
    assert movie_panorama(scene, [1]) == MoviePanorama(left=0.375, right=0.125)
    scene.camera.data.shift_y = 0.25
    assert movie_panorama(scene, [1]) is None


def test_a_movie_of_several_cameras_shows_the_part_that_they_share(scene):
    set_panoramic(scene.camera, degrees=180)
    other = scene.camera.copy()
    other.data = scene.camera.data.copy()
    scene.collection.objects.link(other)
    for frame, camera in ((1, scene.camera), (10, other)):
        scene.timeline_markers.new("", frame=frame).camera = camera
    assert movie_panorama(scene, range(1, 20)) == FRONT
    set_panoramic(other, degrees=360)
    assert movie_panorama(scene, range(1, 20)) is None
    assert movie_panorama(scene, range(1, 10)) == FRONT
    assert movie_panorama(scene, range(10, 20)) == WHOLE


@pytest.mark.parametrize(
    ("degrees", "layout", "name"),
    [
        (180, "side-by-side", "shot_180_LR.mp4"),
        (360, "top-bottom", "shot_360_TB.mp4"),
        (None, "top-bottom", "shot_TB.mp4"),
    ],
)
def test_the_movie_of_an_animation_has_name_and_mark_by_its_camera(scene, tmp_path, degrees, layout, name):
    if degrees is not None:
        set_panoramic(scene.camera, degrees=degrees)
    scene.render.filepath = str(tmp_path / "shot_")
    asked = AnimationSettings(frames=(1, 2), output=str(tmp_path), file_format="PNG", layout=layout, movie="")
    options, output = output_of(scene, asked)
    for number, (path,) in output.files.items():
        save_display_values(scene, picture(number), path)
    journal = Journal(output.folder, output.name)
    journal.place.make()
    warnings = []
    (movie,) = make_movie(scene, options, output, journal, Listener(warn=warnings.append))
    assert movie == tmp_path / name
    assert sphere(movie) == {180: "tiled equirectangular [32, 0, 31, 0]", 360: "equirectangular", None: ""}[degrees]
    assert stereo(movie) == {"side-by-side": "side by side", "top-bottom": "top and bottom"}[layout]
    assert warnings == []


def test_each_eye_in_a_movie_of_its_own(scene, tmp_path):
    frames = save_frames(scene, tmp_path, [1, 2, 3], ends=("_L", "_R"))
    left, right = make(scene, frames, tmp_path / "film.mp4", "individual")
    assert (left.name, right.name) == ("film_L.mp4", "film_R.mp4")
    assert_shows(left, [1, 2, 3])
    assert_shows(right, [2, 3, 4])
    assert (stereo(left), stereo(right)) == ("", "")


def test_eyes_that_lie_in_two_files_are_put_side_by_side(scene, tmp_path):
    frames = save_frames(scene, tmp_path, [1, 2], ends=("_L", "_R"))
    (movie,) = make(scene, frames, tmp_path / "film.mp4", "side-by-side")
    assert stereo(movie) == "side by side"
    for found, number in zip(decoded(movie, width=2 * WIDTH), (1, 2), strict=True):
        assert np.abs(found - np.hstack([picture(number), picture(number + 1)])).mean() < CODEC


@pytest.mark.parametrize("numbers", [[1, 3, 5], [10, 11, 20], [0, 2, 4], [7]])
def test_frames_with_gaps_come_one_after_the_other(scene, tmp_path, numbers):
    frames = save_frames(scene, tmp_path, numbers)
    (movie,) = make(scene, frames, tmp_path / "film.mp4", "side-by-side")
    assert_shows(movie, numbers)


def eyes_of(scene, number):
    """Scene-linear eyes: the left in that number's colour, the right in the next one's."""
    layer = scene.view_layers[0].name
    flat = [np.array([*COLOURS[(number + k) % len(COLOURS)], 1.0], np.float32) for k in (0, 1)]
    pictures = [np.broadcast_to(0.25 * colour, (HEIGHT, WIDTH, 4)) for colour in flat]
    return {view: {layer: {COLOUR_PASS: eye}} for view, eye in zip(("left", "right"), pictures, strict=True)}


def exr_frames(scene, folder, numbers, layout, file_format):
    """EXRs as an animation leaves them."""
    scene.render.use_compositing = False
    scene.render.use_stamp = False
    found = {}
    for number in numbers:
        with as_ordered(scene, str(folder), layout, file_format):
            made = folder / f"made-{number}"
            deliver_frames(scene, lambda _, n=number: eyes_of(scene, n), made, frames=range(number, number + 1))
        found[number] = sorted(made.iterdir())
    return found


def as_seen(scene, number):
    """What the scene's view transform (Standard, with its exposure) makes of that number's colour."""
    light = np.clip(0.25 * 2.0**scene.view_settings.exposure * np.array(COLOURS[number % len(COLOURS)]), 0, 1)
    return np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)


@pytest.mark.parametrize(
    ("layout", "file_format"),
    [("multi-view", "OPEN_EXR"), ("multi-view", "OPEN_EXR_MULTILAYER"), ("side-by-side", "OPEN_EXR")],
)
def test_linear_pictures_go_through_the_view_transform(scene, tmp_path, layout, file_format):
    """Where each file holds both views apart, a movie has them side by side."""
    scene.render.image_settings.stereo_3d_format.display_mode = "SIDEBYSIDE"
    frames = exr_frames(scene, tmp_path, [1, 3], layout, file_format)
    (movie,) = make(scene, frames, tmp_path / "film.mkv", "side-by-side", file_format=file_format)
    assert stereo(movie) == "side by side"
    shown = decoded(movie, width=2 * WIDTH)
    assert len(shown) == 2
    for found, number in zip(shown, (1, 3), strict=True):
        for k, side in enumerate(np.split(found, 2, axis=1)):
            assert np.abs(side - as_seen(scene, number + k)).mean() < CODEC


def test_what_goes_without_a_view_transform_would_show(scene):
    """Else the test above would hold whatever is done."""
    assert np.abs(as_seen(scene, 1) - COLOURS[1]).mean() > 2 * CODEC


def test_a_damaged_frame_is_one_line(scene, tmp_path):
    frames = save_frames(scene, tmp_path, [1, 2])
    frames[2][0].write_bytes(b"no picture")
    with pytest.raises(StereoReprojectError) as failed:
        write_movie(scene, frames, tmp_path / "a.mp4", "side-by-side", tmp_path / "out", file_format="PNG")
    assert "\n" not in str(failed.value)
    assert [other.name for other in bpy.data.scenes] == [scene.name]


@pytest.mark.parametrize("name", ["film", "film.gif", "film.png"])
def test_a_name_that_no_movie_has_is_refused(name):
    with pytest.raises(BadInputError, match=r"must end in one of \.mp4, .*\.webm"):
        check_movie(Path(name))


def test_a_folder_that_is_in_the_way_is_said(tmp_path):
    (tmp_path / "film.mp4").mkdir()
    with pytest.raises(BadInputError, match="is a folder where a movie is to be written"):
        check_movie(tmp_path / "film.mp4")


@pytest.mark.parametrize(
    ("name", "layout", "warning"),
    [
        ("film_TB.mp4", "side-by-side", "players take TB in film_TB.mp4 for another layout than side-by-side"),
        ("film_LR.mp4", "side-by-side", None),
        ("film.mp4", "side-by-side", None),
        ("film_LR.mp4", None, None),
        ("film.mp4", "anaglyph-dubois", None),
        ("film.avi", "side-by-side", "players know side-by-side by its name alone: film_LR.avi tells it"),
        ("film sbs.avi", "side-by-side", None),
        ("film.mkv", "top-bottom-half", "players know top-bottom-half by its name alone: film_HTB.mkv tells it"),
        ("film_hou.mkv", "top-bottom-half", None),
    ],
)
def test_a_name_that_tells_players_something_else_or_too_little_is_warned_of(name, layout, warning):
    assert movie_warnings(Path(name), layout) == ([warning] if warning else [])


@pytest.mark.parametrize(
    ("name", "layout", "panorama", "warning"),
    [
        ("film_180_LR.mp4", "side-by-side", FRONT, None),
        ("film.mp4", "side-by-side", FRONT, None),
        ("film_180_LR.mp4", None, FRONT, None),
        (
            "film_360_LR.mp4",
            "side-by-side",
            FRONT,
            "players take 360 in film_360_LR.mp4 for another projection than a panorama of 180°",
        ),
        (
            "film_180.mp4",
            "side-by-side",
            None,
            "players take 180 in film_180.mp4 for another projection than a planar one",
        ),
        (
            "film_LR.avi",
            "side-by-side",
            WHOLE,
            "players know a panorama of 360° by its name alone: film_LR_360.avi tells it",
        ),
        ("film.avi", "top-bottom", FRONT, "players know top-bottom by its name alone: film_180_TB.avi tells it"),
        ("film_360_TB.avi", "top-bottom", WHOLE, None),
        ("film_HSBS.mp4", "side-by-side-half", FRONT, None),
    ],
)
def test_a_name_that_tells_another_projection_is_warned_of(name, layout, panorama, warning):
    assert movie_warnings(Path(name), layout, panorama) == ([warning] if warning else [])


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("film.mp4", "movies have no mark for such a panorama: players show film.mp4 as a flat picture"),
        ("film_180_LR.mp4", "players take 180 in film_180_LR.mp4 for an equirectangular panorama, which it is not"),
    ],
)
def test_a_panorama_without_a_mark_is_one_warning(name, said):
    (warning,) = movie_warnings(Path(name), "side-by-side", lacks_mark=True)
    assert warning == f"{said}; they know equirectangular ones"


def test_other_warnings_of_its_name_stay():
    assert len(movie_warnings(Path("film_TB.mp4"), "side-by-side", lacks_mark=True)) == 2
    assert len(movie_warnings(Path("film.avi"), "side-by-side", lacks_mark=True)) == 2


def test_a_name_may_tell_two_wrong_things():
    assert len(movie_warnings(Path("film_360_TB.mp4"), "side-by-side", FRONT)) == 2
