"""Faults under way: a drive that fills or fails, folders and files that go, processes that stop. Then the fault is
taken away, and the run resumed and compared with an uninterrupted one."""

from __future__ import annotations

import contextlib
import functools
import os
import resource
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

from stereo_reproject.sequence.journal_folder import JOURNAL
from tests.hostile.case import Case
from tests.hostile.program import (
    DEMO,
    PAIR,
    SMALLEST,
    Outcome,
    Run,
    assert_done,
    assert_interrupted,
    assert_nothing_left,
    assert_one_line_or_done,
    run_program,
    start_program,
)
from tests.hostile.rows._animations import (
    FRAMES,
    OPTIONS,
    claimed,
    recorded,
    reference,
    resume,
    scene,
    start,
    work_folders,
)
from tests.hostile.rows._privileges import mount, remount, without_powers

TITLE = "faults under way"
SEEN_BEFORE = 19

Fault = Callable[[Run, Path], None]
"""Does something to a run and its output folder."""


def _under_way(fault: Fault, cure: Callable[[Path], None], words: tuple[str, ...], folder: Path) -> None:
    """A fault after two frames ends the run with one line, unless it does without; cured, it goes on."""
    output = folder / "out"
    reference(folder)
    with start(folder, prepare=without_powers) as run:
        run.wait_for(lambda: recorded(output, 2))
        fault(run, output)
        outcome = run.end()
    _assert_said(outcome, words)
    cure(output)
    resume(folder)


def _assert_said(outcome: Outcome, words: tuple[str, ...]) -> None:
    assert_one_line_or_done(outcome)
    if outcome.status:
        text = outcome.stderr.decode("utf-8", "backslashreplace")
        assert not words or any(word in text for word in words), f"it says none of {words}: {outcome}"


def _nothing(_output: Path) -> None:
    pass


def _remove(_run: Run, output: Path) -> None:
    # What is being written meanwhile may keep it from being empty.
    while output.exists():
        shutil.rmtree(output, ignore_errors=True)


def _move(_run: Run, output: Path) -> None:
    output.rename(output.with_name("elsewhere"))


def _move_back(output: Path) -> None:
    with contextlib.suppress(FileNotFoundError):
        shutil.rmtree(output)
    output.with_name("elsewhere").rename(output)


def _into_a_file(_run: Run, output: Path) -> None:
    _move(_run, output)
    output.write_bytes(b"")


def _into_a_folder_again(output: Path) -> None:
    output.unlink()
    output.with_name("elsewhere").rename(output)


def _into_a_link(_run: Run, output: Path) -> None:
    _move(_run, output)
    output.symlink_to("elsewhere")


def _journal_goes(_run: Run, output: Path) -> None:
    (output / JOURNAL).rename(output / f"{JOURNAL}.old")


def _journal_comes(output: Path) -> None:
    shutil.rmtree(output / JOURNAL, ignore_errors=True)
    (output / f"{JOURNAL}.old").rename(output / JOURNAL)


def _journal_into_a_file(_run: Run, output: Path) -> None:
    _journal_goes(_run, output)
    (output / JOURNAL).write_bytes(b"")


def _journal_file_goes(output: Path) -> None:
    if not (output / JOURNAL).is_dir():
        (output / JOURNAL).unlink(missing_ok=True)
    _journal_comes(output)


def _shut(mode: int) -> Fault:
    return lambda _run, output: output.chmod(mode)


def _shut_journal(_run: Run, output: Path) -> None:
    (output / JOURNAL).chmod(0o500)


def _open(output: Path) -> None:
    output.chmod(0o755)
    (output / JOURNAL).chmod(0o755)


def _work_folder_goes(_run: Run, output: Path) -> None:
    for folder in work_folders(output):
        while folder.exists():
            shutil.rmtree(folder, ignore_errors=True)


def _pid_goes(_run: Run, output: Path) -> None:
    for folder in work_folders(output):
        (folder / "pid").unlink()


def _claims_go(_run: Run, output: Path) -> None:
    for path in (output / JOURNAL).glob("*.claim.*"):
        path.unlink(missing_ok=True)


def _runs_go(_run: Run, output: Path) -> None:
    for path in (output / JOURNAL).glob("run-*"):
        path.unlink(missing_ok=True)


def _a_folder_in_a_frame_s_place(_run: Run, output: Path) -> None:
    (output / f"{FRAMES:04d}_L.png").mkdir()


