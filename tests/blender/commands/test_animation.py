"""The frames of a scene in the files that its own output settings ask for."""

import os
import re
import tempfile
from pathlib import Path

import bpy
import numpy as np
import pytest

from stereo_reproject.blender.api import render_animation
from stereo_reproject.blender.output.animation_output import output_of
from stereo_reproject.blender.output.delivery import deliver_frames
from stereo_reproject.blender.output.pictures import read_png
from stereo_reproject.errors import BadInputError
from stereo_reproject.images.passes import COLOUR_PASS
from stereo_reproject.sequence.journal_folder import JOURNAL
from stereo_reproject.settings.animation import AnimationSettings
from stereo_reproject.settings.frame import SceneOverrides, StereoSettings
from tests.blender.snapshot import everything
from tests.blender.toolbox import add_camera, add_compositor, add_plane, add_sun, diffuse, empty_scene

SIZE = (64, 36)


@pytest.fixture
def scene(tmp_path):
    """A matte card before a wall, that moves to the right by its width in each frame."""
    scene = empty_scene(*SIZE, samples=2)
    add_plane(scene, diffuse("wall", colour=(0.2, 0.3, 0.8)), size=(30, 20), location=(0, 0, -8))
    card = add_plane(scene, diffuse("card", colour=(0.9, 0.2, 0.1)), size=(1, 2), location=(-1.0, 0, -4))
    card.keyframe_insert("location", frame=1)
    card.location.x = 1.0
    card.keyframe_insert("location", frame=3)
    add_sun(scene, strength=1.5)
    add_camera(scene)
    scene.frame_start, scene.frame_end, scene.frame_step = 1, 3, 2
    scene.frame_set(2)
    scene.render.filepath = str(tmp_path / "out" / "shot_")
    set_format(scene, "PNG")
    return scene


def set_format(scene, file_format, *, media="IMAGE", views="INDIVIDUAL"):
    settings = scene.render.image_settings
    if hasattr(settings, "media_type"):
        settings.media_type = media
    settings.file_format, settings.views_format = file_format, views


def render(scene):
    return render_animation(StereoSettings(fill="packed"), scene=scene)


def files(tmp_path):
    """What is there but for what tells of the frames."""
    names = sorted(path.name for path in (tmp_path / "out").iterdir())
    return [name for name in names if name != JOURNAL and not name.startswith("shot_animation.")]


def test_each_view_in_files_of_its_own(scene, tmp_path):
    before = everything()
    report = render(scene)
    assert everything() == before
    assert files(tmp_path) == ["shot_0001_L.png", "shot_0001_R.png", "shot_0003_L.png", "shot_0003_R.png"]
    assert [row["frame"] for row in report["frames"]] == [1, 3]
    assert sorted(report["files"]) == [str(tmp_path / "out" / name) for name in files(tmp_path)]
    first, last = (read_png(tmp_path / "out" / f"shot_000{frame}_L.png") for frame in (1, 3))
    redness = [picture[..., 0] - picture[..., 2] for picture in (first, last)]
    assert redness[0].argmax() % SIZE[0] < 0.5 * SIZE[0] < redness[1].argmax() % SIZE[0]


def test_side_by_side(scene, tmp_path):
    set_format(scene, "PNG", views="STEREO_3D")
    scene.render.image_settings.stereo_3d_format.display_mode = "SIDEBYSIDE"
    render(scene)
    assert files(tmp_path) == ["shot_0001.png", "shot_0003.png"]
    assert read_png(tmp_path / "out" / "shot_0001.png").shape[:2] == (SIZE[1], 2 * SIZE[0])


@pytest.mark.parametrize("compositor", [True, False])
def test_a_movie(scene, tmp_path, compositor):
    media = {"media": "VIDEO"} if bpy.app.version >= (5, 0) else {}
    set_format(scene, "FFMPEG", views="STEREO_3D", **media)
    scene.render.image_settings.stereo_3d_format.display_mode = "SIDEBYSIDE"
    scene.render.ffmpeg.format = "MKV"
    scene.render.use_compositing = compositor
    before = everything()
    render(scene)
    assert everything() == before
    (name,) = [name for name in files(tmp_path) if "_animation." not in name]
    assert name.endswith(".mkv")
    clip = bpy.data.movieclips.load(str(tmp_path / "out" / name))
    assert (tuple(clip.size), clip.frame_duration) == ((2 * SIZE[0], SIZE[1]), 2)
    bpy.data.movieclips.remove(clip)


