"""The examples of docs/scripting.md, run as they stand."""

import re
from pathlib import Path

import bpy
import pytest

from stereo_reproject.blender.api import (
    BadInputError,
    StereoReprojectError,
    StereoSettings,
    inspect,
    render_animation,
    render_frame,
)
from stereo_reproject.blender.commands.frame import render_pair
from stereo_reproject.jobs.work_folder import DIFFERENCE, FILES
from tests.blender.snapshot import everything
from tests.blender.toolbox import add_camera, add_plane, add_sun, diffuse, empty_scene

DOCS = Path(__file__).resolve().parents[2] / "docs" / "scripting.md"
EXAMPLES = re.findall(r"```python\n(.*?)```", DOCS.read_text(encoding="utf-8"), re.DOTALL)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A script's folder, with the room that its examples open."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PWD", str(tmp_path))  # what Blender 4.5 takes a relative path to be relative to
    scene = empty_scene(160, 90, samples=4)
    add_plane(scene, diffuse("wall"), size=(30, 20), location=(0, 0, -8))
    add_plane(scene, diffuse("card", colour=(0.9, 0.2, 0.1)), size=(1, 2), location=(0.3, 0.2, -4))
    add_sun(scene, strength=1.5)
    add_camera(scene)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "room.blend"))
    return tmp_path


def files(folder):
    return sorted(path.name for path in folder.rglob("*") if path.is_file())


def test_the_examples_run_one_after_the_other(folder, capsys):
    for example in EXAMPLES:
        before = everything()
        exec(compile(example, str(DOCS), "exec"), {})  # noqa: S102 - they are ours
        if "open_mainfile" not in example and "filepath" not in example:
            assert everything() == before
    said = capsys.readouterr().out
    assert "of the right eye was rendered" in said
    assert "times as fast, honest ratio" in said
    assert "it calls for nothing:" in said
    assert files(folder / "out" / "room") == sorted(FILES)
    assert files(folder / "out" / "compared") == sorted([*FILES, DIFFERENCE])
    shots = [name for name in files(folder / "out") if re.fullmatch(r"shot_\d+\.png", name)]
    assert shots == ["shot_0001.png", "shot_0002.png"]


def test_every_name_has_its_example(folder):
    listed = re.findall(r"^\| (`.*?) \|", DOCS.read_text(encoding="utf-8"), re.MULTILINE)
    functions = [name for row in listed for name in re.findall(r"`(\w+)\(", row)]
    assert sorted(functions) == ["compare", "inspect", "render_animation", "render_frame"]
    for name in functions:
        assert any(f"{name}(" in example for example in EXAMPLES), name


def test_a_failed_frame_leaves_nothing_and_the_scene_as_it_was(folder, monkeypatch):
    def fails(*_args, **_how):
        raise StereoReprojectError("forced")

    before = everything()
    monkeypatch.setattr("stereo_reproject.blender.commands.frame.write_grid", fails)
    with pytest.raises(StereoReprojectError, match="forced"):
        render_frame(folder / "out", StereoSettings(accuracy="draft"))
    assert everything() == before
    assert not (folder / "out").exists()


def test_bad_input_is_told_and_changes_nothing(folder):
    (folder / "taken").write_text("mine")
    before = everything()
    with pytest.raises(BadInputError, match="is not a folder"):
        render_frame(folder / "taken")
    bpy.context.scene.render.filepath = str(folder / "taken" / "shot_")
    with pytest.raises(BadInputError, match="choose another folder"):
        render_animation(frames=range(1, 2))
    bpy.context.scene.render.filepath = before["scenes", "Scene", None]["render"]["filepath"]
    assert everything() == before
    assert files(folder) == ["room.blend", "taken"]


def test_a_plan_needs_no_render(folder):
    found = inspect(sketch=False)
    assert (found["predicted"], found["parallax"]) == (None, None)


def test_a_pair_is_told_with_its_parallax(folder, tmp_path):
    (tmp_path / "tmp").mkdir()
    _, report = render_pair(bpy.context.scene, StereoSettings(accuracy="draft", fill="packed"), tmp_path)
    near, far = report.parallax.nearest, report.parallax.farthest
    assert near.depth == pytest.approx(4.0, rel=1e-3)
    assert far.depth == pytest.approx(8.0, rel=1e-3)
    assert near.pixels < 0.0 < far.pixels
    assert near.percent == pytest.approx(100.0 * near.pixels / 160)
