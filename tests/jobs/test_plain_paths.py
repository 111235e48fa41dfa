"""Folders that Blender would read otherwise, and the paths that stand in for them."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from stereo_reproject.errors import BadInputError
from stereo_reproject.jobs import plain_paths
from stereo_reproject.jobs.plain_paths import MAX_FOLDER_LENGTH, check_names, misread, plain_blend, plain_path
from stereo_reproject.jobs.work_folder import work_folder

BACKSLASH = "back\\slash"
NO_UTF8 = os.fsdecode(b"caf\xe9")

pytestmark = pytest.mark.skipif(not Path("/proc/self/fd").is_dir(), reason="paths as Linux has them")


@pytest.mark.parametrize("name", ["a b", "{x}", "#", "-", "a\nb", "%s", "end. ", "é", "a" * 200])
def test_most_names_are_read_as_they_stand(tmp_path, name):
    assert misread(tmp_path / name) is None
    with plain_path(tmp_path / name) as plain:
        assert plain == tmp_path / name


def long_folder(folder):
    while len(os.fsencode(folder)) <= MAX_FOLDER_LENGTH:
        folder /= "d" * 200
    return folder


@pytest.mark.parametrize("odd", [lambda f: f / BACKSLASH, lambda f: f / NO_UTF8, long_folder])
def test_another_path_leads_into_the_folder_for_all_processes_and_is_gone_then(tmp_path, odd):
    folder = odd(tmp_path)
    folder.mkdir(parents=True)
    with plain_path(folder) as plain:
        assert misread(plain) is None
        write = f"open({str(plain / 'file')!r}, 'w').write('here')"
        subprocess.run([sys.executable, "-c", write], check=True)
        (plain / "file").replace(folder / "moved")
    assert (folder / "moved").read_text() == "here"
    assert not (plain / "moved").exists()


def test_a_blend_keeps_what_lies_above_it(tmp_path):
    folder = tmp_path / BACKSLASH / "deeper"
    folder.mkdir(parents=True)
    (tmp_path / BACKSLASH / "picture.png").write_text("above")
    with plain_blend(folder / "room.blend") as blend:
        assert misread(blend) is None
        # As Blender resolves //../ without looking.
        assert Path(os.path.normpath(blend.parent / "../picture.png")).read_text() == "above"
    with plain_blend(tmp_path / "room.blend") as blend:
        assert blend == tmp_path / "room.blend"


def test_a_work_folder_is_plain_and_goes(tmp_path):
    with work_folder(tmp_path / BACKSLASH, ()) as work:
        assert misread(work) is None
        (work / "out" / "file").write_text("")
        assert (work / os.pardir).samefile(tmp_path / BACKSLASH)
    assert list(tmp_path.iterdir()) == []


def test_without_another_path_it_is_one_line(tmp_path, monkeypatch):
    monkeypatch.setattr(plain_paths, "STAND_INS", str(tmp_path / "no-proc") + os.sep)
    (tmp_path / BACKSLASH).mkdir()
    with (
        pytest.raises(BadInputError, match="takes the backslash in it for a separator; name another folder"),
        plain_path(tmp_path / BACKSLASH),
    ):
        pass


def test_names_that_do_not_fit_are_said_before_anything_is_made(tmp_path):
    folder = tmp_path / "to be made"
    check_names(folder, ["n" * 255])
    with pytest.raises(BadInputError, match=r"a name of 256 bytes is longer than the 255 that fit .*shorten the name"):
        check_names(folder, ["short", "\u00e9" * 128])
    deep = tmp_path.joinpath(*["d" * 200] * 20)
    with pytest.raises(BadInputError, match=r"a path of \d+ bytes is longer than the 4095 that fit: shorten it"):
        check_names(deep, ["n" * 200])
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("says", [0, -1])
def test_a_drive_that_does_not_say_how_long_names_may_be_takes_the_usual_ones(tmp_path, monkeypatch, says):
    monkeypatch.setattr(os, "pathconf", lambda *_: says, raising=False)
    check_names(tmp_path, ["n" * 255])
    with pytest.raises(BadInputError, match="longer than the 255 that fit"):
        check_names(tmp_path, ["n" * 256])


def test_a_blend_whose_own_name_is_no_utf8_is_one_line(tmp_path):
    expected = r"\\xff.blend cannot be opened: .*not UTF-8; rename it"
    with pytest.raises(BadInputError, match=expected), plain_blend(tmp_path / "\udcff.blend"):
        pass
