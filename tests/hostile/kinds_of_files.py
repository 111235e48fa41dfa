"""Other kinds of files than regular ones in a .blend's place, and files that change while they are read."""

from __future__ import annotations

import functools
import os
import shutil
import socket
from collections.abc import Callable, Iterator
from pathlib import Path

from tests.hostile.blends import DONE, EITHER, REFUSED
from tests.hostile.case import Case
from tests.hostile.linked_files import MAIN
from tests.hostile.odd_runs import GIGABYTE, MEMORY, OPTIONS, assert_ended, assert_pair_or_nothing, render_beside
from tests.hostile.program import Run, run_program, start_program
from tests.hostile.rows._privileges import without_powers

UNREADABLE = "cannot be read"

Prepare = Callable[[Path], object]
"""What is done to a case's folder before it begins."""

Change = Callable[[Path, Run, bytes], None]
"""What becomes of a file while a run is at work on it; the bytes are those that it had."""


def cases(plain: Path) -> Iterator[Case]:
    """The cases with this .blend."""
    yield from _of_kinds(plain)
    yield from _under_way(plain.read_bytes())


def _of_kinds(plain: Path) -> Iterator[Case]:
    def beside(folder: Path) -> Path:
        return shutil.copyfile(plain, folder / "real.blend")

    def sparse(path: Path, length: int) -> None:
        with path.open("ab") as file:
            file.truncate(length)

    def loop(folder: Path) -> None:
        (folder / MAIN).symlink_to(folder / "other")
        (folder / "other").symlink_to(folder / MAIN)

    def bound(folder: Path) -> None:
        with socket.socket(socket.AF_UNIX) as one:
            # A path of a socket is short.
            os.chdir(folder)
            one.bind(MAIN)

    def locked(folder: Path) -> None:
        (folder / MAIN).write_bytes((plain).read_bytes())
        (folder / MAIN).chmod(0o400)

    kinds: list[tuple[str, Prepare, tuple[int, ...], tuple[str, ...]]] = [
        ("nothing there", lambda _: None, REFUSED, ("does not exist",)),
        ("a folder", lambda folder: (folder / MAIN).mkdir(), REFUSED, ("folder",)),
        ("a FIFO", lambda folder: os.mkfifo(folder / MAIN), REFUSED, ("regular",)),
        ("a socket", bound, REFUSED, ("regular",)),
        ("a link to nowhere", lambda folder: (folder / MAIN).symlink_to("nowhere"), REFUSED, ("does not exist",)),
        ("a link to itself", lambda folder: (folder / MAIN).symlink_to(MAIN), REFUSED, (UNREADABLE,)),
        ("two links in a circle", loop, REFUSED, (UNREADABLE,)),
        ("a link to a folder", lambda folder: (folder / MAIN).symlink_to("/usr"), REFUSED, ("folder",)),
        *(
            (f"a link to {device}", functools.partial(_link_to, device), REFUSED, ("regular",))
            for device in ("/dev/zero", "/dev/null", "/dev/full", "/dev/random", "/dev/tty")
        ),
        ("a link to /proc/self/mem", functools.partial(_link_to, "/proc/self/mem"), REFUSED, ()),
        ("a link to /proc/kmsg", functools.partial(_link_to, "/proc/cmdline"), REFUSED, ()),
        ("a link to a file", lambda folder: (folder / MAIN).symlink_to(beside(folder)), DONE, ()),
        ("a hard link", lambda folder: (folder / MAIN).hardlink_to(beside(folder)), DONE, ()),
        ("4 GB of nothing", lambda folder: sparse(folder / MAIN, 4 * GIGABYTE), REFUSED, ()),
        (
            "4 GB of nothing behind a whole file",
            lambda folder: (beside(folder).rename(folder / MAIN), sparse(folder / MAIN, 4 * GIGABYTE))[0] and None,
            EITHER,
            (),
        ),
        ("that only its owner reads", locked, DONE, ()),
    ]
    for name, prepare, statuses, words in kinds:
        yield Case(f"kind of file: {name}", functools.partial(_check_kind, prepare, statuses, words))
    yield Case("kind of file: that nobody may read", functools.partial(_check_forbidden, plain))
    yield Case("kind of file: in a folder that nobody may enter", functools.partial(_check_closed, plain))
    yield Case("kind of file: by a path with . and .. in it", functools.partial(_check_roundabout, plain))
    yield Case("kind of file: by a path from here", functools.partial(_check_relative, plain))


