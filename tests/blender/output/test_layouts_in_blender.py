"""How a frame holds both eyes: each layout as Blender writes it, pixel by pixel, and the scene's settings as before."""

import bpy
import numpy as np
import OpenEXR
import pytest

from stereo_reproject.blender.output.delivery import deliver_frames
from stereo_reproject.blender.output.layouts import (
    DUBOIS,
    STEREO_3D,
    as_ordered,
    deliver_anaglyph,
    is_our_own,
    layout_of,
)
from stereo_reproject.blender.output.pictures import read_png
from stereo_reproject.delivery.anaglyph import dubois
from stereo_reproject.delivery.layouts import LAYOUTS
from stereo_reproject.errors import BadInputError
from stereo_reproject.images.passes import COLOUR_PASS
from tests.blender.snapshot import everything
from tests.blender.toolbox import add_camera, empty_scene

WIDTH, HEIGHT = 12, 8

LEFT, RIGHT = (0.8, 0.4, 0.2), (0.1, 0.3, 0.6)

ROUNDING = 1.01 / 255.0
"""A PNG of 8 bits: a value may fall on either side of a step."""

HALF = 1e-3
"""A half float of this size has steps of about 0.0005."""


@pytest.fixture
def scene():
    """A scene with nothing in it, whose pictures are what is handed over."""
    scene = empty_scene(WIDTH, HEIGHT)
    add_camera(scene)
    scene.render.dither_intensity = 0.0
    scene.view_settings.view_transform = "Raw"
    set_media(scene, "IMAGE")
    scene.render.image_settings.file_format = "PNG"
    scene.render.filepath = "//shot_"
    return scene


def set_media(scene, media):
    settings = scene.render.image_settings
    if hasattr(settings, "media_type"):
        settings.media_type = media


def flat(colour):
    return np.broadcast_to(np.array([*colour, 1.0], np.float32), (HEIGHT, WIDTH, 4))


def deliver(scene, folder, layout, file_format="PNG", *, left=None, right=None):
    """The files of frame 7, by name."""
    pictures = {"left": flat(LEFT) if left is None else left, "right": flat(RIGHT) if right is None else right}
    eyes = {view: {scene.view_layers[0].name: {COLOUR_PASS: picture}} for view, picture in pictures.items()}
    how = deliver_anaglyph if is_our_own(layout) else deliver_frames
    with as_ordered(scene, str(folder), layout, file_format):
        how(scene, lambda _: eyes, folder / "made", frames=range(7, 8))
    return {path.name: path for path in sorted((folder / "made").iterdir())}


def picture_of(scene, folder, layout, **how):
    files = deliver(scene, folder, layout, **how)
    assert list(files) == ["shot_0007.png"]
    return read_png(files["shot_0007.png"])


