"""The output of frames that are many views, and the movie that is made of their quilts."""

import subprocess

import bpy
import imageio_ffmpeg
import numpy as np
import pytest

from stereo_reproject.blender.commands.animation_movie import make_movie
from stereo_reproject.blender.commands.frame_kinds import Quilts
from stereo_reproject.blender.output.quilt_files import display_pixels
from stereo_reproject.blender.output.quilt_output import quilt_output_of
from stereo_reproject.errors import BadInputError, StereoReprojectError
from stereo_reproject.images.png import write_png
from stereo_reproject.sequence.journal import Journal
from stereo_reproject.sequence.progress import Listener
from stereo_reproject.settings.animation import AnimationSettings
from stereo_reproject.settings.frame import StereoSettings
from stereo_reproject.settings.views import ViewsSettings, views_settings
from tests.blender.toolbox import add_camera, empty_scene
from tests.delivery.movies import described

COLUMNS, ROWS = 3, 2
WIDTH, HEIGHT = 33, 20
VIEWS = ViewsSettings(6, 10.0, columns=COLUMNS, rows=ROWS)

CODEC = 0.06
"""A lossy codec's error in flat colours, in the mean over a picture."""


@pytest.fixture
def scene():
    scene = empty_scene(WIDTH, HEIGHT)
    add_camera(scene)
    scene.render.fps = 12
    scene.view_settings.view_transform = "Standard"
    return scene


def output_in(scene, folder, *, views=VIEWS, size=None, **options):
    asked = AnimationSettings(**{"frames": (1, 2), "output": str(folder), **options})
    with display_pixels(scene, views.aspect, size):
        return quilt_output_of(scene, asked, views, size, {name: name for name in views.names})


def quilt(number):
    """The quilt of a frame in bytes: each view has a grey of its own, which is another in each frame."""
    greys = np.arange(COLUMNS * ROWS).reshape(ROWS, COLUMNS) * 30 + 20 * number
    picture = np.repeat(np.repeat(greys, HEIGHT, axis=0), WIDTH, axis=1)
    return np.repeat(picture[..., None], 3, axis=2).astype(np.uint8)


def movie_of(scene, folder, **options):
    options, output = output_in(scene, folder, **{"movie": "", **options})
    for number, (path,) in output.files.items():
        write_png(path, quilt(number))
    journal = Journal(output.folder, output.name)
    journal.place.make()
    warnings = []
    (movie,) = make_movie(scene, options, output, journal, Listener(warn=warnings.append))
    return movie, warnings


def decoded(path, width, height):
    """The movie's pictures by FFmpeg, (N, H, W, 3)."""
    command = [imageio_ffmpeg.get_ffmpeg_exe(), "-v", "error", "-i", str(path), "-f", "rawvideo", "-pix_fmt", "rgb24"]
    done = subprocess.run([*command, "-"], capture_output=True, check=True, timeout=60)
    return np.frombuffer(done.stdout, np.uint8).reshape(-1, height, width, 3) / 255.0


def test_a_movie_shows_the_quilts_and_its_name_tells_their_grid(scene, tmp_path):
    movie, warnings = movie_of(scene, tmp_path)
    assert movie == tmp_path / f"{scene.name}_qs3x2a1.65.mp4"
    assert warnings == []
    assert "12 fps" in described(movie)
    # Three views of 33 pixels are an odd number, which no encoder takes.
    shown = decoded(movie, COLUMNS * (WIDTH - 1), ROWS * HEIGHT)
    assert len(shown) == 2
    for found, number in zip(shown, (1, 2), strict=True):
        tiles = quilt(number).reshape(ROWS, HEIGHT, COLUMNS, WIDTH, 3)[..., : WIDTH - 1, :]
        assert np.abs(found - tiles.reshape(found.shape) / 255.0).mean() < CODEC


def test_a_movie_of_a_given_name_keeps_it_and_a_warning_says_what_players_do_not_know(scene, tmp_path):
    movie, (warning,) = movie_of(scene, tmp_path, movie=str(tmp_path / "film.mkv"))
    assert movie.name == "film.mkv"
    assert "film_qs3x2a1.65.mkv tells it" in warning
    movie, warnings = movie_of(scene, tmp_path, movie=str(tmp_path / "film_qs3x2a1.65.mp4"), existing="overwrite")
    assert (movie.name, warnings) == ("film_qs3x2a1.65.mp4", [])


def test_pixels_that_are_not_square_are_said_by_the_name_alone(scene, tmp_path):
    """A player that stretched the quilt would cut it wrongly."""
    views = ViewsSettings(6, 10.0, columns=COLUMNS, rows=ROWS, aspect=3.3)
    movie, _ = movie_of(scene, tmp_path, views=views)
    assert movie.name == f"{scene.name}_qs3x2a3.3.mp4"
    assert "SAR 1:1" in described(movie) or "SAR" not in described(movie)


def test_a_picture_of_another_size_is_no_quilt_of_these(scene, tmp_path):
    _, output = output_in(scene, tmp_path)
    write_png(output.files[1][0], quilt(1)[:, 1:])
    with pytest.raises(StereoReprojectError, match="another size"):
        output.write_movie(scene, tmp_path / "film.mp4", tmp_path / "out")


@pytest.mark.parametrize(
    ("views", "size", "name"),
    [
        (VIEWS, None, "quilt_0001_qs3x2a1.65.png"),
        (VIEWS, (40, 20), "quilt_0001_qs3x2a2.png"),
        (views_settings(display="16-landscape"), (857, 857), "quilt_0001_qs7x7a1.7778.png"),
    ],
)
def test_quilts_are_named_before_they_are_rendered(scene, tmp_path, views, size, name):
    options, output = output_in(scene, tmp_path, views=views, size=size)
    assert options.frames == (1, 2)
    assert output.files[1] == [tmp_path / name]
    assert len(output.all_files) == 2


def test_without_frames_it_is_those_of_the_scene(scene, tmp_path):
    scene.frame_start, scene.frame_end, scene.frame_step = 3, 7, 2
    options, output = Quilts(StereoSettings(), VIEWS).output(scene, AnimationSettings(output=str(tmp_path)))
    assert options.frames == tuple(output.files) == (3, 5, 7)


def test_what_decides_a_frame_is_in_its_values_and_the_displays_name_is_not(scene, tmp_path):
    named = views_settings(display="portrait")
    plain = views_settings(count=48, cone_degrees=named.cone_degrees, quilt=(8, 6), aspect=0.75)
    values = [output_in(scene, tmp_path, views=views, size=(42, 56))[1].values for views in (named, plain)]
    assert values[0] == values[1]
    other = views_settings(count=48, cone_degrees=named.cone_degrees + 1.0, quilt=(8, 6), aspect=0.75)
    assert output_in(scene, tmp_path, views=other, size=(42, 56))[1].values != values[0]


def test_what_cannot_be_written_is_said_before_the_first_frame(scene, tmp_path):
    with pytest.raises(BadInputError, match="name the quilt's columns and rows"):
        output_in(scene, tmp_path, views=ViewsSettings(6, 10.0))
    with pytest.raises(BadInputError, match="a movie of many views shows their quilts"):
        output_in(scene, tmp_path, views=ViewsSettings(6, 10.0, layout="multi-view"), movie="")
    with pytest.raises(BadInputError, match="must end in one of"):
        output_in(scene, tmp_path, movie="film.txt")
    (tmp_path / "quilt_0002_qs3x2a1.65.png").mkdir()
    with pytest.raises(BadInputError, match="is a folder where a file is to be written"):
        output_in(scene, tmp_path)
    assert bpy.context.scene.render.pixel_aspect_x == 1.0
