"""What stands where the result belongs: files, folders, links, pipes and drives that take nothing."""

from __future__ import annotations

import functools
import os
import socket
import stat
from collections.abc import Callable, Iterator
from pathlib import Path

from stereo_reproject.sequence.journal_folder import JOURNAL
from tests.hostile.case import Case
from tests.hostile.program import (
    DEMO,
    PAIR,
    SMALLEST,
    assert_bad_input,
    assert_done,
    assert_nothing_left,
    assert_one_line_or_done,
    names_in,
    run_program,
)
from tests.hostile.rows._names import ANIMATION, COMMANDS
from tests.hostile.rows._privileges import mount, remount, without_powers

OLD = b"of somebody else"


def _file(path: Path) -> None:
    path.write_bytes(OLD)


def _folder(path: Path) -> None:
    path.mkdir()


def _full_folder(path: Path) -> None:
    path.mkdir()
    (path / "mine").write_bytes(OLD)


def _link(path: Path) -> None:
    other = path.parent.parent / "other"
    other.write_bytes(OLD)
    path.symlink_to(other)


def _hard_link(path: Path) -> None:
    other = path.parent.parent / "other"
    other.write_bytes(OLD)
    path.hardlink_to(other)


def _dangling(path: Path) -> None:
    path.symlink_to(path.parent.parent / "nowhere")


def _loop(path: Path) -> None:
    path.symlink_to(path.name)


def _device_link(path: Path) -> None:
    path.symlink_to("/dev/full")


def _endless_link(path: Path) -> None:
    path.symlink_to("/dev/zero")


def _folder_link(path: Path) -> None:
    other = path.parent.parent / "elsewhere"
    other.mkdir(exist_ok=True)
    (other / "mine").write_bytes(OLD)
    path.symlink_to(other)


def _pipe(path: Path) -> None:
    os.mkfifo(path)


def _socket(path: Path) -> None:
    # A socket's path has a length of its own.
    os.chdir(path.parent)
    with socket.socket(socket.AF_UNIX) as listener:
        listener.bind(path.name)
    os.chdir("/")


def _device(path: Path) -> None:
    os.mknod(path, stat.S_IFCHR | 0o666, os.makedev(1, 5))


def _unreadable(path: Path) -> None:
    path.write_bytes(OLD)
    path.chmod(0)


def _empty(path: Path) -> None:
    path.touch()


def _large(path: Path) -> None:
    with path.open("wb") as file:
        file.truncate(1 << 40)


KINDS: dict[str, Callable[[Path], None]] = {
    "a file": _file,
    "an empty file": _empty,
    "a sparse file of a terabyte": _large,
    "a folder": _folder,
    "a folder with something in it": _full_folder,
    "a link": _link,
    "a hard link": _hard_link,
    "a dangling link": _dangling,
    "a link to itself": _loop,
    "a link to /dev/full": _device_link,
    "a link to /dev/zero": _endless_link,
    "a link to a folder": _folder_link,
    "a pipe": _pipe,
    "a socket": _socket,
    "a device": _device,
    "a file without rights": _unreadable,
}
FOLDERS = ("a folder", "a folder with something in it", "a link to a folder")


def _others_are_as_they_were(folder: Path) -> None:
    """What links pointed at is not written through them."""
    for name in ("other", "elsewhere/mine", "out/mine"):
        path = folder / name
        if path.exists():
            assert path.read_bytes() == OLD, f"{path} was written through a link"
    assert not (folder / "nowhere").exists(), "a dangling link was followed"


def _run(folder: Path, command: str, *options: str | Path) -> tuple[int, set[str]]:
    outcome = run_program(command, DEMO, "--output", folder / "out", *COMMANDS[command][0], *options)
    assert_one_line_or_done(outcome)
    _others_are_as_they_were(folder)
    return outcome.status, names_in(folder)


def _pair_over(name: str, kind: str, folder: Path) -> None:
    """A file of an earlier pair is replaced whatever it is; a folder is not, and then nothing is changed."""
    output = folder / "out"
    output.mkdir()
    KINDS[kind](output / name)
    before = names_in(folder)
    status, after = _run(folder, "render")
    if kind in FOLDERS:
        assert status == 2, f"{kind} in place of {name} was taken away"
        assert after == before, f"changed: {sorted(after ^ before)}"
        return
    assert status == 0, f"{kind} in place of {name} stopped it"
    made = output / name
    assert stat.S_ISREG(made.lstat().st_mode), f"{name} is still {kind}"
    assert_nothing_left(folder, *(before - {f"out/{name}"}), *(f"out/{file}" for file in PAIR))


