"""Panoramic cameras are Cycles' own: a surface point that a multiview render shows somewhere is projected there."""

import itertools
from dataclasses import dataclass, field

import bpy
import numpy as np
import pytest

from stereo_reproject.blender.scene.rig import stereo_cameras
from stereo_reproject.errors import BadInputError
from stereo_reproject.images.passes import DEPTH_PASS
from tests.blender.toolbox import (
    EYES,
    FINEST_FILTER,
    add_camera,
    add_cube,
    add_sphere,
    diffuse,
    empty_scene,
    evaluated_camera,
    pixel_centres,
    px_from_world,
    render_plain,
    set_border,
)

WIDTH, HEIGHT = 64, 32

PIXELS = 1e-4
"""Of these pictures: some 1e-5 radians. Cycles computes in single precision, and shoots the only ray of a pixel
through its centre."""

DISTANCE = 1e-6
"""Relative; what is measured is the distance to Cycles' own point, which lies a little beside our ray."""


@pytest.fixture(scope="module")
def panorama():
    """A camera within a large ball, boxes all around it.

    Without persistent data: with them Cycles keeps an eye's offset once spherical stereo is switched off.
    """
    scene = empty_scene(WIDTH, HEIGHT)
    scene.cycles.filter_width = FINEST_FILTER
    scene.view_layers[0].use_pass_position = True
    grey = diffuse()
    add_sphere(scene, grey, radius=9.0, location=(0.5, -0.3, 0.2))
    rng = np.random.default_rng(1)
    for place in itertools.product((-2.4, 0.2, 2.1), repeat=3):
        if np.linalg.norm(place) > 1.0:
            add_cube(scene, grey, size=rng.uniform(0.5, 1.4), location=place, rotation=rng.uniform(0, 3, 3))
    add_camera(scene, interocular=0.2, convergence=2.5)
    scene.camera.location, scene.camera.rotation_euler = (0.1, -0.2, 0.15), (1.3, 0.2, 0.7)
    scene.camera.data.clip_start = 0.01
    return scene


DEGREE = np.pi / 180.0


@dataclass(frozen=True)
class Lens:
    """A panorama type, its settings, and the share of the picture that it must fill."""

    kind: str
    settings: dict = field(default_factory=dict)
    filled: float = 0.99


def longitudes(west, east, south=-90.0, north=90.0):
    angles = {"longitude_min": west, "longitude_max": east, "latitude_min": south, "latitude_max": north}
    return {name: angle * DEGREE for name, angle in angles.items()}


LENSES = {
    "VR180": Lens("EQUIRECTANGULAR", longitudes(-90.0, 90.0)),
    "360": Lens("EQUIRECTANGULAR", longitudes(-180.0, 180.0)),
    "part of a sphere": Lens("EQUIRECTANGULAR", longitudes(20.0, 170.0, -35.0, 70.0)),
    "equidistant": Lens("FISHEYE_EQUIDISTANT", {"fisheye_fov": 200.0 * DEGREE}, filled=0.7),
    "equisolid": Lens(
        "FISHEYE_EQUISOLID", {"fisheye_fov": 170.0 * DEGREE, "fisheye_lens": 9.0, "sensor_width": 30.0}, filled=0.5
    ),
    "polynomial": Lens("FISHEYE_LENS_POLYNOMIAL", {"sensor_fit": "VERTICAL", "sensor_height": 24.0}, filled=0.5),
    "cube face": Lens("EQUIANGULAR_CUBEMAP_FACE"),
    "cylinder": Lens(
        "CENTRAL_CYLINDRICAL",
        {
            "central_cylindrical_range_u_min": -100.0 * DEGREE,
            "central_cylindrical_range_u_max": 120.0 * DEGREE,
            "central_cylindrical_range_v_min": -1.5,
            "central_cylindrical_range_v_max": 2.5,
            "central_cylindrical_radius": 1.2,
        },
    ),
}

MODES = ("OFFAXIS", "PARALLEL", "TOE")
MERGES = {"apart": None, "merged": (30.0, 65.0), "at once": (50.0, 50.0)}


def set_up(scene, lens, stereo):
    """Settings of the lens and of the stereo, all others as they are by default."""
    data = scene.camera.data
    clean = bpy.data.cameras.new("Clean")
    for owner, values in ((data, clean), (data.stereo, clean.stereo)):
        for setting in values.bl_rna.properties:
            if not setting.is_readonly and setting.identifier in SETTINGS:
                setattr(owner, setting.identifier, getattr(values, setting.identifier))
    bpy.data.cameras.remove(clean)
    data.type, data.panorama_type = "PANO", lens.kind
    for name, value in lens.settings.items():
        setattr(data, name, value)
    for name, value in stereo.items():
        setattr(data.stereo, name, value)


