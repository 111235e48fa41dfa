"""Files into their places, where the systems differ: their functions are stood in for."""

import errno
import os
import sys

import pytest

from stereo_reproject import files
from stereo_reproject.errors import BadInputError
from stereo_reproject.files import is_missing, made_in, put_in_place, remove, sync
from stereo_reproject.jobs import work_folder
from stereo_reproject.jobs.plain_paths import check_names


@pytest.fixture
def held(monkeypatch):
    """A file that a scanner holds for some attempts; returns how many are left."""
    real, left = os.replace, [3]

    def replace(source, target):
        if left[0]:
            left[0] -= 1
            raise PermissionError(errno.EACCES, "in use")
        real(source, target)

    monkeypatch.setattr(os, "replace", replace)
    monkeypatch.setattr(files, "RETRY_SECONDS", 0.001)
    return left


def test_windows_waits_for_whoever_holds_a_file(tmp_path, monkeypatch, held):
    monkeypatch.setattr(sys, "platform", "win32")
    (tmp_path / "made").write_text("new")
    (tmp_path / "place").write_text("old")
    assert put_in_place(tmp_path / "made", tmp_path / "place") == tmp_path / "place"
    assert (tmp_path / "place").read_text() == "new"
    assert held == [0]


def test_windows_does_not_wait_for_ever(tmp_path, monkeypatch, held):
    monkeypatch.setattr(sys, "platform", "win32")
    monkeypatch.setattr(files, "HELD_BY_OTHERS_SECONDS", 0.0)
    with pytest.raises(PermissionError):
        put_in_place(tmp_path / "made", tmp_path / "place")


@pytest.mark.parametrize(("platform", "waits"), [("win32", True), ("linux", False)])
def test_a_file_that_another_run_reads_is_removed_once_that_lets_go(tmp_path, monkeypatch, platform, waits):
    """Removing is refused there, too, while a file is open."""
    monkeypatch.setattr(sys, "platform", platform)
    monkeypatch.setattr(files, "RETRY_SECONDS", 0.001)
    (tmp_path / "claim").write_text("")
    unlink, refused = os.unlink, iter([True, True, False])

    def held_twice(path, **where):
        if next(refused):
            raise PermissionError(13, "held", str(path))
        unlink(path, **where)

    monkeypatch.setattr(os, "unlink", held_twice)
    if waits:
        remove(tmp_path / "claim")
    else:
        with pytest.raises(PermissionError):
            remove(tmp_path / "claim")
    assert (tmp_path / "claim").exists() is not waits


@pytest.mark.parametrize("platform", ["linux", "darwin"])
def test_elsewhere_a_file_that_may_not_be_renamed_is_said_at_once(tmp_path, monkeypatch, held, platform):
    monkeypatch.setattr(sys, "platform", platform)
    with pytest.raises(PermissionError):
        put_in_place(tmp_path / "made", tmp_path / "place")
    assert held == [2]


@pytest.mark.skipif(os.name != "posix", reason="fcntl")
@pytest.mark.parametrize("network_drive", [False, True])
def test_macos_has_a_file_on_the_disk_and_not_in_the_drives_memory(tmp_path, monkeypatch, network_drive):
    import fcntl

    asked = []

    def control(descriptor, command):
        asked.append(command)
        if network_drive:
            raise OSError(errno.ENOTSUP, "not supported")

    monkeypatch.setattr(sys, "platform", "darwin")
    monkeypatch.setattr(fcntl, "F_FULLFSYNC", 51, raising=False)
    monkeypatch.setattr(fcntl, "fcntl", control)
    monkeypatch.setattr(os, "fsync", lambda _: asked.append("fsync"))
    with (tmp_path / "file").open("w") as file:
        sync(file.fileno())
    assert asked == ([51, "fsync"] if network_drive else [51])


def test_what_may_not_be_looked_at_is_not_missing(tmp_path):
    (tmp_path / "file").touch()
    (tmp_path / "dangling").symlink_to("nowhere")
    missing = [name for name in ("file", "dangling", "none", "file/none", "x" * 300) if is_missing(tmp_path / name)]
    assert missing == ["none", "file/none"]


def test_a_work_folder_that_may_not_be_looked_at_is_left_alone(tmp_path):
    work_folder._remove_tree(tmp_path / ("x" * 300), seconds=0.0)


def test_what_macos_puts_beside_a_file_is_none_that_was_made(tmp_path):
    for name in ("0001.png", "._0001.png", "0000.png"):
        (tmp_path / name).write_text("")
    assert [path.name for path in made_in(tmp_path)] == ["0000.png", "0001.png"]


@pytest.mark.parametrize("name", ["a:b0001.png", "nul.mp4", "COM1.mp4", "what?0001.png", "0001.", "0001 ", "CON"])
def test_names_that_windows_does_not_have_are_said(tmp_path, monkeypatch, name):
    check_names(tmp_path, [name])
    monkeypatch.setattr(sys, "platform", "win32")
    check_names(tmp_path, ["console0001.png", "nul0001.png", ".0001.json.tmp", "com10.mp4"])
    with pytest.raises(BadInputError, match="Windows has no files called"):
        check_names(tmp_path, [name])
