"""Libraries and files that a scene refers to and that are not there: each is said before anything is rendered."""

import bpy
import pytest

from stereo_reproject.blender.api import inspect, render_animation, render_frame
from stereo_reproject.blender.scene.instancing import brought_along
from stereo_reproject.blender.scene.missing import missing_files
from stereo_reproject.blender.scene.warnings import scene_warnings, warnings_ahead
from stereo_reproject.blender.scene.working import open_blend
from stereo_reproject.errors import BadInputError
from stereo_reproject.settings.frame import SceneOverrides, StereoSettings
from tests.blender.toolbox import Material, add, add_camera, add_plane, diffuse, emission, empty_scene

SIZE = (32, 18)


@pytest.fixture(scope="module")
def shot(tmp_path_factory):
    """A .blend that links a collection, an object and a material from two libraries, the first of which links an object
    from a third."""
    folder = tmp_path_factory.mktemp("shot")
    (folder / "lib").mkdir()
    scene = empty_scene(*SIZE)
    screw = add_plane(scene, diffuse("steel"))
    screw.name = "Screw"
    bpy.data.libraries.write(str(folder / "lib" / "parts.blend"), {screw}, fake_user=True)
    bpy.data.libraries.write(str(folder / "paint.blend"), {diffuse("red").block}, fake_user=True)

    scene = empty_scene(*SIZE)
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "lib" / "set.blend"))
    chairs = bpy.data.collections.new("Chairs")
    scene.collection.children.link(chairs)
    chairs.objects.link(link(folder / "lib" / "parts.blend", "objects", "Screw"))
    for _ in range(3):
        chair = add_plane(scene, diffuse("wood"))
        chair.name = "Chair"
        chairs.objects.link(chair)
    bpy.ops.wm.save_mainfile()

    scene = empty_scene(*SIZE)
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "shot.blend"))
    row = add(scene, bpy.data.objects.new("Row", None))
    row.instance_type, row.instance_collection = (
        "COLLECTION",
        link(folder / "lib" / "set.blend", "collections", "Chairs"),
    )
    add(scene, link(folder / "lib" / "set.blend", "objects", "Chair"))
    floor = add_plane(scene, diffuse("floor"), location=(0, 0, -5))
    floor.data.materials[0] = link(folder / "paint.blend", "materials", "red")
    add_camera(scene)
    bpy.ops.wm.save_mainfile()
    return folder


def link(path, kind, name):
    with bpy.data.libraries.load(str(path), link=True, relative=True) as (_, wanted):
        setattr(wanted, kind, [name])
    return getattr(wanted, kind)[0]


@pytest.fixture
def replaced(shot):
    """Puts something in the place of a library, until the test is over."""
    kept = {}

    def replace(name, make=lambda _: None):
        path = shot / name
        kept[path] = path.with_suffix(".kept")
        path.rename(kept[path])
        make(path)
        return path

    yield replace
    for path, away in kept.items():
        if path.is_dir():
            path.rmdir()
        path.unlink(missing_ok=True)
        away.rename(path)


def warnings_of(shot):
    return warnings_ahead(open_blend(shot / "shot.blend"), SceneOverrides())


def test_of_a_scene_that_has_all_its_libraries_nothing_is_said(shot):
    assert warnings_of(shot) == []


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("lib/set.blend", "{} is missing, which leaves out 1 object and 1 collection of objects, such as 'Chair'"),
        ("lib/parts.blend", "{}, linked by {set}, is missing, which leaves out 1 object, such as 'Screw'"),
        ("paint.blend", "{} is missing, which leaves out 1 material, such as 'red'"),
    ],
)
def test_a_missing_library_is_named_with_what_goes_with_it(shot, replaced, name, said):
    path = replaced(name)
    (line,) = warnings_of(shot)
    assert line.startswith("library " + said.format(path, set=shot / "lib" / "set.blend"))


def test_each_of_several_has_its_line(shot, replaced):
    paths = {str(replaced(name)) for name in ("lib/parts.blend", "paint.blend")}
    assert {line.split()[1].rstrip(",") for line in warnings_of(shot)} == paths


@pytest.mark.parametrize(
    ("make", "wrong"),
    [
        (lambda path: path.mkdir(), "is a folder"),
        (lambda path: path.write_text("no .blend"), "cannot be read"),
        (lambda path: path.write_bytes((path.parents[1] / "paint.blend").read_bytes()), "lacks what is linked from it"),
    ],
)
def test_a_library_that_is_there_and_has_not_what_is_linked(shot, replaced, make, wrong):
    path = replaced("lib/set.blend", make)
    (line,) = warnings_of(shot)
    assert line.startswith(f"library {path} {wrong}, which leaves out 1 object and 1 collection")


def test_a_library_that_breaks_off_is_an_error_that_names_it(shot, replaced):
    path = replaced("lib/set.blend", lambda path: path.write_bytes(path.with_suffix(".kept").read_bytes()[:2000]))
    with pytest.raises(BadInputError, match=rf"Blender cannot open .*shot\.blend: .*{path.name}"):
        open_blend(shot / "shot.blend")


