"""Libraries that are missing, damaged or go round in circles, and pictures packed into a file and damaged there."""

from __future__ import annotations

import contextlib
import os
import random
import shutil
import signal
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

from tests.hostile import byte_damage
from tests.hostile.blends import DONE, EITHER, REFUSED
from tests.hostile.case import Case
from tests.hostile.kinds_of_files import Prepare
from tests.hostile.linked_files import DEEPER, LIBRARY, MAIN
from tests.hostile.odd_runs import GIGABYTE, OPTIONS, render_beside
from tests.hostile.program import assert_interrupted, assert_nothing_left, start_program


def cases(sets: Path) -> Iterator[Case]:
    """The cases with these sets of linked files."""
    yield from _libraries(sets)
    yield from _packed(sets / "packed")


def _case(
    sets: Path, name: str, which: str, change: Prepare, statuses: tuple[int, ...], *words: str, **how: tuple[str, ...]
) -> Case:
    def check(folder: Path) -> None:
        shutil.copytree(sets / which, folder, dirs_exist_ok=True)
        change(folder)
        render_beside(folder, statuses, *words, **how)

    return Case(f"library: {name}", check)


def _gone(name: str = LIBRARY) -> Prepare:
    return lambda folder: (folder / name).unlink()


def _instead(make: Callable[[Path], object]) -> Prepare:
    def change(folder: Path) -> None:
        (folder / LIBRARY).unlink()
        make(folder / LIBRARY)

    return change


def _renamed(old: str, new: str, within: str = MAIN) -> Prepare:
    def change(folder: Path) -> None:
        path, before = folder / within, f"//{old}".encode()
        assert before in path.read_bytes(), f"{within} does not refer to {old}"
        path.write_bytes(path.read_bytes().replace(before, f"//{new}".encode().ljust(len(before), b"\0")))

    return change


def _libraries(sets: Path) -> Iterator[Case]:
    strict = {"options": ("--strict",)}
    for which in ("linked", "nested", "circle", "scene", "override", "parts"):
        yield _case(sets, f"{which}, all there", which, lambda _: None, DONE)
        yield _case(sets, f"{which}, all there, and strict", which, lambda _: None, DONE, **strict)
    for which in ("linked", "nested", "circle", "override"):
        yield _case(sets, f"{which}, missing", which, _gone(), DONE, LIBRARY, "missing")
        yield _case(sets, f"{which}, missing, and strict", which, _gone(), REFUSED, LIBRARY, **strict)
    yield _case(sets, "nested, the deeper one missing", "nested", _gone(DEEPER), DONE, DEEPER, "missing")
    yield _case(sets, "nested, the deeper one missing, and strict", "nested", _gone(DEEPER), REFUSED, DEEPER, **strict)
    yield _case(sets, "of the active scene, missing", "scene", _gone(), EITHER)
    yield _case(sets, "of camera, mesh and world, missing", "parts", _gone(), EITHER)
    for name, make in {
        "a folder": Path.mkdir,
        "a device": lambda path: path.symlink_to("/dev/zero"),
        "a link to itself": lambda path: path.symlink_to(path.name),
        "empty": Path.touch,
        "a text": lambda path: path.write_text("no library"),
        "cut in half": lambda path: path.write_bytes((sets / "linked" / LIBRARY).read_bytes()[:200_000]),
        "of noise": lambda path: path.write_bytes(b"BLENDER-v405" + random.Random(3).randbytes(10_000)),
        "4 GB of nothing": lambda path: (path.touch(), os.truncate(path, 4 * GIGABYTE)),
        "another, without its collection": lambda path: shutil.copyfile(sets / "plain" / MAIN, path),
        "of the far future": lambda path: path.write_bytes(_of_the_future(sets / "linked" / LIBRARY)),
    }.items():
        # Whatever it is, its objects are missing, and that is said.
        yield _case(sets, f"is {name}", "linked", _instead(make), EITHER)
    yield Case("library: is a FIFO, and an interrupt ends the run", partial(_check_fifo, sets / "linked"))
    yield _case(sets, "is the file itself", "linked", _renamed(LIBRARY, MAIN), EITHER)
    yield _case(sets, "is the file itself, from its library", "nested", _renamed(DEEPER, MAIN, LIBRARY), EITHER)
    yield _case(sets, "is its own library", "nested", _renamed(DEEPER, LIBRARY, LIBRARY), EITHER)
    yield _case(sets, "has no name", "linked", _renamed(LIBRARY, ""), EITHER)
    yield _case(sets, "is its folder", "linked", _renamed(LIBRARY, "."), EITHER)
    yield _case(sets, "has a byte that is no UTF-8 in its name", "linked", _in_odd_bytes, EITHER)


def _check_fifo(linked: Path, folder: Path) -> None:
    """Blender waits for what the FIFO may say, without an end; whoever asked for the run can end it."""
    shutil.copyfile(linked / MAIN, folder / MAIN)
    os.mkfifo(folder / LIBRARY)
    with start_program("render", folder / MAIN, "--output", folder / "out", *OPTIONS) as run:
        says_nothing = run.wait_for(lambda: _writer_of(folder / LIBRARY))
        run.process.send_signal(signal.SIGINT)
        outcome = run.end()
        os.close(says_nothing)
    assert_interrupted(outcome, signal.SIGINT)
    assert_nothing_left(folder, MAIN, LIBRARY)


def _writer_of(fifo: Path) -> int | None:
    """The writing end of a FIFO that somebody reads; None as long as nobody does."""
    with contextlib.suppress(OSError):
        return os.open(fifo, os.O_WRONLY | os.O_NONBLOCK)
    return None


def _of_the_future(path: Path) -> bytes:
    content = path.read_bytes()
    first = byte_damage.blocks_of(content)[0].start
    return content[: first - 3] + b"999" + content[first:]


def _in_odd_bytes(folder: Path) -> None:
    path = folder / MAIN
    path.write_bytes(path.read_bytes().replace(b"//" + LIBRARY.encode(), b"//li\xff\xfe.blend"))


# Packed files


def _packed(packed: Path) -> Iterator[Case]:
    def damaged(change: Callable[[bytes, int, int], bytes]) -> Callable[[Path], None]:
        def check(folder: Path) -> None:
            content, picture = (packed / MAIN).read_bytes(), (packed / "noise.png").read_bytes()
            place = content.index(picture)
            (folder / MAIN).write_bytes(change(content, place, len(picture)))
            render_beside(folder, EITHER)

        return check

    def flipped(content: bytes, place: int, length: int) -> bytes:
        return byte_damage.with_flipped_bits(content, place, place + length, seed=5, count=20)

    changes: dict[str, Callable[[bytes, int, int], bytes]] = {
        "whole": lambda content, *_: content,
        "zeros": lambda content, place, length: byte_damage.replaced(content, place, bytes(length)),
        "bits flipped": flipped,
        "its header alone": lambda content, place, length: _without(content, place + 60, length - 60),
        "as large as 2^31 pixels": lambda content, place, _: _enlarged(content, place),
        "a text": lambda content, place, length: byte_damage.replaced(content, place, b"text".ljust(length)),
        "another kind of picture": lambda content, place, _: byte_damage.replaced(content, place, b"GIF89a"),
    }  # fmt: skip
    for name, change in changes.items():
        yield Case(f"packed picture: {name}", damaged(change))


def _without(content: bytes, place: int, length: int) -> bytes:
    return byte_damage.replaced(content, place, bytes(length))


def _enlarged(content: bytes, place: int) -> bytes:
    """Width and height in a PNG's header."""
    return byte_damage.replaced(content, place + 16, b"\x7f\xff\xff\xff" * 2)
