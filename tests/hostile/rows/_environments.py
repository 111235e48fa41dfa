"""Variables, limits, signals, streams and folders that the program is started with."""

from __future__ import annotations

import contextlib
import fcntl
import functools
import json
import os
import pty
import resource
import signal
import struct
import termios
import threading
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

from ..case import Case
from ..program import (
    DEMO,
    PAIR,
    SMALLEST,
    Outcome,
    assert_bad_input,
    assert_done,
    assert_nothing_left,
    assert_one_line_or_done,
    lines_of,
    run_program,
    start_program,
)
from ._names import ANIMATION
from ._privileges import as_user, mount, without_powers

Variables = Mapping[str, str | bytes | None]
RENDER = ("render", DEMO, "--output", "out", *SMALLEST)
ANIMATE = ("animate", DEMO, "--output", "out", *SMALLEST, "--frames", "1")
INSPECT = ("inspect", DEMO, "--json", "--no-sketch")

HARMLESS: tuple[Variables, ...] = (
    {"HOME": None},
    {"HOME": ""},
    {"HOME": "/nonexistent/home"},
    {"HOME": "/dev/null"},
    {"HOME": "relative"},
    {"HOME": "a\nb"},
    {"HOME": b"/\xff"},
    {"HOME": "/" + "h" * 5000},
    {"HOME": None, "USER": None, "LOGNAME": None, "PATH": None, "SHELL": None, "LANG": None, "TERM": None},
    {"PATH": ""},
    {"PATH": "/nonexistent"},
    {"PATH": b"\xff:."},
    {"SHELL": "/bin/false"},
    {"TZ": ""},
    {"TZ": "Nonsense/Nowhere"},
    {"TZ": "../../../../etc/passwd"},
    {"LANG": "", "LC_ALL": ""},
    {"LC_ALL": "C"},
    {"LC_ALL": "POSIX"},
    {"LC_ALL": "C.UTF-8"},
    {"LC_ALL": "xx_YY.UTF-8"},
    {"LC_ALL": "tr_TR.UTF-8"},
    {"LC_ALL": "de_DE.UTF-8", "LC_NUMERIC": "de_DE.UTF-8"},
    {"LC_ALL": b"\xff"},
    {"LANG": "ja_JP.SJIS"},
    {"LANGUAGE": "ar:he"},
    {"LC_ALL": "C", "PYTHONCOERCECLOCALE": "0", "PYTHONUTF8": "0"},
    {"PYTHONUTF8": "1"},
    {"PYTHONIOENCODING": "ascii:strict"},
    {"PYTHONIOENCODING": "utf-16"},
    {"PYTHONIOENCODING": "cp037"},
    {"PYTHONWARNINGS": "error"},
    {"PYTHONHASHSEED": "0"},
    {"PYTHONHASHSEED": "4294967295"},
    {"PYTHONOPTIMIZE": "2"},
    {"PYTHONUNBUFFERED": "1"},
    {"PYTHONFAULTHANDLER": "1"},
    {"PYTHONTRACEMALLOC": "5"},
    {"PYTHONDONTWRITEBYTECODE": "1"},
    {"PYTHONPYCACHEPREFIX": "/dev/null"},
    {"PYTHONSAFEPATH": "1"},
    {"PYTHONNOUSERSITE": "1"},
    {"PYTHONUSERBASE": "/nonexistent"},
    {"PYTHONMALLOC": "debug"},
    {"PYTHONMALLOC": "malloc"},
    {"PYTHONINTMAXSTRDIGITS": "640"},
    {"PYTHONBREAKPOINT": "os.abort"},
    {"PYTHONCASEOK": "1"},
    {"PYTHONEXECUTABLE": "/nonexistent/python"},
    {"PYTHON_COLORS": "1", "FORCE_COLOR": "1"},
    {"PYTHON_CPU_COUNT": "1"},
    {"PYTHON_FROZEN_MODULES": "off"},
    {"TERM": ""},
    {"TERM": "dumb"},
    {"TERM": "nonsense"},
    {"NO_COLOR": "1"},
    {"COLUMNS": "0"},
    {"COLUMNS": "1"},
    {"COLUMNS": "-5"},
    {"COLUMNS": "wide"},
    {"COLUMNS": "9" * 30},
    {"LINES": "0"},
    {"DISPLAY": ":99", "WAYLAND_DISPLAY": "wayland-99"},
    {"XDG_RUNTIME_DIR": "/nonexistent"},
    {"XDG_CONFIG_HOME": "/dev/null", "XDG_CACHE_HOME": "/dev/null", "XDG_DATA_HOME": "/dev/null"},
    {"BLENDER_USER_RESOURCES": "/nonexistent"},
    {"BLENDER_USER_RESOURCES": ""},
    {"BLENDER_USER_CONFIG": "/dev/null"},
    {"BLENDER_USER_SCRIPTS": "/nonexistent"},
    {"BLENDER_USER_EXTENSIONS": "/dev/null"},
    {"BLENDER_USER_DATAFILES": b"/\xff"},
    {"BLENDER_CUSTOM_SPLASH": "/dev/zero"},
    {"OMP_NUM_THREADS": "1"},
    {"OMP_NUM_THREADS": "0"},
    {"OMP_NUM_THREADS": "-1"},
    {"OMP_NUM_THREADS": "1,2,3"},
    {"OPENBLAS_NUM_THREADS": "1"},
    {"OPENBLAS_NUM_THREADS": "nonsense"},
    {"TBB_NUM_THREADS": "0"},
    {"MALLOC_PERTURB_": "165"},
    {"MALLOC_PERTURB_": "90", "PYTHONMALLOC": "malloc"},
    {"MALLOC_ARENA_MAX": "1"},
    {"MALLOC_MMAP_THRESHOLD_": "0"},
    {"LD_BIND_NOW": "1"},
    {"LIBGL_ALWAYS_SOFTWARE": "1", "EGL_PLATFORM": "nonsense"},
    {"CYCLES_CPU_NO_AVX2": "1"},
    {"CYCLES_CPU_NO_AVX2": "1", "CYCLES_CPU_NO_SSE42": "1"},
    {"CYCLES_BVH2": "1"},
    {"CYCLES_CONCURRENT_STATES_FACTOR": "nonsense"},
    {"CYCLES_SHADER_PATH": "/nonexistent"},
    {"CYCLES_KERNEL_PATH": "/nonexistent"},
    {"CUDA_VISIBLE_DEVICES": "99", "HIP_VISIBLE_DEVICES": "-1"},
    {"OPENEXR_DEFAULT_THREADS": "-1"},
    {"MPLBACKEND": "nonsense"},
    {"MPLBACKEND": "TkAgg"},
    {"MPLCONFIGDIR": "/dev/null"},
    {"MATPLOTLIBRC": "/dev/null"},
    {"SOURCE_DATE_EPOCH": "nonsense"},
    {"SOURCE_DATE_EPOCH": "-1"},
    {"http_proxy": "http://127.0.0.1:1", "https_proxy": "http://127.0.0.1:1"},
    {"PIP_INDEX_URL": "http://127.0.0.1:1"},
    {"HOSTILE_HUGE": "x" * 120_000},
    {"HOSTILE_BYTES": bytes(range(1, 256))},
    {f"HOSTILE_{number}": "x" for number in range(5000)},
    {"A B": "1", "1": "2", "%": "3", "é": "4"},
    {"BASH_ENV": "/dev/zero", "ENV": "/dev/zero", "PROMPT_COMMAND": "touch pwned"},
    {"_": ""},
    {"PWD": "/nonexistent", "OLDPWD": "/dev/null"},
    {"INVOCATION_ID": "", "NOTIFY_SOCKET": "/dev/null", "LISTEN_FDS": "3"},
)
"""Neither the pictures nor the words depend on these."""