@pytest.mark.parametrize(("views", "suffixes"), [("INDIVIDUAL", ("_L", "_R")), ("STEREO_3D", ("",))])
def test_a_movie_whose_path_has_its_extension(scene, tmp_path, views, suffixes):
    media = {"media": "VIDEO"} if bpy.app.version >= (5, 0) else {}
    set_format(scene, "FFMPEG", views=views, **media)
    scene.render.ffmpeg.format = "MPEG4"
    scene.render.filepath = str(tmp_path / "out" / "mine.mp4")
    report = render(scene)
    movies = [str(tmp_path / "out" / f"mine{suffix}.mp4") for suffix in suffixes]
    assert report["files"] == report["movies"] == movies
    assert sorted(path.name for path in (tmp_path / "out").iterdir() if path.suffix == ".mp4") == sorted(
        f"mine{suffix}.mp4" for suffix in suffixes
    )


@pytest.mark.parametrize("existing", ["resume", "overwrite", "keep", "refuse"])
def test_a_movie_of_the_scenes_own_format_is_made_again_as_far_as_may_be(scene, tmp_path, existing):
    media = {"media": "VIDEO"} if bpy.app.version >= (5, 0) else {}
    set_format(scene, "FFMPEG", views="STEREO_3D", **media)
    scene.render.ffmpeg.format = "MKV"
    (movie,) = render_animation(scene=scene)["movies"]
    before = everything()
    if existing in ("keep", "refuse"):
        with pytest.raises(BadInputError, match="is there already and is no movie of these frames"):
            render_animation(scene=scene, existing=existing)
    else:
        assert render_animation(scene=scene, existing=existing)["movies"] == [movie]
    assert everything() == before
    assert not (tmp_path / "out" / "shot_0001-0003.frames").exists()


@pytest.mark.parametrize("existing", ["refuse", "resume", "overwrite"])
def test_a_file_in_the_way_of_a_movie_stays_unless_it_is_one_of_these_frames(scene, tmp_path, existing):
    movie = tmp_path / "film.mp4"
    movie.write_bytes(b"precious")
    options = {"scene": scene, "movie": movie, "existing": existing}
    if existing == "overwrite":
        render_animation(**options)
    else:
        with pytest.raises(BadInputError, match="no movie of these frames"):
            render_animation(**options)
        assert movie.read_bytes() == b"precious"
        assert not (tmp_path / "out").exists()
        movie.unlink()
        render_animation(**options)
    whole = movie.read_bytes()
    assert whole != b"precious"
    report = render_animation(scene=scene, movie=movie, existing="resume")
    assert (report["rendered"], report["movies"]) == (0, [str(movie)])


def test_a_movie_is_not_replaced_by_one_of_fewer_frames(scene, tmp_path):
    movie = tmp_path / "out" / "film.mkv"
    scene.render.ffmpeg.format = "MKV"
    options = {"scene": scene, "movie": movie}
    render_animation(**options)
    whole = movie.read_bytes()
    for frames in ([1], [1, 2]):
        with pytest.raises(BadInputError, match=r"film.mkv is a movie of more frames, and the new one would lack 3: "):
            render_animation(**options, frames=frames, existing="resume")
        assert movie.read_bytes() == whole
        assert not (tmp_path / "out" / "shot_0002_L.png").exists(), "it is said before the first render"
    assert render_animation(**options, frames=[1, 3], existing="resume")["movies"] == [str(movie)]
    assert render_animation(**options, frames=[1, 2, 3], existing="resume")["rendered"] == 1
    assert render_animation(**options, frames=[1], existing="overwrite")["movies"] == [str(movie)]
    assert len(list((tmp_path / "out" / JOURNAL).glob("movie-*.json"))) == 1


def test_a_codec_is_the_scenes_though_its_own_format_is_of_pictures(scene, tmp_path):
    scene.render.ffmpeg.format = "MKV"
    scene.render.ffmpeg.codec = "FFV1"
    render_animation(scene=scene, movie=tmp_path / "film.mkv")
    assert b"FFV1" in (tmp_path / "film.mkv").read_bytes()


def test_pictures_of_holes_are_of_the_frames_size(scene, tmp_path):
    render_animation(scene=scene, holes=True)
    for path in (tmp_path / "out" / "holes").iterdir():
        assert read_png(path).shape == (SIZE[1], SIZE[0], 3)


