"""Environment variables, none of which changes a picture or a word, and folders for temporary files."""

from __future__ import annotations

import functools
import json
import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from tests.hostile.case import Case
from tests.hostile.program import (
    DEMO,
    PAIR,
    SMALLEST,
    assert_done,
    assert_nothing_left,
    assert_one_line_or_done,
    run_program,
)
from tests.hostile.rows._names import ANIMATION
from tests.hostile.rows._privileges import mount, without_powers

Variables = Mapping[str, str | bytes | None]
RENDER = ("render", DEMO, "--output", "out", *SMALLEST)
ANIMATE = ("animate", DEMO, "--output", "out", *SMALLEST, "--frames", "1")
INSPECT = ("inspect", DEMO, "--json", "--no-sketch")
HARMLESS: tuple[Variables, ...] = (
    {"HOME": None},
    {"HOME": ""},
    {"HOME": "/nonexistent/home"},
    {"HOME": "/dev/null"},
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
    {"STEREO_REPROJECT_USER_FOLDER": "/dev/null/nothing"},
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
    {"CYCLES_SHADER_PATH": "/nonexistent"},
    {"PYTHONEXECUTABLE": "/nonexistent/python"},
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


def _relative_home(name: str, folder: Path) -> None:
    """A home beside the result: Blender makes its folder for thumbnails there, and that is all."""
    outcome = run_program(*RENDER, cwd=folder, environment={"HOME": name})
    assert_done(outcome)
    home = [name + "/"] if (folder / name).exists() else []
    assert_nothing_left(folder, *home, "out", *(f"out/{file}" for file in PAIR))
    assert not [path for path in (folder / name).rglob("*") if path.is_file()]


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


def _shown(variables: Variables) -> str:
    text = ", ".join(f"{name}={value!r}" for name, value in variables.items())
    return text[:70]


def cases() -> Iterator[Case]:
    for number, variables in enumerate(HARMLESS):
        check = functools.partial(_same_as_ever, RENDER, PAIR, variables)
        if number % 3 == 0 or _shown(variables).startswith(("MPL", "MATPLOT", "LC_ALL", "SOURCE")):
            check = functools.partial(_same_as_ever, ANIMATE, ANIMATION, variables)
        yield Case(f"with {_shown(variables)}", check)
    for name in ("relative", "a\nb", "{blend_dir}"):
        yield Case(f"at home in {name!r}", functools.partial(_relative_home, name))
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