QUESTIONABLE: tuple[Variables, ...] = (
    {"OCIO": "/nonexistent/config.ocio"},
    {"OCIO": "/dev/null"},
    {"OCIO": "/"},
    {"OCIO": ""},
    {"OCIO": str(DEMO)},
    {"BLENDER_OCIO": "/nonexistent"},
    {"BLENDER_SYSTEM_SCRIPTS": "/nonexistent"},
    {"BLENDER_SYSTEM_DATAFILES": "/nonexistent"},
    {"BLENDER_SYSTEM_RESOURCES": "/nonexistent"},
    {"BLENDER_SYSTEM_EXTENSIONS": "/dev/null"},
    {"MALLOC_CHECK_": "3"},
    {"PYTHONDEVMODE": "1"},
    {"CYCLES_TEXTURE_LIMIT": "-1"},
)
"""With these Blender itself may refuse; then there is one line."""


def _same_as_ever(command: tuple[Any, ...], files: tuple[str, ...], variables: Variables, folder: Path) -> None:
    outcome = run_program(*command, cwd=folder, environment=variables)
    assert_done(outcome)
    assert not outcome.stderr, f"it says something: {outcome}"
    assert_nothing_left(folder, "out", *(f"out/{name}" for name in files))


def _done_or_one_line(variables: Variables, folder: Path) -> None:
    outcome = run_program(*RENDER, cwd=folder, environment=variables)
    assert_one_line_or_done(outcome)
    assert_nothing_left(folder, *(("out", *(f"out/{name}" for name in PAIR)) if outcome.status == 0 else ()))