def _that_folder_goes(output: Path) -> None:
    place = output / f"{FRAMES:04d}_L.png"
    if place.is_dir():
        place.rmdir()


def _a_folder_in_the_report_s_place(_run: Run, output: Path) -> None:
    (output / "animation.json").mkdir()


def _that_report_goes(output: Path) -> None:
    if (output / "animation.json").is_dir():
        (output / "animation.json").rmdir()


def _earlier_frame_damaged(_run: Run, output: Path) -> None:
    (output / "0001_L.png").write_bytes(b"damaged")


def _earlier_record_goes(_run: Run, output: Path) -> None:
    (output / JOURNAL / "0001.json").unlink()


def _limit(child: str, kind: int, value: int) -> Fault:
    def fault(run: Run, _output: Path) -> None:
        for pid in run.children(child) if child else [run.process.pid]:
            with contextlib.suppress(ProcessLookupError):
                resource.prlimit(pid, kind, (value, value))

    return fault


def _stopped(child: str, seconds: float) -> Fault:
    """Stopped for a while, as a machine under load or a laptop that sleeps has it, and then let go on."""

    def fault(run: Run, _output: Path) -> None:
        pids = run.children(child) if child else [run.process.pid]
        for pid in pids:
            os.kill(pid, signal.SIGSTOP)
        with contextlib.suppress(subprocess.TimeoutExpired):
            run.process.wait(seconds)
        for pid in pids:
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGCONT)

    return fault


def _stopped_and_interrupted(child: str, signum: int, folder: Path) -> None:
    """A child that is stopped does not keep the program from ending."""
    output = folder / "out"
    reference(folder)
    with start(folder) as run:
        run.wait_for(lambda: recorded(output, 2))
        for pid in run.children(child):
            os.kill(pid, signal.SIGSTOP)
        run.process.send_signal(signum)
        outcome = run.end(60)
    assert_interrupted(outcome, signum)
    resume(folder)


def _drive_fills(size: str, folder: Path) -> None:
    """A drive that others fill under way; room is made, and the run goes on."""
    expected = reference(folder)
    drive = mount(folder / "drive", f"size={size}")
    output = drive / "out"
    with start(folder, output=output) as run:
        run.wait_for(lambda: recorded(output, 2))
        with contextlib.suppress(OSError), (drive / "others").open("wb", buffering=0) as file:
            while True:
                file.write(bytes(4096))
        outcome = run.end()
    _assert_said(outcome, ("full",))
    assert outcome.status == 2, f"the drive was full: {outcome}"
    (drive / "others").unlink()
    resume(folder, output)
    assert expected.is_dir()


def _names_run_out(folder: Path) -> None:
    """A drive that has room, but none for further names."""
    drive = mount(folder / "drive", "nr_inodes=400")
    output = drive / "out"
    reference(folder)
    with start(folder, output=output) as run:
        run.wait_for(lambda: recorded(output, 2))
        (drive / "others").mkdir()
        with contextlib.suppress(OSError):
            for number in range(400):
                (drive / "others" / str(number)).touch()
        outcome = run.end()
    _assert_said(outcome, ("full",))
    shutil.rmtree(drive / "others")
    resume(folder, output)


def _drive_becomes_read_only(folder: Path) -> None:
    """As Linux does it with a drive on which it has found an error."""
    drive = mount(folder / "drive")
    output = drive / "out"
    reference(folder)
    with start(folder, output=output) as run:
        run.wait_for(lambda: recorded(output, 2))
        _remount_when_it_can(drive)
        outcome = run.end()
    _assert_said(outcome, ("Read-only", "read-only", "cannot be written"))
    remount(drive, "rw")
    resume(folder, output)


def _remount_when_it_can(drive: Path) -> None:
    """While a file is open for writing it cannot; between two it can."""
    for _ in range(10_000):
        with contextlib.suppress(subprocess.CalledProcessError):
            remount(drive, "ro")
            return
    raise AssertionError("the drive was never at rest")