def test_strict_is_an_error_before_anything_is_rendered(shot, replaced, tmp_path):
    paths = [replaced(name) for name in ("lib/parts.blend", "paint.blend")]
    scene = open_blend(shot / "shot.blend")
    settings = StereoSettings(scene=SceneOverrides(size=SIZE))
    for call in (
        lambda: inspect(settings, sketch=False, strict=True),
        lambda: render_frame(tmp_path / "out", settings, strict=True),
        lambda: render_animation(settings, frames=[1], output=tmp_path / "out", strict=True),
    ):
        with pytest.raises(BadInputError) as raised:
            call()
        assert raised.value.exit_status == 2
        assert "\n" not in str(raised.value)
        assert all(str(path) in str(raised.value) for path in paths)
    assert list(tmp_path.iterdir()) == []
    assert inspect(settings, sketch=False)["warnings"] == warnings_ahead(scene, settings.scene)


# Files


@pytest.fixture
def scene():
    scene = empty_scene(*SIZE)
    add_camera(scene)
    return scene


def image(folder, name, source="FILE"):
    picture = bpy.data.images.new(name, 1, 1)
    picture.source, picture.filepath = source, str(folder / name)
    return picture


@pytest.mark.parametrize(
    ("source", "name", "there"),
    [
        ("FILE", "wall.png", "wall.png"),
        ("SEQUENCE", "fire_0001.png", "fire_0099.png"),
        ("MOVIE", "screen.mp4", "screen.mp4"),
        ("TILED", "skin.<UDIM>.png", "skin.1001.png"),
    ],
)
def test_pictures_of_every_kind(scene, tmp_path, source, name, there):
    add_plane(scene, diffuse("shown", image=image(tmp_path, name, source)))
    (line,) = missing_files(scene)
    assert line.startswith(f"image file missing for {name!r}: ")
    (tmp_path / there).write_bytes(b"there")
    assert missing_files(scene) == []


@pytest.mark.parametrize("source", ["FILE", "SEQUENCE", "TILED"])
def test_a_name_that_no_drive_can_have_is_a_missing_file(scene, tmp_path, source):
    add_plane(scene, diffuse("shown", image=image(tmp_path, f"{'n' * 300}<UDIM>0001.png", source)))
    (line,) = missing_files(scene)
    assert line.startswith("image file missing for ")


def test_pictures_that_no_render_shows_are_not_missed(scene, tmp_path):
    backdrop = image(tmp_path, "backdrop.png")
    scene.camera.data.background_images.new().image = backdrop
    reference = add(scene, bpy.data.objects.new("Reference", None))
    reference.empty_display_type, reference.data = "IMAGE", backdrop
    image(tmp_path, "kept.png").use_fake_user = True
    assert missing_files(scene) == []
    add_plane(scene, emission("shown", image=backdrop))
    assert len(missing_files(scene)) == 1


def test_other_kinds_of_files(scene, tmp_path):
    volume = bpy.data.volumes.new("Smoke")
    volume.filepath = str(tmp_path / "smoke_0001.vdb")
    add(scene, bpy.data.objects.new("Smoke", volume))
    flag = add_plane(scene, diffuse("flag"))
    flag.name = "Flag"
    flag.modifiers.new("Cache", "MESH_CACHE").filepath = str(tmp_path / "flag.pc2")
    lamp = Material("lamp")
    beam = lamp.node("TexIES")
    beam.mode, beam.filepath = "EXTERNAL", str(tmp_path / "beam.ies")
    add_plane(scene, lamp.surface(lamp.node("Emission")))
    assert [line.partition(":")[0] for line in missing_files(scene)] == [
        "cache file missing for 'Flag'",
        "volume missing for 'Smoke'",
        "file of a node missing for 'IES Texture'",
    ]
    volume.is_sequence = True
    for name in ("smoke_0002.vdb", "flag.pc2", "beam.ies"):
        (tmp_path / name).write_bytes(b"there")
    assert missing_files(scene) == []


# What instances bring along


def test_simulations_within_instances_are_known(scene):
    cloth = bpy.data.objects.new("Cloth", bpy.data.meshes.new("Cloth"))
    cloth.modifiers.new("Cloth", "CLOTH")
    inner, outer = (bpy.data.collections.new(name) for name in ("Inner", "Outer"))
    inner.objects.link(cloth)
    for name, collection, owner in (("A", inner, outer), ("B", outer, scene.collection)):
        empty = bpy.data.objects.new(name, None)
        empty.instance_type, empty.instance_collection = "COLLECTION", collection
        owner.objects.link(empty)
    assert {item.name for item in brought_along(scene.objects)} == {"Camera", "A", "B", "Cloth"}
    assert scene_warnings(scene) == [
        "a simulation is not baked, 'Cloth' on 'Cloth': bake it, or it may look different here"
    ]