def _odd_temporary(value: str | bytes | None, make: str, command: tuple[Any, ...], folder: Path) -> None:
    """A pair needs no folder for temporary files but its own; an inspection takes one, or says that there is none."""
    place = folder / "place"
    match make:
        case "file":
            place.touch()
        case "loop":
            place.symlink_to("place")
        case "full":
            drive = mount(place, "size=4k")
            (drive / "others").write_bytes(bytes(4096))
        case "names":
            mount(place, "nr_inodes=1")
        case "rights":
            place.mkdir(mode=0o500)
        case "folder":
            (place / os.fsdecode(value or "")).mkdir(parents=True)
    named = value if make != "folder" else os.fsencode(place / os.fsdecode(value or ""))
    before = {str(path) for path in place.rglob("*")} if place.is_dir() else set()
    outcome = run_program(*command, cwd=folder, environment={"TMPDIR": named}, prepare=without_powers)
    if command[0] == "render":
        assert_done(outcome)
    else:
        assert_one_line_or_done(outcome)
        if outcome.status == 0:
            json.loads(outcome.stdout)
    assert place.exists() or place.is_symlink() or not make
    assert not place.is_dir() or {str(path) for path in place.rglob("*")} == before, "something is left in TMPDIR"


def _limited(kind: int, value: int, command: tuple[Any, ...], works: bool | None, folder: Path) -> None:
    """Where a limit bites there is one line, and what is left of the result is nothing, or whole frames."""
    outcome = run_program(*command, cwd=folder, limits={kind: value}, environment={"TMPDIR": str(folder)})
    if works:
        assert_done(outcome)
    else:
        assert_one_line_or_done(outcome)
    if works is False:
        assert outcome.status, "the limit did not bite"
    files = PAIR if command is RENDER else ANIMATION
    if outcome.status == 0:
        assert_nothing_left(folder, "out", *(f"out/{name}" for name in files))
    else:
        left = {path.name for path in folder.rglob("*") if path.is_file() and "journal" not in path.parts}
        assert left <= set(ANIMATION), f"half-made: {left}"