def _scene_goes(how: str, folder: Path) -> None:
    """The .blend is removed, cut off or replaced under way: what Blender has read is rendered, or it is said."""
    reference(folder)
    blend = Path(shutil.copy(scene(folder), folder / "scene.blend"))
    whole = blend.read_bytes()
    with start_program("animate", blend, "--output", folder / "out", *OPTIONS) as run:
        run.wait_for(lambda: claimed(folder / "out", 1))
        match how:
            case "removed":
                blend.unlink()
            case "cut off":
                os.truncate(blend, 1000)
            case "replaced by a folder":
                blend.unlink()
                blend.mkdir()
        outcome = run.end()
    assert_one_line_or_done(outcome)
    if blend.is_dir():
        blend.rmdir()
    blend.write_bytes(whole)
    resume(folder)


def _pair_loses_its_folder(how: str, folder: Path) -> None:
    """The output folder of a pair goes, or is shut, before it is done."""
    output = folder / "out"
    with start_program("render", DEMO, "--output", output, *SMALLEST, prepare=without_powers) as run:
        run.wait_for(lambda: run.children("worker"))
        match how:
            case "removed":
                _remove(run, output)
            case "renamed":
                _move(run, output)
            case "shut":
                output.chmod(0o500)
            case "a file":
                _into_a_file(run, output)
        outcome = run.end()
    assert_one_line_or_done(outcome)
    assert outcome.status, "there was nowhere to put it, and it is done"
    if output.is_dir():
        output.chmod(0o755)
        left = [name.name for name in output.iterdir() if not name.name.startswith(".stereo_reproject-")]
        assert not left, f"half a pair: {left}"
        assert_done(run_program("render", DEMO, "--output", output, *SMALLEST))
        assert_nothing_left(output, *PAIR)


INJECTED = (
    ("fsync", "EIO", "3"),
    ("fsync", "ENOSPC", "5+"),
    ("fsync", "EINVAL", "1+"),
    ("fdatasync,sync_file_range,syncfs", "EIO", "1+"),
    ("rename,renameat,renameat2", "EIO", "4"),
    ("rename,renameat,renameat2", "EXDEV", "1+"),
    ("rename,renameat,renameat2", "EACCES", "7+"),
    ("unlink,unlinkat", "EIO", "3"),
    ("unlink,unlinkat", "EBUSY", "1+"),
    ("mkdir,mkdirat", "ENOSPC", "2+"),
    ("mkdir,mkdirat", "EDQUOT", "1"),
    ("mkdir,mkdirat", "EIO", "4"),
    ("statfs,fstatfs", "ENOSYS", "1+"),
    ("getdents64", "EIO", "2+"),
    ("flock", "ENOLCK", "1+"),
    ("chmod,fchmod,fchmodat", "EPERM", "1+"),
    ("copy_file_range,sendfile", "EIO", "1+"),
    ("utimensat", "EPERM", "1+"),
    ("ftruncate,truncate", "EIO", "1+"),
    ("link,linkat,symlink,symlinkat", "EPERM", "1+"),
)
"""System calls, what they fail with, and at which of their calls in each process."""

IN_OUTPUT_ALONE = ("getdents64",)
"""Calls that fail for the output folder and its journal alone: without them no Python starts."""


def _failing(calls: str, error: str, when: str, output: Path) -> tuple[str, ...]:
    """A Python whose system calls fail, and those of its children."""
    # strace cannot join a filter by path and one in the kernel.
    where = ("-P", str(output), "-P", str(output / JOURNAL)) if calls in IN_OUTPUT_ALONE else ("--seccomp-bpf",)
    tracer = ("strace", "-f", *where, "-qq", "-o", "/dev/null", "-e", f"trace={calls}")
    return (*tracer, "-e", f"inject={calls}:error={error}:when={when}", sys.executable)


def _injected(calls: str, error: str, when: str, folder: Path) -> None:
    """A drive that answers with errors: `strace` gives them in its place."""
    reference(folder)
    python = _failing(calls, error, when, folder / "out")
    with start(folder, python=python) as run:
        outcome = run.end(300)
    assert_one_line_or_done(outcome)
    resume(folder)


def _injected_pair(calls: str, error: str, when: str, folder: Path) -> None:
    python = _failing(calls, error, when, folder / "out")
    output = folder / "out"
    outcome = run_program("render", DEMO, "--output", output, *SMALLEST, python=python, timeout=300)
    assert_one_line_or_done(outcome)
    there = [path.name for path in output.iterdir() if not path.name.startswith(".")] if output.exists() else []
    assert "report.json" not in there or sorted(there) == sorted(PAIR), f"a report beside half a pair: {there}"
    assert_done(run_program("render", DEMO, "--output", output, *SMALLEST))
    assert_nothing_left(output, *PAIR)