def test_what_is_said_instead_of_the_scene_or_is_not_seen_counts_for_nothing(scene, tmp_path):
    settings = StereoSettings(scene=SceneOverrides(size=SIZE, samples=2, seed=3), fill="packed")
    first = render_animation(settings, scene=scene, frames=[1])
    scene.render.resolution_x, scene.cycles.samples, scene.cycles.seed = 999, 77, 5
    scene.timeline_markers.new("note", frame=1)
    assert render_animation(settings, scene=scene, frames=[1], existing="resume")["rendered"] == 0
    assert (scene.render.resolution_x, scene.cycles.samples, scene.cycles.seed) == (999, 77, 5)
    with pytest.raises(BadInputError, match="the scene has changed"):
        render_animation(StereoSettings(fill="packed"), scene=scene, frames=[1], existing="resume")
    scene.timeline_markers["note"].camera = scene.camera
    with pytest.raises(BadInputError, match="the scene has changed"):
        render_animation(settings, scene=scene, frames=[1], existing="resume")
    assert first["rendered"] == 1


def test_nothing_is_left_of_an_animation_that_cannot_be_rendered(scene, tmp_path):
    scene.camera.data.type, scene.camera.data.panorama_type = "PANO", "MIRRORBALL"
    with pytest.raises(BadInputError):
        render(scene)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("given", [{"movie": True}, {"output": 7}])
def test_a_path_is_a_path(scene, given):
    with pytest.raises(BadInputError, match="must be a path"):
        render_animation(scene=scene, **given)


def test_a_movie_for_each_eye_and_nothing_of_others_goes_with_its_frames(scene, tmp_path):
    media = {"media": "VIDEO"} if bpy.app.version >= (5, 0) else {}
    set_format(scene, "FFMPEG", views="INDIVIDUAL", **media)
    scene.render.ffmpeg.format = "MKV"
    waiting = tmp_path / "out" / "shot_0001-0003.frames"
    waiting.mkdir(parents=True)
    (waiting / "mine.txt").write_text("mine")
    report = render(scene)
    movies = [name for name in files(tmp_path) if name.endswith(".mkv")]
    assert movies == ["shot_0001-0003_L.mkv", "shot_0001-0003_R.mkv"]
    assert report["files"] == [str(tmp_path / "out" / name) for name in movies]
    assert [path.name for path in waiting.iterdir()] == ["mine.txt"]


def test_what_is_there_stays_when_overwrite_is_off(scene, tmp_path):
    (tmp_path / "out").mkdir()
    for view in "LR":
        (tmp_path / "out" / f"shot_0001_{view}.png").write_text("mine")
    scene.render.use_overwrite = False
    report = render(scene)
    assert ([row["frame"] for row in report["frames"]], report["there_already"]) == ([3], [1])
    assert (tmp_path / "out" / "shot_0001_L.png").read_text() == "mine"
    assert files(tmp_path) == ["shot_0001_L.png", "shot_0001_R.png", "shot_0003_L.png", "shot_0003_R.png"]
    with pytest.raises(BadInputError, match="all others are there already"):
        render(scene)


def test_a_folder_that_cannot_be_made_is_said_before_anything_is_rendered(scene, tmp_path):
    (tmp_path / "file").write_text("")
    scene.render.filepath = str(tmp_path / "file" / "shot_")
    with pytest.raises(BadInputError, match="choose another folder"):
        render(scene)


def test_names_that_are_too_long_for_what_stands_beside_a_frame_are_said_before_anything_is_rendered(scene, tmp_path):
    scene.render.filepath = str(tmp_path / "out" / ("n" * 240))
    with pytest.raises(BadInputError, match="shorten the name at the end of the output path"):
        render(scene)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="POSIX has them")
def test_what_is_in_the_way_of_frames_is_named(scene, tmp_path):
    out = tmp_path / "out"
    out.mkdir()
    os.mkfifo(out / "shot_0001_L.png")
    with pytest.raises(BadInputError, match=r"shot_0001_L.png is no regular file.* move it"):
        render(scene)
    (out / "shot_0001_L.png").unlink()
    (out / JOURNAL).write_text("")
    with pytest.raises(BadInputError, match=rf"{re.escape(JOURNAL)} is no folder.* move it"):
        render(scene)
    assert [path.name for path in out.iterdir()] == [JOURNAL]