def _signals(ignored: tuple[int, ...], blocked: tuple[int, ...], command: tuple[Any, ...], folder: Path) -> None:
    """Signals that whoever started it has switched off change nothing in a run that gets none."""

    def switch() -> None:
        for number in ignored:
            signal.signal(number, signal.SIG_IGN)
        signal.pthread_sigmask(signal.SIG_BLOCK, blocked)

    outcome = run_program(*command, cwd=folder, prepare=switch)
    assert_done(outcome)


def _interruptible(ignored: bool, blocked: bool, signum: int, folder: Path) -> None:
    """Ctrl-C ends it, also where a script that runs in the background had it ignored: by hand, `kill -INT`."""

    def switch() -> None:
        if ignored:
            signal.signal(signal.SIGINT, signal.SIG_IGN)
        if blocked:
            signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGHUP, signal.SIGUSR1})

    arguments = ("render", DEMO, "--output", "out", "--size", "2000x2000", "--samples", "4000")
    with start_program(*arguments, cwd=folder, prepare=switch) as run:
        run.wait_for(lambda: list(folder.glob("out/.stereo_reproject-*/tmp")))
        run.process.send_signal(signum)
        outcome = run.end(30)
    assert not outcome.timed_out, f"{signum} did not end it"
    assert outcome.status == 128 + signum, f"{signum} ended it with {outcome}"
    assert_nothing_left(folder)


def _streams(closed: tuple[int, ...], onto: Mapping[int, str], command: tuple[Any, ...], folder: Path) -> None:
    """Whatever becomes of what it says, the result is the same."""

    def switch() -> None:
        for number in closed:
            os.close(number)
        for number, name in onto.items():
            opened = os.open(name, os.O_RDONLY if number == 0 or name == "/dev/zero" else os.O_WRONLY)
            os.dup2(opened, number)
            os.close(opened)

    outcome = run_program(*command, cwd=folder, prepare=switch)
    files = PAIR if command is RENDER else ANIMATION
    if onto.get(1) in ("/dev/full", "/dev/zero"):
        # What it said is lost, which is a failure of its own; what it made is not.
        assert outcome.status in (0, 1), outcome
        assert len(lines_of(outcome)) <= 1, outcome
    else:
        assert_done(outcome)
    assert not outcome.timed_out
    assert_nothing_left(folder, "out", *(f"out/{name}" for name in files))


def _broken_pipe(number: int, command: tuple[Any, ...], folder: Path) -> None:
    """Nobody reads: `... | head -0`."""
    reader, writer = os.pipe()
    os.close(reader)
    outcome = run_program(*command, cwd=folder, **{{1: "stdout", 2: "stderr"}[number]: writer})
    os.close(writer)
    assert outcome.status == 0, outcome
    assert_one_line_or_done(outcome)


def _quiet_pipe(folder: Path) -> None:
    """Standard input from a pipe into which nobody writes and that nobody closes."""
    reader, writer = os.pipe()
    outcome = run_program(*RENDER, cwd=folder, stdin=reader)
    os.close(reader)
    os.close(writer)
    assert_done(outcome)


def _terminal(columns: int, lines: int, variables: Variables, command: tuple[Any, ...], folder: Path) -> None:
    """On a terminal of any size, a progress line, and no control characters but those that move to its beginning."""
    master, slave = pty.openpty()
    fcntl.ioctl(slave, termios.TIOCSWINSZ, struct.pack("HHHH", lines, columns, 0, 0))
    said: list[bytes] = []

    def read() -> None:
        with contextlib.suppress(OSError):
            while part := os.read(master, 65536):
                said.append(part)

    reader = threading.Thread(target=read)
    with start_program(*command, cwd=folder, environment=variables, stdin=slave, stdout=slave, stderr=slave) as run:
        reader.start()
        os.close(slave)
        outcome = run.end()
    reader.join(10)
    os.close(master)
    text = b"".join(said).decode("utf-8", "replace")
    assert_done(Outcome(outcome.status, text.encode(), b"", outcome.seconds, outcome.timed_out, outcome.left))
    odd = {char for char in text if not char.isprintable()} - {"\r", "\n"}
    assert not odd, f"control characters: {odd}"