SETTINGS = {
    *("shift_x", "shift_y", "sensor_fit", "sensor_width", "sensor_height", "fisheye_fov", "fisheye_lens", "lens"),
    *("convergence_mode", "pivot", "use_spherical_stereo", "use_pole_merge"),
}


def assert_camera_is_cycles(scene, folder, filled):
    """Both eyes of our rig against both views of Blender's render, both ways."""
    rendered = render_plain(scene, folder)
    cameras = stereo_cameras(evaluated_camera(scene), scene.render)
    for view in EYES:
        camera, passes = cameras[view], rendered[view]
        depth = passes[DEPTH_PASS][..., 0]
        hit = np.isfinite(depth) & (depth > 0)
        assert hit.mean() > filled, "the lens must fill its part of the picture"
        x, y = pixel_centres(hit.shape)
        seen = Cycles(x, y, passes["Position"].astype(np.float64), hit)
        off = np.maximum(off_ray(camera, seen), off_place(camera, seen))
        assert np.max((off - cosine_rounding(scene.camera.data, x, y))[hit]) < PIXELS, view


@dataclass(frozen=True)
class Cycles:
    """What Cycles tells of each pixel, (H, W): its centre x, y, the point that its first ray has met (H, W, 3), and
    whether it has met any."""

    x: np.ndarray
    y: np.ndarray
    point: np.ndarray
    hit: np.ndarray


def off_ray(camera, seen):
    """How far, in pixels, Cycles' points lie beside the rays that we shoot where Cycles shot its own. The pixels'
    larger side counts: near a pole the other one is as narrow as one likes."""
    origin, direction = rays(camera, seen.x, seen.y)
    assert np.array_equal(np.isfinite(direction[..., 0]), seen.hit)
    from_eye = in_camera(camera, seen.point) - origin
    sine = np.linalg.norm(np.cross(from_eye, direction), axis=-1) / np.linalg.norm(from_eye, axis=-1)
    return sine / np.fmax(*pixel_angles(camera, seen))


def off_place(camera, seen):
    """How far, in pixels as above, the places at which we project Cycles' points are from where Cycles saw them."""
    origin, _ = rays(camera, seen.x, seen.y)
    x, y, distance = px_from_world(camera, seen.point)
    from_eye = np.linalg.norm(in_camera(camera, seen.point) - origin, axis=-1)
    np.testing.assert_allclose(distance[seen.hit], from_eye[seen.hit], rtol=DISTANCE)
    off_x, off_y = x - seen.x, y - seen.y
    if np.isfinite(camera.period_px):
        off_x -= camera.period_px * np.round(off_x / camera.period_px)
    across, down = pixel_angles(camera, seen)
    return np.hypot(off_x * across, off_y * down) / np.fmax(across, down)


def in_camera(camera, point):
    world = camera.world_from_camera
    return (point - world[:3, 3]) @ np.linalg.inv(world[:3, :3]).T


def rays(camera, x, y):
    """Origin and direction (H, W, 3)."""
    return tuple(np.stack(np.broadcast_arrays(*part, x)[:3], axis=-1) for part in camera.ray_from_px(x, y))


def pixel_angles(camera, seen):
    """The angles (H, W) between the rays of places a pixel apart, across and down."""
    _, here = rays(camera, seen.x, seen.y)
    step = 1e-3
    for there in ((seen.x + step, seen.y), (seen.x, seen.y + step)):
        yield np.linalg.norm(np.cross(here, rays(camera, *there)[1]), axis=-1) / step


def cosine_rounding(data, x, y):
    """Pixels by which Cycles' fisheyes are off: it takes an angle in the picture from its cosine, which tells little
    beside the horizontal through the middle."""
    if not data.panorama_type.startswith("FISHEYE") or data.type != "PANO":
        return 0.0
    right, up = x - WIDTH * (0.5 - data.shift_x), y - HEIGHT * (0.5 + data.shift_y)
    return np.finfo(np.float32).eps * (right**2 + up**2) / np.abs(up)


def pole_limits(limits):
    if limits is None:
        return {}
    return {"pole_merge_angle_from": limits[0] * DEGREE, "pole_merge_angle_to": limits[1] * DEGREE}


SPHERICAL = [
    pytest.param(
        {
            "use_spherical_stereo": True,
            "convergence_mode": mode,
            "use_pole_merge": limits is not None,
            **pole_limits(limits),
        },
        id=f"{mode}-{name}",
    )
    for mode, (name, limits) in itertools.product(MODES, MERGES.items())
]