# Before 5.2, output cannot be switched off.
if "save_output" in bpy.types.RenderSettings.bl_rna.properties:

    def test_switched_off_output_is_said(scene, tmp_path):
        scene.render.save_output = False
        with pytest.raises(BadInputError, match="Output is switched off"):
            render(scene)


def test_a_file_without_an_extension(scene, tmp_path):
    scene.render.use_file_extension = False
    render(scene)
    assert files(tmp_path) == ["shot_0001_L", "shot_0001_R", "shot_0003_L", "shot_0003_R"]


def test_both_views_in_one_exr(scene, tmp_path):
    media = {"media": "MULTI_LAYER_IMAGE"} if bpy.app.version >= (5, 0) else {}
    set_format(scene, "OPEN_EXR_MULTILAYER", views="MULTIVIEW", **media)
    render(scene)
    assert files(tmp_path) == ["shot_0001.exr", "shot_0003.exr"]


@pytest.mark.parametrize(("file_format", "half"), [(None, True), ("OPEN_EXR", True), ("PNG", False)])
def test_the_format_that_is_asked_for_tells_whether_floats_are_halved(scene, file_format, half):
    set_format(scene, "OPEN_EXR")
    scene.render.image_settings.color_depth = "16"
    assert output_of(scene, AnimationSettings(file_format=file_format))[1].half_floats == half


def test_a_relative_path_needs_a_saved_file(scene, tmp_path):
    scene.render.filepath = "//shot_"
    with pytest.raises(BadInputError, match="never saved"):
        render(scene)


def test_a_file_output_node_beside_no_file_is_said(scene, tmp_path):
    tree, _, _ = add_compositor(scene)
    node = tree.nodes.new("CompositorNodeOutputFile")
    setattr(node, "directory" if hasattr(node, "directory") else "base_path", "//nodes/")
    with pytest.raises(BadInputError, match=f"{node.name}.* never saved"):
        render(scene)


def test_a_template_that_nobody_knows_is_said(scene, tmp_path):
    scene.render.filepath = str(tmp_path / "{nothing}_")
    with pytest.raises(BadInputError, match="output path cannot be used"):
        render(scene)


@pytest.mark.parametrize(
    ("path", "name"),
    [
        ("//shots/shot_", "shot_"),
        ("/elsewhere/..", ""),
        ("..", ""),
        ("/elsewhere/.", ""),
        ("", ""),
        ("/elsewhere/", ""),
        ("/elsewhere\\shot_", "shot_"),
        ("/elsewhere/..##", ".."),
        ("/elsewhere/{{x}}/{{shot}}", "{shot}"),
        *([("{blend_dir}", ""), ("/a/x{blend_dir}y_", "y_")] if bpy.app.version >= (5, 0) else []),
    ],
)
@pytest.mark.parametrize("folder", ["out", "back\\slash"])
def test_of_the_scenes_output_path_only_the_beginning_of_a_name_goes_to_another_folder(
    scene, tmp_path, path, name, folder
):
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "room.blend"), copy=False)
    scene.render.filepath = path
    _, output = output_of(
        scene, AnimationSettings(frames=(7, 12), output=str(tmp_path / folder), layout="side-by-side")
    )
    numbers = ("07", "12") if "##" in path else ("0007", "0012")
    assert [path.name for path in output.all_files] == [f"{name}{number}.png" for number in numbers]
    assert {path.parent for path in output.all_files} == {output.folder} == {tmp_path / folder}


def test_a_file_suffix_leads_to_no_other_folder(scene, tmp_path):
    scene.render.image_settings.views_format = "INDIVIDUAL"
    scene.render.views["left"].file_suffix = "/../../L"
    with pytest.raises(BadInputError, match=r"suffix .* of the view 'left' leads to another folder"):
        render_animation(StereoSettings(), scene=scene, output=tmp_path / "out" / "frames", frames=[1])
    assert not list(tmp_path.iterdir())


def test_nothing_stays_in_the_folder_for_temporary_files(scene, tmp_path, monkeypatch):
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    for name in ("TMPDIR", "TEMP", "TMP"):
        monkeypatch.setenv(name, str(temporary))
    monkeypatch.setattr(tempfile, "tempdir", None)
    report = render(scene)
    assert report["rendered"] == 2
    assert tempfile.gettempdir() == str(temporary)
    assert not list(temporary.iterdir())