def _terminal_gone(folder: Path) -> None:
    """Whoever closes the terminal's window sends SIGHUP: the run ends, and leaves nothing."""
    master, slave = pty.openpty()

    def own() -> None:
        fcntl.ioctl(0, termios.TIOCSCTTY, 0)

    arguments = ("render", DEMO, "--output", "out", "--size", "2000x2000", "--samples", "4000")
    with start_program(*arguments, cwd=folder, stdin=slave, stdout=slave, stderr=slave, prepare=own) as run:
        os.close(slave)
        run.wait_for(lambda: list(folder.glob("out/.stereo_reproject-*/tmp")))
        os.close(master)
        outcome = run.end(30)
    assert outcome.status == 128 + signal.SIGHUP, outcome
    assert_nothing_left(folder)


def _umask(mask: int, powers: bool, folder: Path) -> None:
    def switch() -> None:
        os.umask(mask)
        if not powers:
            without_powers()

    outcome = run_program(*RENDER, cwd=folder, prepare=switch)
    if not mask & 0o700:
        assert_done(outcome)
        for name in PAIR:
            mode = (folder / "out" / name).stat().st_mode & 0o777
            assert mode == 0o666 & ~mask, f"{name} has the rights {mode:o}"
    else:
        assert_one_line_or_done(outcome)
        assert outcome.status == 0 or not [path for path in folder.rglob("*") if path.is_file()]


def _gone_folder(relative: bool, command: tuple[Any, ...], folder: Path) -> None:
    """The folder that it was started in is no more: with absolute paths that does not matter."""
    gone = folder / "gone"
    gone.mkdir()

    def leave() -> None:
        os.chdir(gone)
        gone.rmdir()

    output = "out" if relative else str(folder / "out")
    outcome = run_program(command[0], DEMO, "--output", output, *command[4:], prepare=leave)
    if relative:
        assert_bad_input(outcome)
        assert_nothing_left(folder)
    else:
        assert_done(outcome)


def _started_in(place: str, folder: Path) -> None:
    outcome = run_program("render", DEMO, "--output", folder / "out", *SMALLEST, cwd=place)
    assert_done(outcome)
    assert_nothing_left(folder, "out", *(f"out/{name}" for name in PAIR))


def _shut_folder(folder: Path) -> None:
    """A folder that may be neither read nor searched, and is the one that it was started in."""
    shut = folder / "shut"
    shut.mkdir()

    def enter() -> None:
        os.chdir(shut)
        shut.chmod(0)
        without_powers()

    outcome = run_program("render", DEMO, "--output", folder / "out", *SMALLEST, prepare=enter)
    assert_done(outcome)


def _shadows(names: tuple[str, ...], folder: Path) -> None:
    """Modules of these names, in the folder that it was started in, are not taken for those that Blender needs."""
    for name in names:
        (folder / name).write_text("from pathlib import Path\nPath('pwned').touch()\nraise SystemExit('shadowed')\n")
    outcome = run_program(*RENDER, cwd=folder)
    assert_done(outcome)
    assert_nothing_left(folder, *names, "out", *(f"out/{name}" for name in PAIR))


def _prepared(prepare: Callable[[], Any], folder: Path) -> None:
    assert_done(run_program(*RENDER, cwd=folder, prepare=prepare))


def _many_files() -> None:
    for _ in range(900):
        os.set_inheritable(os.open(os.devnull, os.O_RDONLY), True)


def _nobody(number: int, command: tuple[Any, ...], folder: Path) -> None:
    """A user that no list knows, without a home."""
    outcome = run_program(*command, cwd=folder, python=as_user(number), environment={"HOME": None})
    assert_done(outcome)


def _no_variables(folder: Path) -> None:
    """`env -i`, but for where the package is, and the mark by which the suite finds its processes."""
    names = {name: None for name in os.environ if name != "PATH"}
    assert_done(run_program(*RENDER, cwd=folder, environment=names))