def _folders() -> Iterator[tuple[str, Fault, Callable[[Path], None], tuple[str, ...]]]:
    gone = ("gone", "cannot be written", "not a folder")
    yield "the folder is removed", _remove, _nothing, gone
    yield "the folder is renamed", _move, _move_back, gone
    yield "the folder is turned into a file", _into_a_file, _into_a_folder_again, gone
    yield "the folder is turned into a link to itself", _into_a_link, _nothing, gone
    yield "the folder may not be written", _shut(0o500), _open, ("cannot be written",)
    yield "the folder may not be searched", _shut(0o600), _open, ()
    yield "the folder may not be listed", _shut(0o300), _open, ()
    yield "the folder has no rights", _shut(0o000), _open, ()
    yield "the journal is renamed", _journal_goes, _journal_comes, gone
    yield "the journal is turned into a file", _journal_into_a_file, _journal_file_goes, gone
    yield "the journal may not be written", _shut_journal, _open, ("cannot be written",)
    yield "the work folder is removed", _work_folder_goes, _nothing, ()
    yield "the work folder loses its pid", _pid_goes, _nothing, ()
    yield "claims are removed", _claims_go, _nothing, ()
    yield "files of runs are removed", _runs_go, _nothing, ()
    yield (
        "a folder takes a frame's place",
        _a_folder_in_a_frame_s_place,
        _that_folder_goes,
        ("is a folder", "Is a directory"),
    )
    yield "a folder takes the report's place", _a_folder_in_the_report_s_place, _that_report_goes, ()
    yield "a finished frame is damaged", _earlier_frame_damaged, _nothing, ()
    yield "a finished frame's record is removed", _earlier_record_goes, _nothing, ()


def _processes() -> Iterator[tuple[str, Fault]]:
    for child in ("worker", "writer", "heartbeat", ""):
        yield f"{child or 'the program'} is stopped for 4 s", _stopped(child, 4.0)
    for child in ("worker", "writer"):
        yield f"{child} may open no more files", _limit(child, resource.RLIMIT_NOFILE, 3)
        yield f"{child} may write files of 1000 bytes", _limit(child, resource.RLIMIT_FSIZE, 1000)
        yield f"{child} may write nothing", _limit(child, resource.RLIMIT_FSIZE, 0)
        yield f"{child} gets no more memory", _limit(child, resource.RLIMIT_AS, 1 << 20)
        yield f"{child} has used its time of the processor", _limit(child, resource.RLIMIT_CPU, 1)
    yield "the program may open no more files", _limit("", resource.RLIMIT_NOFILE, 3)
    yield "the heartbeat may write nothing", _limit("heartbeat", resource.RLIMIT_FSIZE, 0)


def cases() -> Iterator[Case]:
    for words, fault, cure, said in _folders():
        yield Case(words, functools.partial(_under_way, fault, cure, said))
    for words, fault in _processes():
        yield Case(words, functools.partial(_under_way, fault, _nothing, ()))
    for child, signum in (("worker", signal.SIGINT), ("writer", signal.SIGTERM), ("worker", signal.SIGHUP)):
        check = functools.partial(_stopped_and_interrupted, child, signum)
        yield Case(f"{child} is stopped, and then {signal.Signals(signum).name}", check)
    for size in ("300k", "1m", "8m"):
        yield Case(f"a drive of {size} fills", functools.partial(_drive_fills, size))
    yield Case("a drive has no more names", _names_run_out)
    yield Case("a drive becomes read-only", _drive_becomes_read_only)
    for how in ("removed", "cut off", "replaced by a folder"):
        yield Case(f"the scene is {how}", functools.partial(_scene_goes, how))
    for how in ("removed", "renamed", "shut", "a file"):
        yield Case(f"the folder of a pair is {how}", functools.partial(_pair_loses_its_folder, how))
    if shutil.which("strace"):
        for calls, error, when in INJECTED:
            name = f"{calls.partition(',')[0]} fails with {error}, {when}"
            yield Case(f"{name}, frames", functools.partial(_injected, calls, error, when))
            if "," not in calls or calls.startswith(("rename", "mkdir", "unlink")):
                yield Case(f"{name}, a pair", functools.partial(_injected_pair, calls, error, when))