def _link_to(device: str, folder: Path) -> None:
    (folder / MAIN).symlink_to(device)


def _check_kind(prepare: Prepare, statuses: tuple[int, ...], words: tuple[str, ...], folder: Path) -> None:
    prepare(folder)
    render_beside(folder, statuses, *words)


def _check_forbidden(path: Path, folder: Path) -> None:
    shutil.copyfile(path, folder / MAIN)
    (folder / MAIN).chmod(0)
    with start_program("render", folder / MAIN, "--output", folder / "out", *OPTIONS, prepare=without_powers) as run:
        assert_ended(run.end(), REFUSED, UNREADABLE)


def _check_closed(path: Path, folder: Path) -> None:
    (folder / "closed").mkdir()
    shutil.copyfile(path, folder / "closed" / MAIN)
    (folder / "closed").chmod(0)
    arguments = ("render", folder / "closed" / MAIN, "--output", folder / "out", *OPTIONS)
    with start_program(*arguments, prepare=without_powers) as run:
        assert_ended(run.end(), REFUSED, UNREADABLE)


def _check_roundabout(path: Path, folder: Path) -> None:
    (folder / "a").mkdir()
    shutil.copyfile(path, folder / MAIN)
    render_beside(folder, DONE, main=f"./a/.././/a/../{MAIN}")


def _check_relative(path: Path, folder: Path) -> None:
    shutil.copyfile(path, folder / MAIN)
    outcome = run_program("render", MAIN, "--output", "out", *OPTIONS, cwd=folder)
    assert_ended(outcome, DONE)
    assert_pair_or_nothing(outcome, folder, MAIN)


# Changed under way


def _vanish(path: Path, run: Run, content: bytes) -> None:
    path.unlink(missing_ok=True)


def _empty(path: Path, run: Run, content: bytes) -> None:
    path.write_bytes(b"")


def _replace(path: Path, run: Run, content: bytes) -> None:
    other = path.with_name("other")
    other.write_bytes(content[: len(content) // 2])
    other.replace(path)


def _become_fifo(path: Path, run: Run, content: bytes) -> None:
    path.unlink(missing_ok=True)
    os.mkfifo(path)


def _grow(path: Path, run: Run, content: bytes) -> None:
    with path.open("ab") as file:
        for _ in range(2000):
            if run.process.poll() is not None:
                return
            file.write(bytes(1 << 16))


def _flicker(path: Path, run: Run, content: bytes) -> None:
    while run.process.poll() is None:
        path.write_bytes(content[: len(content) // 2])
        path.write_bytes(content)


def _under_way(plain: bytes) -> Iterator[Case]:
    changes = {"removed": _vanish, "emptied": _empty, "replaced by half of it": _replace, "made a FIFO": _become_fifo}
    for what, change in changes.items():
        for moment in ("at once", "when Blender starts", "when Blender is there"):
            yield Case(f"{what}, {moment}", functools.partial(_check_changed, plain, change, moment))
    for what, change in {"growing": _grow, "written again and again": _flicker}.items():
        yield Case(what, functools.partial(_check_changed, plain, change, "at once"))


def _check_changed(plain: bytes, change: Change, moment: str, folder: Path) -> None:
    path = folder / MAIN
    path.write_bytes(plain)
    with start_program("render", path, "--output", folder / "out", *OPTIONS, limits=MEMORY) as run:
        if moment != "at once":
            run.wait_for(lambda: run.children("worker") or run.process.poll() is not None)
        if moment == "when Blender is there":
            run.wait_for(lambda: list((folder / "out").glob(".stereo_reproject-*/tmp")))
        change(path, run, plain)
        outcome = run.end()
    assert_ended(outcome, EITHER)
    beside = {name for name in (MAIN, "other") if os.path.lexists(folder / name)}
    assert_pair_or_nothing(outcome, folder, *beside)