def _timed_out(folder: Path) -> None:
    """`timeout 1 python -m stereo_reproject ...`, as scripts have it."""
    arguments = ("render", DEMO, "--output", "out", "--size", "2000x2000", "--samples", "4000")
    outcome = run_program(*arguments, cwd=folder, python=("timeout", "2", *_python()))
    assert outcome.status == 124, outcome
    assert not outcome.left, outcome
    assert_nothing_left(folder)


def _python() -> tuple[str, ...]:
    import sys

    return (sys.executable,)


def _shown(variables: Variables) -> str:
    text = ", ".join(f"{name}={value!r}" for name, value in variables.items())
    return text[:70]


def _variables() -> Iterator[Case]:
    for number, variables in enumerate(HARMLESS):
        check = functools.partial(_same_as_ever, RENDER, PAIR, variables)
        if number % 3 == 0 or _shown(variables).startswith(("MPL", "MATPLOT", "LC_ALL", "SOURCE")):
            check = functools.partial(_same_as_ever, ANIMATE, ANIMATION, variables)
        yield Case(f"with {_shown(variables)}", check)
    for variables in QUESTIONABLE:
        yield Case(f"perhaps with {_shown(variables)}", functools.partial(_done_or_one_line, variables))
    for value, make in (
        ("", ""),
        ("/nonexistent", ""),
        ("/dev/null", ""),
        ("relative", ""),
        ("place", "file"),
        ("place", "loop"),
        ("place", "full"),
        ("place", "names"),
        ("place", "rights"),
        ("a b", "folder"),
        ("a\\b", "folder"),
        ("a\nb", "folder"),
        ("{blend_dir}", "folder"),
        ("####", "folder"),
        (b"\xff", "folder"),
        ("t" * 255, "folder"),
    ):
        for command in (RENDER, INSPECT):
            check = functools.partial(_odd_temporary, value, make, command)
            yield Case(f"{command[0]} with TMPDIR {value[:20]!r} {make}".rstrip(), check)


def _limits() -> Iterator[Case]:
    for kind, words, values in (
        (
            resource.RLIMIT_AS,
            "memory",
            {200 << 20: False, 700 << 20: None, 1 << 30: None, 2 << 30: None, 16 << 30: True},
        ),
        (resource.RLIMIT_DATA, "data", {50 << 20: False, 300 << 20: None, 8 << 30: True}),
        (resource.RLIMIT_NOFILE, "open files", {8: False, 12: None, 20: None, 40: None, 256: True}),
        (resource.RLIMIT_FSIZE, "size of files", {0: False, 200: False, 2000: False, 5000: False, 1 << 30: True}),
        (resource.RLIMIT_STACK, "stack", {1 << 20: True, 64 << 20: True, resource.RLIM_INFINITY: True}),
        (resource.RLIMIT_CPU, "seconds of the processor", {60: True}),
        (resource.RLIMIT_MEMLOCK, "locked memory", {0: True}),
        (resource.RLIMIT_CORE, "core files", {0: True}),
    ):
        for value, works in values.items():
            for command in (RENDER, ANIMATE):
                check = functools.partial(_limited, kind, value, command, works)
                yield Case(f"{command[0]} with {words} up to {value}", check)


def _signal_cases() -> Iterator[Case]:
    for number in ("SIGPIPE", "SIGINT", "SIGHUP", "SIGCHLD", "SIGTERM", "SIGUSR1", "SIGALRM"):
        command = ANIMATE if number == "SIGCHLD" else RENDER
        ignored = (getattr(signal, number),)
        yield Case(f"{number} ignored", functools.partial(_signals, ignored, (), command))
    for number in ("SIGCHLD", "SIGTERM", "SIGINT", "SIGPIPE"):
        yield Case(f"{number} blocked", functools.partial(_signals, (), (getattr(signal, number),), RENDER))
    every = tuple(signal.valid_signals())
    yield Case("every signal blocked", functools.partial(_signals, (), every, RENDER))
    yield Case("Ctrl-C where it was ignored", functools.partial(_interruptible, True, False, signal.SIGINT))
    yield Case("Ctrl-C with others blocked", functools.partial(_interruptible, False, True, signal.SIGINT))
    yield Case("SIGTERM where Ctrl-C is ignored", functools.partial(_interruptible, True, False, signal.SIGTERM))
    yield Case("a time limit of a script", _timed_out)


