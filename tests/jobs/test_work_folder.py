"""A run's private folder beside those of others, and a pair's files on the disk when they are in their places."""

import json
import os
import shutil
import stat
import subprocess
import sys
import time
from pathlib import Path

import pytest

from stereo_reproject.files import CANNOT_FLUSH, flush_folder
from stereo_reproject.jobs import work_folder as module
from stereo_reproject.jobs.work_folder import (
    WORK_PREFIX,
    publish,
    remove_abandoned,
    views_files,
    views_superseded_by,
    work_folder,
)
from stereo_reproject.settings.views import view_names
from tests.warp.strange import STRANGE

posix = pytest.mark.skipif(os.name != "posix", reason="owners and named pipes as POSIX has them")


@pytest.fixture(scope="module")
def dead_pid():
    finished = subprocess.Popen([sys.executable, "-c", ""])
    finished.wait()
    return finished.pid


def left_over(output, name, *, age=0.0):
    folder = output / f"{WORK_PREFIX}{name}"
    (folder / "out").mkdir(parents=True)
    os.utime(folder, (time.time() - age,) * 2)
    return folder


@posix
@pytest.mark.parametrize("make", STRANGE)
def test_whatever_lies_in_the_place_of_a_process_number_is_not_read(tmp_path, dead_pid, make):
    """The names of the folders tell of their processes, or else their age."""
    dead, new, old = (left_over(tmp_path, name) for name in (f"{dead_pid}-{module._machine_digest()}-x", "new", "old"))
    for folder in (dead, new, old):
        make(folder / "pid")
    os.utime(old, (time.time() - 3600.0,) * 2)
    with work_folder(tmp_path, ()):
        assert [folder.exists() for folder in (dead, new, old)] == [False, True, False]


@posix
def test_folders_of_other_users_are_left_alone(tmp_path, dead_pid):
    folder = left_over(tmp_path, f"{dead_pid}-{module._machine_digest()}-x")
    remove_abandoned(tmp_path, owner=os.geteuid() + 1)
    assert folder.exists()
    remove_abandoned(tmp_path)
    assert not folder.exists()


def test_a_folder_that_cannot_be_removed_costs_no_time(tmp_path, dead_pid, monkeypatch):
    left_over(tmp_path, f"{dead_pid}-{module._machine_digest()}-x")
    monkeypatch.setattr(shutil, "rmtree", lambda *_, **__: None)
    waited = []
    monkeypatch.setattr(module.time, "sleep", waited.append)
    remove_abandoned(tmp_path)
    assert waited == []


@posix
def test_a_pair_is_on_the_disk_its_report_last(tmp_path, monkeypatch):
    """As after a power cut: names that were given before a folder was flushed are there, others may not be."""
    work, output = tmp_path / "work", tmp_path / "pair"
    for folder in (work / "out", work / "old", output):
        folder.mkdir(parents=True)
    files = ("left.exr", "report.json")
    for name in files:
        (work / "out" / name).write_text("new")
        (output / name).write_text("old")
    steps = []
    flush, replace = os.fsync, Path.replace

    def watched_flush(descriptor):
        look = os.fstat(descriptor)
        steps.append("folder" if stat.S_ISDIR(look.st_mode) else "file")
        flush(descriptor)

    def watched_replace(self, target):
        steps.append(f"{self.parent.name}/{self.name}")
        return replace(self, target)

    monkeypatch.setattr(os, "fsync", watched_flush)
    monkeypatch.setattr(Path, "replace", watched_replace)
    publish(work, output, files, between_steps=lambda: None)
    moved_out = ["pair/report.json", "pair/left.exr"]
    assert steps == ["file", "file", *moved_out, "out/left.exr", "folder", "out/report.json", "folder"]


@posix
@pytest.mark.parametrize("number", [1, 2])
def test_a_folder_that_cannot_be_flushed_for_want_of_room_takes_no_half_pair(tmp_path, monkeypatch, number):
    work, output = tmp_path / "work", tmp_path / "pair"
    for folder in (work / "out", work / "old", output):
        folder.mkdir(parents=True)
    for name in ("left.exr", "report.json"):
        (work / "out" / name).write_text("new")
    (output / "left.exr").write_text("old")
    flush, folders = os.fsync, []

    def full(descriptor):
        if stat.S_ISDIR(os.fstat(descriptor).st_mode):
            folders.append(descriptor)
            if len(folders) == number:
                raise OSError(28, "No space left on device")
        flush(descriptor)

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(module.BadInputError, match="the disk is full"):
        publish(work, output, ("left.exr", "report.json"), between_steps=lambda: None)
    assert [(path.name, path.read_text()) for path in output.iterdir()] == [("left.exr", "old")]


@posix
@pytest.mark.parametrize("number", sorted(CANNOT_FLUSH))
def test_a_drive_that_flushes_no_folders_is_no_failure(tmp_path, monkeypatch, number):
    def cannot(_descriptor):
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(os, "fsync", cannot)
    flush_folder(tmp_path)