def expected(layout):
    """Where Blender's conventions, as `delivery.layouts` tells them, put which eye."""
    left, right = flat(LEFT)[..., :3], flat(RIGHT)[..., :3]
    rows, columns = np.indices((HEIGHT, WIDTH))
    from_below = HEIGHT - 1 - rows
    is_left = {
        "interlace-rows": from_below % 2 == 0,
        "interlace-columns": columns % 2 == 0,
        "interlace-checkerboard": (from_below + columns) % 2 == 0,
    }
    channels_of_left = {
        "anaglyph-red-cyan": (True, False, False),
        "anaglyph-green-magenta": (False, True, False),
        "anaglyph-yellow-blue": (True, True, False),
    }
    if layout in is_left:
        return np.where(is_left[layout][..., None], left, right)
    if layout in channels_of_left:
        return np.where(channels_of_left[layout], left, right)
    half_wide, half_high = slice(None, WIDTH // 2), slice(None, HEIGHT // 2)
    return {
        "side-by-side": lambda: np.concatenate([left, right], axis=1),
        "side-by-side-half": lambda: np.concatenate([left[:, half_wide], right[:, half_wide]], axis=1),
        "cross-eyed": lambda: np.concatenate([right, left], axis=1),
        "top-bottom": lambda: np.concatenate([left, right], axis=0),
        "top-bottom-half": lambda: np.concatenate([left[half_high], right[half_high]], axis=0),
        DUBOIS: lambda: dubois(left, right),
    }[layout]()


IN_ONE_PICTURE = [name for name in LAYOUTS if name not in ("individual", "multi-view")]


@pytest.mark.parametrize("layout", IN_ONE_PICTURE)
def test_each_eye_is_where_the_layout_has_it(scene, tmp_path, layout):
    before = everything()
    shown = picture_of(scene, tmp_path, layout)
    assert everything() == before
    wanted = expected(layout)
    assert shown.shape == wanted.shape
    np.testing.assert_allclose(shown, wanted, atol=ROUNDING)


def test_every_layout_is_another_picture(scene, tmp_path):
    """Else the test above would hold for one that is never set."""
    seen = set()
    for layout in IN_ONE_PICTURE:
        (tmp_path / layout).mkdir()
        seen.add(picture_of(scene, tmp_path / layout, layout).tobytes())
    # Flat colours look the same where a picture is squeezed, but for its size.
    assert len(seen) == len(IN_ONE_PICTURE)


def test_rows_stand_upright(scene, tmp_path):
    ramp = np.ones((HEIGHT, WIDTH, 4), np.float32)
    ramp[..., 0] = np.linspace(0.0, 1.0, HEIGHT)[:, None]
    for layout in ("side-by-side", DUBOIS):
        (tmp_path / layout).mkdir()
        shown = picture_of(scene, tmp_path / layout, layout, left=ramp, right=ramp)
        assert shown[0, 0, 0] < shown[-1, 0, 0], layout


def test_individual_files(scene, tmp_path):
    files = deliver(scene, tmp_path, "individual")
    assert list(files) == ["shot_0007_L.png", "shot_0007_R.png"]
    for name, colour in (("shot_0007_L.png", LEFT), ("shot_0007_R.png", RIGHT)):
        np.testing.assert_allclose(read_png(files[name]), flat(colour)[..., :3], atol=ROUNDING)


@pytest.mark.parametrize("file_format", ["OPEN_EXR", "OPEN_EXR_MULTILAYER"])
def test_both_views_in_one_file(scene, tmp_path, file_format):
    before = everything()
    files = deliver(scene, tmp_path, "multi-view", file_format)
    assert everything() == before
    assert list(files) == ["shot_0007.exr"]
    with OpenEXR.File(str(files["shot_0007.exr"]), separate_channels=True) as file:
        found = {
            (part.header.get("view"), name): np.array(channel.pixels)
            for part in file.parts
            for name, channel in part.channels.items()
        }
    reds = [values for (_, name), values in found.items() if name.endswith("R")]
    assert sorted(float(red.mean()) for red in reds) == pytest.approx([RIGHT[0], LEFT[0]], abs=HALF)


def test_dubois_is_made_of_what_screens_show(scene, tmp_path):
    """After the view transform, which the anaglyph itself does not go through again."""
    scene.view_settings.view_transform = "Standard"
    scene.view_settings.exposure = 1.0
    (tmp_path / "sides").mkdir()
    sides = picture_of(scene, tmp_path / "sides", "side-by-side", file_format="PNG16")
    left, right = np.split(sides, 2, axis=1)
    before = everything()
    shown = picture_of(scene, tmp_path, DUBOIS)
    assert everything() == before
    np.testing.assert_allclose(shown, dubois(left, right), atol=ROUNDING)
    assert np.abs(shown - expected(DUBOIS)).max() > 0.1


def test_dubois_in_another_format(scene, tmp_path):
    files = deliver(scene, tmp_path, DUBOIS, "JPEG")
    assert list(files) == ["shot_0007.jpg"]


# The scene's own settings


@pytest.mark.parametrize("layout", [name for name in LAYOUTS if name != DUBOIS])
def test_a_layout_is_known_by_the_settings_that_make_it(scene, layout):
    file_format = "OPEN_EXR" if layout == "multi-view" else "PNG"
    with as_ordered(scene, None, layout, file_format):
        assert layout_of(scene) == layout
    scene.render.image_settings.views_format = "STEREO_3D"
    stereo = scene.render.image_settings.stereo_3d_format
    for name, value in STEREO_3D.get(layout, {}).items():
        setattr(stereo, name, value)
    assert layout_of(scene) == (layout if layout in STEREO_3D else "anaglyph-red-cyan")


def test_what_has_no_name_is_none(scene):
    settings = scene.render.image_settings
    settings.views_format = "STEREO_3D"
    settings.stereo_3d_format.display_mode = "INTERLACE"
    settings.stereo_3d_format.use_interlace_swap = True
    assert layout_of(scene) is None


def own_png(scene):
    scene.render.image_settings.color_depth = "16"


def own_side_by_side(scene):
    scene.render.image_settings.views_format = "STEREO_3D"
    scene.render.image_settings.stereo_3d_format.use_squeezed_frame = True


def own_multi_view(scene):
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.views_format = "MULTIVIEW"
    scene.render.image_settings.exr_codec = "PIZ"


def own_multilayer(scene):
    set_media(scene, "MULTI_LAYER_IMAGE")
    scene.render.image_settings.file_format = "OPEN_EXR_MULTILAYER"
    scene.render.image_settings.views_format = "MULTIVIEW"


def own_movie(scene):
    set_media(scene, "VIDEO")
    scene.render.image_settings.file_format = "FFMPEG"


@pytest.mark.parametrize("own", [own_png, own_side_by_side, own_multi_view, own_multilayer, own_movie])
@pytest.mark.parametrize(
    ("layout", "file_format"),
    [
        (None, None),
        (None, "PNG"),
        ("individual", "JPEG"),
        ("top-bottom-half", "PNG16"),
        ("multi-view", "OPEN_EXR"),
        ("multi-view", "OPEN_EXR_MULTILAYER"),
    ],
)
def test_the_settings_are_afterwards_as_they_were(scene, tmp_path, own, layout, file_format):
    own(scene)
    before = everything()
    with as_ordered(scene, str(tmp_path), layout, file_format):
        assert layout is None or layout_of(scene) == layout
        if file_format is not None:
            assert scene.render.image_settings.file_format == file_format.removesuffix("16")
    assert everything() == before


@pytest.mark.parametrize(
    ("layout", "file_format", "part"),
    [
        (DUBOIS, "OPEN_EXR", "anaglyph-dubois is made of what screens show: choose a format such as PNG, not OPEN_EXR"),
        ("side-by-side", "OPEN_EXR_MULTILAYER", "OPEN_EXR_MULTILAYER has no stereo 3D layouts such as side-by-side"),
        ("multi-view", "PNG", "PNG cannot hold multi-view: choose OPEN_EXR or OPEN_EXR_MULTILAYER"),
        ("multi-view", "JPEG", "JPEG cannot hold multi-view"),
        ("side-by-side", "GIF", "the format must be one of "),
        (None, "png", "not 'png'"),
        (None, "FFMPEG", "not 'FFMPEG'"),
    ],
)
def test_what_does_not_go_together_is_one_line_and_changes_nothing(scene, tmp_path, layout, file_format, part):
    before = everything()
    with pytest.raises(BadInputError) as refused, as_ordered(scene, str(tmp_path), layout, file_format):
        pass
    assert part in str(refused.value)
    assert "\n" not in str(refused.value)
    assert everything() == before


def test_every_format_that_is_offered_can_be_set(scene):
    with pytest.raises(BadInputError) as refused, as_ordered(scene, None, None, "nothing"):
        pass
    offered = str(refused.value).partition("one of ")[2].partition(", not")[0].split(", ")
    assert {"PNG", "JPEG", "OPEN_EXR", "OPEN_EXR_MULTILAYER"} <= set(offered)
    assert not {"FFMPEG", "AVI_JPEG", "AVI_RAW"} & set(offered)
    for name in offered:
        with as_ordered(scene, None, None, name):
            assert scene.render.image_settings.file_format == name
    assert not bpy.context.scene.render.is_movie_format