def _frame_over(name: str, kind: str, how: str, folder: Path) -> None:
    """By --overwrite a frame's file is replaced, without it it stays; and whatever is a folder stays."""
    output = folder / "out"
    (output / name).parent.mkdir(parents=True)
    KINDS[kind](output / name)
    before = names_in(folder)
    status, after = _run(folder, "animate", *([how] if how else []))
    assert before <= after, f"gone: {sorted(before - after)}"
    if status == 0:
        assert_nothing_left(folder, *before, "out", *(f"out/{file}" for file in ANIMATION))
        assert stat.S_ISREG((output / "0001_L.png").lstat().st_mode), f"the frame is {kind}"
    else:
        journal = [entry for entry in after - before if Path(entry).parts[:2] != ("out", JOURNAL)]
        assert not [entry for entry in journal if entry.startswith("out/.")], f"half-made: {journal}"


def _output_is(command: str, kind: str, folder: Path) -> None:
    """An output folder that is none is said to be none, and stays; a link to one is as good as one."""
    out = folder / "out"
    KINDS_OF_OUTPUT[kind](out)
    before = names_in(folder)
    status, after = _run(folder, command)
    if kind in ("a link to a folder", "a folder", "a folder with something in it"):
        assert status == 0, f"{kind} as the output stopped it"
        assert before <= after, f"gone: {sorted(before - after)}"
    else:
        assert status == 2, f"{kind} as the output was taken"
        assert after == before, f"changed: {sorted(after ^ before)}"


def _link_in(path: Path) -> None:
    other = path.parent / "other"
    other.write_bytes(OLD)
    path.symlink_to(other)


def _hard_link_in(path: Path) -> None:
    other = path.parent / "other"
    other.write_bytes(OLD)
    path.hardlink_to(other)


def _dangling_in(path: Path) -> None:
    path.symlink_to(path.parent / "nowhere")


def _folder_link_in(path: Path) -> None:
    other = path.parent / "elsewhere"
    other.mkdir()
    (other / "mine").write_bytes(OLD)
    path.symlink_to(other)


KINDS_OF_OUTPUT = {
    **KINDS,
    "a link": _link_in,
    "a hard link": _hard_link_in,
    "a dangling link": _dangling_in,
    "a link to a folder": _folder_link_in,
}


def _special(command: str, output: str, folder: Path) -> None:
    """Where the system keeps what is no drive, nothing can be written: one line."""
    outcome = run_program(command, DEMO, "--output", output, *COMMANDS[command][0], cwd=folder)
    assert_bad_input(outcome)
    assert_nothing_left(folder)


def _rights(command: str, mode: int, folder: Path) -> None:
    """A folder that may not be written is refused, and is as it was."""
    output = folder / "out"
    output.mkdir()
    output.chmod(mode)
    outcome = run_program(command, DEMO, "--output", output, *COMMANDS[command][0], prepare=without_powers)
    if mode & 0o300 == 0o300:
        # What may be written and searched will do: nothing has to be listed.
        assert_done(outcome)
        return
    assert_bad_input(outcome)
    assert_nothing_left(folder, "out")
    assert stat.S_IMODE(output.stat().st_mode) == mode, "its rights were changed"


def _parent_rights(command: str, mode: int, folder: Path) -> None:
    parent = folder / "parent"
    parent.mkdir()
    parent.chmod(mode)
    outcome = run_program(command, DEMO, "--output", parent / "out", *COMMANDS[command][0], prepare=without_powers)
    assert_bad_input(outcome)
    assert_nothing_left(folder, "parent")


def _protected_file(command: str, name: str, folder: Path) -> None:
    """A file that may not be written is replaced all the same, for its folder may be; but not a frame, which its owner
    may have protected."""
    output = folder / "out"
    output.mkdir()
    (output / name).write_bytes(OLD)
    (output / name).chmod(0o444)
    options = ("--overwrite",) if command == "animate" else ()
    outcome = run_program(command, DEMO, "--output", output, *COMMANDS[command][0], *options, prepare=without_powers)
    if name.startswith("0001"):
        assert_bad_input(outcome, name, "cannot be written")
        assert (output / name).read_bytes() == OLD
        return
    assert_done(outcome)
    assert (output / name).read_bytes() != OLD, f"{name} was not replaced"


def _drive(command: str, options: str, works: bool | None, folder: Path) -> None:
    """A drive with too little room, or none for names, is said in a line, and nothing half-made is left on it."""
    drive = mount(folder / "drive", options)
    outcome = run_program(command, DEMO, "--output", drive / "out", *COMMANDS[command][0])
    if works:
        assert_done(outcome)
        return
    assert_one_line_or_done(outcome)
    if works is False:
        assert outcome.status != 0, "there was no room, and it is done"
    files = COMMANDS[command][1] if outcome.status == 0 else ()
    there = {name for name in names_in(drive) if Path(name).parts[:2] != ("out", JOURNAL)}
    odd = there - {"out", *(f"out/{name}" for name in files)} - {"out/0001_L.png", "out/0001_R.png"}
    assert not odd, f"left on the drive: {sorted(odd)}"