class TornError(Exception):
    """A signal that comes when a slow drive has done what it was asked for."""


@pytest.mark.parametrize("step", range(4))
def test_a_publish_that_is_torn_after_any_move_is_undone(tmp_path, monkeypatch, step):
    names = ("left.exr", "report.json")
    work, output = tmp_path / "work", tmp_path / "out"
    for folder in (work / "out", work / "old", output):
        folder.mkdir(parents=True)
    for name in names:
        (work / "out" / name).write_text("new")
        (output / name).write_text("old")
    left = iter(range(step, -1, -1))

    def torn(source, destination):
        source.replace(destination)
        if next(left, None) == 0:
            raise TornError

    monkeypatch.setattr(module, "put_in_place", torn)
    with pytest.raises(TornError):
        publish(work, output, names, between_steps=lambda: None)
    assert {path.name: path.read_text() for path in output.iterdir()} == dict.fromkeys(names, "old")


@pytest.mark.parametrize("pid", [0, -1, 1 << 32, 10**30])
def test_no_process_has_such_a_number(pid):
    assert not module.is_running(pid)


def rendered_views(work, output, count):
    """Views that are rendered, and an output folder."""
    files = views_files(view_names(count))
    for folder in (work / "out" / "views", work / "old", output):
        folder.mkdir(parents=True, exist_ok=True)
    for name in files:
        (work / "out" / name).write_text("new")
    return files


def texts_in(folder):
    return {path.relative_to(folder).as_posix(): path.read_text() for path in folder.rglob("*") if path.is_file()}


def test_views_have_a_folder_of_their_own(tmp_path):
    files = rendered_views(tmp_path / "work", tmp_path / "out", 3)
    publish(tmp_path / "work", tmp_path / "out", files, between_steps=lambda: None)
    views = [f"views/view_{k:02d}.exr" for k in range(3)]
    assert texts_in(tmp_path / "out") == dict.fromkeys([*views, "contact.png", "sweep.mp4", "report.json"], "new")


def test_views_and_quilts_of_an_earlier_run_do_not_stand_beside_new_ones(tmp_path):
    work, output = tmp_path / "work", tmp_path / "out"
    old = (
        "views/view_01.exr",
        "views/view_07.exr",
        "views/far right.exr",
        "views.exr",
        "holes/view_07.png",
        "quilt_qs8x6a0.75.png",
        "quilt_qs8x6a0.75.exr",
    )
    mine = ("views/mine.exr", "my_quilt_qs8x6a0.75.png", "views/view_07.exr.txt")
    for folder in ("views", "holes"):
        (output / folder).mkdir(parents=True)
    for name in (*old, *mine):
        (output / name).write_text("old")
    files = rendered_views(work, output, 2)
    assert views_superseded_by(output, files) == (), "no report says that they are ours"
    told = [*old, *mine[1:], "../elsewhere.exr", "views/../elsewhere.exr", 3]
    (output / "report.json").write_text(json.dumps({"files": told}))
    superseded = views_superseded_by(output, files)
    assert sorted(superseded) == sorted(old[1:])
    publish(work, output, files, superseded=superseded, between_steps=lambda: None)
    assert {name for name, text in texts_in(output).items() if text == "old"} == set(mine)
    assert set(files) <= set(texts_in(output))


@pytest.mark.parametrize("step", range(7))
def test_a_torn_publish_of_views_leaves_all_as_it_was(tmp_path, step):
    work, output = tmp_path / "work", tmp_path / "out"
    files = rendered_views(work, output, 2)
    report = json.dumps({"files": ["quilt_qs2x1a1.png"]})
    (output / "report.json").write_text(report)
    (output / "quilt_qs2x1a1.png").write_text("old")
    left = iter(range(step, -1, -1))

    def torn():
        if next(left, None) == 0:
            raise TornError

    with pytest.raises(TornError):
        publish(work, output, files, superseded=views_superseded_by(output, files), between_steps=torn)
    assert texts_in(output) == {"report.json": report, "quilt_qs2x1a1.png": "old"}
    assert not (output / "views").exists()


def test_the_folder_of_an_earlier_run_s_views_goes_with_them(tmp_path):
    work, output = tmp_path / "work", tmp_path / "out"
    (output / "views").mkdir(parents=True)
    old = ("views/view_00.exr", "views/view_01.exr")
    for name in old:
        (output / name).write_text("old")
    for folder in ("out", "old"):
        (work / folder).mkdir(parents=True)
    (work / "out" / "report.json").write_text("new")
    publish(work, output, ("report.json",), superseded=old, between_steps=lambda: None)
    assert [path.name for path in output.iterdir()] == ["report.json"]


def test_a_file_where_the_folder_of_views_belongs_is_said_before_anything_is_rendered(tmp_path):
    (tmp_path / "views").write_text("mine")
    files = views_files(view_names(2))
    with pytest.raises(module.BadInputError, match="views is not a folder"), work_folder(tmp_path, files):
        raise AssertionError("it was rendered")
    assert (tmp_path / "views").read_text() == "mine"