def _stream_cases() -> Iterator[Case]:
    for closed in ((0,), (1,), (2,), (0, 1), (1, 2), (0, 1, 2)):
        for command in (RENDER, ANIMATE):
            shown = ", ".join(map(str, closed))
            yield Case(f"{command[0]} with {shown} closed", functools.partial(_streams, closed, {}, command))
    for onto in (
        {1: "/dev/full"},
        {2: "/dev/full"},
        {1: "/dev/full", 2: "/dev/full"},
        {0: "/dev/zero"},
        {1: "/dev/zero"},
    ):
        for command in (RENDER, ANIMATE):
            yield Case(f"{command[0]} with {onto}", functools.partial(_streams, (), onto, command))
    for number in (1, 2):
        for command in (RENDER, ANIMATE):
            yield Case(f"{command[0]} with {number} a broken pipe", functools.partial(_broken_pipe, number, command))
    yield Case("standard input that says nothing", _quiet_pipe)
    for columns, lines, variables in (
        (80, 24, {}),
        (0, 0, {}),
        (1, 1, {}),
        (5, 2, {"TERM": "dumb"}),
        (65535, 65535, {}),
    ):
        for command in (RENDER, ANIMATE):
            check = functools.partial(_terminal, columns, lines, variables, command)
            yield Case(f"{command[0]} on a terminal of {columns} x {lines}", check)
    yield Case(
        "a terminal without letters", functools.partial(_terminal, 80, 24, {"LC_ALL": "C", "PYTHONUTF8": "0"}, RENDER)
    )
    yield Case("a terminal that is closed", _terminal_gone)


def _places() -> Iterator[Case]:
    for mask in (0o000, 0o077, 0o022, 0o222, 0o333, 0o777):
        for powers in (True, False):
            if powers or mask & 0o700:
                yield Case(
                    f"umask {mask:o}, {'as root' if powers else 'without rights'}",
                    functools.partial(_umask, mask, powers),
                )
    for command in (RENDER, ANIMATE):
        for relative in (True, False):
            check = functools.partial(_gone_folder, relative, command)
            yield Case(f"{command[0]} in a folder that is gone{', relative' if relative else ''}", check)
    for place in ("/", "/proc", "/dev", "/sys", "/proc/self/fd"):
        yield Case(f"in {place}", functools.partial(_started_in, place))
    yield Case("in a folder that may not be read", _shut_folder)
    yield Case(
        "beside other modules", functools.partial(_shadows, ("bpy.py", "numpy.py", "OpenEXR.py", "mathutils.py"))
    )
    for words, prepare in (
        ("nice 19", lambda: os.nice(19)),
        ("one processor", lambda: os.sched_setaffinity(0, {0})),
        ("idle scheduling", lambda: os.sched_setscheduler(0, os.SCHED_IDLE, os.sched_param(0))),
        ("900 open files of its parent", _many_files),
        ("first to be killed for memory", lambda: Path("/proc/self/oom_score_adj").write_text("1000")),
    ):
        yield Case(words, functools.partial(_prepared, prepare))
    for number, command in ((12345, RENDER), (4294967293, RENDER), (12345, ANIMATE)):
        yield Case(f"{command[0]} as user {number}", functools.partial(_nobody, number, command))
    yield Case("without any variables", _no_variables)


def cases() -> Iterator[Case]:
    yield from _variables()
    yield from _limits()
    yield from _signal_cases()
    yield from _stream_cases()
    yield from _places()
