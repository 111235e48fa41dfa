"""Pictures that explain a pair are no part of the user's file."""

import bpy
import numpy as np
import pytest

from tests.blender.toolbox import mirror_before_wall


@pytest.fixture
def shown(extension):
    """A scene whose pictures were asked for, and those pictures."""
    from stereo_reproject_extension.operators.pictures import load_picture

    scene = mirror_before_wall(96, 54, samples=4)
    assert bpy.ops.render.stereo_reproject_image() == {"FINISHED"}
    return scene, [load_picture(scene, which) for which in ("HOLES", "GRID", "ERRORS")]


def ours():
    return sorted(image.name for image in bpy.data.images if image.name.startswith("Stereo "))


@pytest.mark.parametrize("packs", [False, True], ids=["plain", "packed automatically"])
def test_they_are_not_saved_with_the_file(shown, tmp_path, packs):
    assert len(ours()) == 3
    path = tmp_path / "saved.blend"
    if packs:
        bpy.ops.file.autopack_toggle()
    try:
        bpy.ops.wm.save_as_mainfile(filepath=str(path))
        assert len(ours()) == 3, "they stay where they are shown"
        bpy.ops.wm.open_mainfile(filepath=str(path))
        assert ours() == []
    finally:
        if packs:
            bpy.ops.file.autopack_toggle()


def test_they_can_be_seen_when_their_files_are_gone(shown):
    from stereo_reproject_extension.operators.results import forget_all

    _, (holes, *_) = shown
    forget_all()
    assert np.array(holes.pixels[:]).std() > 0.0


def test_they_are_still_no_part_of_the_file_when_they_are_shown_again(shown, tmp_path):
    from stereo_reproject_extension.operators.pictures import load_picture

    scene, _ = shown
    load_picture(scene, "HOLES")
    assert len(ours()) == 3
    assert all(image.is_runtime_data for image in bpy.data.images if image.name in ours())