def _read_only(command: str, there: bool, folder: Path) -> None:
    drive = mount(folder / "drive")
    if there:
        (drive / "out").mkdir()
    remount(drive, "ro")
    assert_bad_input(run_program(command, DEMO, "--output", drive / "out", *COMMANDS[command][0]))


def _filled(command: str, left: int, folder: Path) -> None:
    """A drive that others have filled."""
    drive = mount(folder / "drive", "size=4m")
    with (drive / "others").open("wb", buffering=0) as file:
        file.write(bytes((4 << 20) - left))
    outcome = run_program(command, DEMO, "--output", drive / "out", *COMMANDS[command][0])
    assert_one_line_or_done(outcome)
    if left == 0:
        assert outcome.status == 2, f"a full drive: {outcome}"
        assert b"full" in outcome.stderr, f"it does not say that the drive is full: {outcome}"
    assert (drive / "others").stat().st_size == (4 << 20) - left


def _unfollowed_scene(kind: str, folder: Path) -> None:
    """A scene that is no file is refused at once."""
    place = folder / "sub"
    place.mkdir()
    KINDS[kind](place / "scene.blend")
    outcome = run_program("render", place / "scene.blend", "--output", folder / "out", *SMALLEST, timeout=30)
    assert_bad_input(outcome)


NO_DRIVES = (
    "/proc",
    "/proc/self/out",
    "/sys/out",
    "/dev/null",
    "/dev/null/out",
    "/dev/full",
    "/dev/fd/0",
    "/proc/self/mem",
)

DRIVES = (
    ("size=4k", False),
    ("size=16k", False),
    ("size=64k", None),
    ("size=256k", None),
    ("size=1m", None),
    ("nr_inodes=2", False),
    ("nr_inodes=5", False),
    ("nr_inodes=8", False),
    ("nr_inodes=12", None),
    ("nr_inodes=20", None),
    ("noexec,nosuid,nodev", True),
    ("sync,noatime", True),
    ("mode=0300", True),
)
"""Options of a drive in memory, and whether a result has room on it; None where that is a question of bytes."""


def _in_place() -> Iterator[Case]:
    for number, name in enumerate(PAIR):
        for kind in list(KINDS)[number % 3 :: 3]:
            yield Case(f"{kind} in place of {name}", functools.partial(_pair_over, name, kind))
    for number, kind in enumerate(KINDS):
        for how in ("--overwrite", ""):
            check = functools.partial(_frame_over, "0001_L.png", kind, how)
            yield Case(f"{kind} in a frame's place, {how or 'and nothing is said'}", check)
        name = ("animation.json", "animation.png", "animation.svg")[number % 3]
        yield Case(f"{kind} in place of {name}", functools.partial(_frame_over, name, kind, "--resume"))
        yield Case(f"{kind} in place of the journal", functools.partial(_frame_over, JOURNAL, kind, "--resume"))
        for command in COMMANDS if number % 2 else ("render",):
            yield Case(f"{command} into {kind}", functools.partial(_output_is, command, kind))
        if kind != "a file without rights":
            yield Case(f"{kind} as the scene", functools.partial(_unfollowed_scene, kind))


def _places() -> Iterator[Case]:
    for output in NO_DRIVES:
        for command in COMMANDS if "null" in output else ("render",):
            yield Case(f"{command} into {output}", functools.partial(_special, command, output))
    for command in COMMANDS:
        for mode in (0o000, 0o100, 0o200, 0o300, 0o400, 0o500, 0o1500, 0o700, 0o1777, 0o3775):
            yield Case(f"{command} into a folder of mode {mode:o}", functools.partial(_rights, command, mode))
        for mode in (0o000, 0o400, 0o500, 0o600):
            yield Case(f"{command} below a folder of mode {mode:o}", functools.partial(_parent_rights, command, mode))
    for name in ("left.exr", "report.json", "0001_L.png", "animation.json"):
        command = "render" if name in PAIR else "animate"
        yield Case(f"{name} may not be written", functools.partial(_protected_file, command, name))


def _drives() -> Iterator[Case]:
    for command in COMMANDS:
        for options, works in DRIVES:
            yield Case(f"{command} to a drive with {options}", functools.partial(_drive, command, options, works))
        for there in (False, True):
            yield Case(f"{command} to a read-only drive, {there}", functools.partial(_read_only, command, there))
        for left in (0, 4096, 65536):
            yield Case(f"{command} to a drive with {left} bytes left", functools.partial(_filled, command, left))


def cases() -> Iterator[Case]:
    yield from _in_place()
    yield from _places()
    yield from _drives()