@pytest.mark.parametrize("suffixes", [("_X", "_X"), ("", ""), ("_eye", "_EYE")])
@pytest.mark.parametrize("how", [{}, {"layout": "individual", "movie": ""}])
def test_eyes_that_would_go_into_one_file_are_refused(scene, tmp_path, suffixes, how):
    if how:
        set_format(scene, "PNG", views="STEREO_3D")
    set_suffixes(scene, *suffixes)
    with pytest.raises(BadInputError, match=r"^the left eye of frame 1 and the right eye of frame 1 .* same file, .*"):
        render_animation(scene=scene, output=tmp_path / "out", **how)
    assert not list(tmp_path.iterdir())


def test_a_scenes_own_movie_of_each_eye_has_a_name_of_its_own(scene):
    set_format(scene, "FFMPEG", media="VIDEO")
    scene.render.ffmpeg.format = "MPEG4"
    set_suffixes(scene, "_X", "_X")
    with pytest.raises(BadInputError, match="would go into the same file"):
        output_of(scene, AnimationSettings())
    # Where both eyes share a movie, suffixes play no part.
    assert output_of(scene, AnimationSettings(layout="side-by-side"))


def test_no_eyes_file_is_that_of_another_frame(scene, tmp_path):
    scene.frame_start, scene.frame_end, scene.frame_step = 1000, 10000, 1000
    set_suffixes(scene, "", "0")
    with pytest.raises(BadInputError, match=r"^the right eye of frame 1000 and the left eye of frame 10000 "):
        output_of(scene, AnimationSettings(output=str(tmp_path)))
    _, output = output_of(scene, AnimationSettings(output=str(tmp_path), frames=(1000,)))
    assert [path.name for path in output.all_files] == ["shot_1000.png", "shot_10000.png"]


def set_suffixes(scene, left, right):
    scene.render.views["left"].file_suffix, scene.render.views["right"].file_suffix = left, right


@pytest.mark.skipif(os.sep == "\\", reason="there it is a separator")
def test_a_folder_with_a_backslash(scene, tmp_path):
    scene.render.filepath = "/elsewhere/.."
    folder = tmp_path / "out" / "back\\slash"
    report = render_animation(
        StereoSettings(fill="packed"), scene=scene, output=folder, movie="", layout="side-by-side", frames=[1]
    )
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == [folder.name]
    (movie,) = report["movies"]
    assert {"0001.png", Path(movie).name} <= {path.name for path in folder.iterdir()}
    assert [path.name for path in folder.glob(".*")] == [JOURNAL]


def test_the_result_goes_through_the_compositor_and_its_links_stay(scene, tmp_path):
    scene.view_layers[0].use_pass_diffuse_direct = True
    tree, layers, result = add_compositor(scene)
    brighter, other = (tree.nodes.new(f"CompositorNode{kind}") for kind in ("Exposure", "Denoise"))
    brighter.inputs["Exposure"].default_value = 1.0
    direct = next(socket for socket in layers.outputs if socket.name in ("DiffDir", "Diffuse Direct"))
    tree.links.new(layers.outputs["Image"], brighter.inputs["Image"])
    tree.links.new(direct, other.inputs["Image"])
    tree.links.new(brighter.outputs["Image"], result)
    links = [(link.from_socket.name, link.to_node.name, link.is_valid) for link in tree.links]

    set_format(scene, "OPEN_EXR", views="STEREO_3D")
    scene.render.image_settings.color_depth = "32"
    scene.render.image_settings.stereo_3d_format.display_mode = "SIDEBYSIDE"
    eyes = {
        view: {"ViewLayer": {COLOUR_PASS: np.full((*SIZE[::-1], 4), (value, value, value, 1.0), np.float32)}}
        for view, value in (("left", 0.25), ("right", 0.5))
    }
    deliver_frames(scene, lambda _: eyes, tmp_path, frames=range(2, 3))
    assert [(link.from_socket.name, link.to_node.name, link.is_valid) for link in tree.links] == links
    image = bpy.data.images.load(str(tmp_path / "shot_0002.exr"))
    pixels = np.array(image.pixels[:]).reshape(SIZE[1], 2 * SIZE[0], -1)
    assert pixels[0, 0, 0] == pytest.approx(0.5, rel=1e-3)
    assert pixels[0, -1, 0] == pytest.approx(1.0, rel=1e-3)