@pytest.mark.parametrize("stereo", SPHERICAL)
@pytest.mark.parametrize("lens", LENSES.values(), ids=LENSES.keys())
def test_spherical_stereo(panorama, tmp_path, lens, stereo):
    set_up(panorama, lens, stereo)
    assert_camera_is_cycles(panorama, tmp_path, lens.filled)


PLAIN = [("OFFAXIS", "LEFT"), ("PARALLEL", "RIGHT"), ("TOE", "LEFT"), ("TOE", "CENTER")]


@pytest.mark.parametrize(("mode", "pivot"), PLAIN)
@pytest.mark.parametrize("lens", LENSES.values(), ids=LENSES.keys())
def test_plain_lenses(panorama, tmp_path, lens, mode, pivot):
    set_up(panorama, lens, {"convergence_mode": mode, "pivot": pivot})
    panorama.camera.data.shift_x = 0.03
    if lens.settings.get("latitude_max") != longitudes(0.0, 0.0)["latitude_max"]:
        # Beyond a pole a point is seen twice.
        panorama.camera.data.shift_y = 2.0 / HEIGHT
    assert_camera_is_cycles(panorama, tmp_path, lens.filled - 0.1)


@pytest.mark.parametrize("stereo", SPHERICAL)
def test_perspective_with_spherical_stereo(panorama, tmp_path, stereo):
    """It turns around the world's z, and the camera is tilted."""
    set_up(panorama, LENSES["VR180"], stereo)
    data = panorama.camera.data
    data.type, data.lens, data.shift_x, data.shift_y = "PERSP", 12.0, 0.1, 0.2
    assert_camera_is_cycles(panorama, tmp_path, 0.99)


@pytest.mark.parametrize("lens", LENSES.values(), ids=LENSES.keys())
def test_pixel_aspect_sensor_fit_and_a_turned_and_scaled_camera(panorama, tmp_path, lens):
    set_up(panorama, lens, SPHERICAL[1].values[0] | {"pivot": "RIGHT"})
    camera, render = panorama.camera, panorama.render
    camera.scale, render.pixel_aspect_x = (-2.0, 0.5, 3.0), 1.5
    camera.data.sensor_fit = "HORIZONTAL"
    try:
        assert_camera_is_cycles(panorama, tmp_path, 0.3)
    finally:
        camera.scale, render.pixel_aspect_x = (1.0, 1.0, 1.0), 1.0


@pytest.mark.parametrize("lens", LENSES.values(), ids=LENSES.keys())
def test_render_border(panorama, tmp_path, lens):
    """The pixels of a part are those of the whole."""
    set_up(panorama, lens, SPHERICAL[1].values[0])
    whole = stereo_cameras(evaluated_camera(panorama), panorama.render)["right"]
    set_border(panorama, (0.25, 0.75, 0.125, 1.0))
    try:
        part = stereo_cameras(evaluated_camera(panorama), panorama.render)["right"]
    finally:
        panorama.render.use_border = False
    assert (part.width, part.height) == (32, 28)
    x, y = pixel_centres((part.height, part.width))
    np.testing.assert_allclose(rays(part, x, y), rays(whole, x + 16.0, y), rtol=0.0, atol=1e-12)


def test_a_cylinder_with_an_aperture_converges_on_a_ball(panorama, tmp_path):
    """Cycles makes its directions unit ones only where it moves rays over the lens."""
    set_up(panorama, LENSES["cylinder"], SPHERICAL[1].values[0])
    dof = panorama.camera.data.dof
    dof.use_dof, dof.aperture_fstop = True, 1e6
    try:
        assert_camera_is_cycles(panorama, tmp_path, 0.99)
    finally:
        dof.use_dof = False


@pytest.mark.parametrize(
    ("lens", "settings", "words"),
    [
        ("360", {"longitude_max": -np.pi}, "longitudes are the same"),
        ("360", {"latitude_min": 0.5, "latitude_max": 0.5}, "latitudes are the same"),
        ("cylinder", {"central_cylindrical_range_v_min": 1.0, "central_cylindrical_range_v_max": 1.0}, "heights"),
    ],
)
def test_a_panorama_without_a_view_is_said(panorama, lens, settings, words):
    set_up(panorama, LENSES[lens], {})
    for name, value in settings.items():
        setattr(panorama.camera.data, name, value)
    with pytest.raises(BadInputError, match=words):
        stereo_cameras(evaluated_camera(panorama), panorama.render)
