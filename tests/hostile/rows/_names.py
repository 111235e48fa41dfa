"""Names of folders and files, as they are given and as they come to be."""

from __future__ import annotations

import functools
import os
import shutil
import unicodedata
from collections.abc import Iterator
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
    run_program,
)

ANIMATION = ("0001_L.png", "0001_R.png", "animation.json", "animation.png", "animation.svg", f"{JOURNAL}/")
COMMANDS = {"render": (SMALLEST, PAIR), "animate": ((*SMALLEST, "--frames", "1"), ANIMATION)}

NAMES: tuple[str | bytes, ...] = (
    " ",
    " out",
    "out ",
    "out.",
    "...",
    ".hidden",
    "~",
    "~root",
    "$HOME",
    "${HOME}",
    "%TEMP%",
    "%d",
    "%",
    "%%s%n",
    "{",
    "}",
    "{}",
    "{0}",
    "{frame}",
    "{blend_name}",
    "{blend_dir}",
    "{{out}}",
    "#",
    "####",
    "out_####.png",
    "@",
    "@L",
    "out%V",
    "*",
    "?",
    "[a-z]",
    "[!]",
    "a\\b",
    "\\",
    "out\\",
    "\\\\server\\share",
    "C:",
    "C:\\out",
    "CON",
    "nul.exr",
    "a:b",
    "a|b",
    "a;b",
    "a,b",
    "a&b",
    "$(touch pwned)",
    "`touch pwned`",
    "'",
    '"',
    '"out"',
    "<out>",
    "(out)",
    "--out",
    "-rf",
    "=",
    "left.exr",
    "report.json",
    "0001_L.png",
    JOURNAL,
    "out.blend",
    "out.mp4",
    "a\nb",
    "a\rb",
    "a\tb",
    "a\x01b",
    "a\x07\x1b[2Jb",
    "a\x7fb",
    "caf\u00e9",
    "cafe\u0301",
    "\u0130stanbul",
    "straße",
    "папка",
    "文件夹",
    "مجلد",
    "\u202eevil",
    "a\u200bb",
    "\ufeffout",
    "a\u2028b",
    "a\u0085b",
    "\u00a0",
    "\U0001f469\u200d\U0001f680",
    "\U0001f9ea" * 60,
    "\ud7ff\ue000",
    "o" * 255,
    "é" * 127,
    b"\xff",
    b"caf\xe9",
    b"\xed\xa0\x80",
    b"out\x80\n",
)

WAYS: tuple[tuple[str, str], ...] = (
    ("./out", "out"),
    ("out/", "out"),
    ("out///", "out"),
    ("out/.", "out"),
    ("./././out", "out"),
    ("out/../other", "other"),
    ("a/b/c/d/e", "a/b/c/d/e"),
    ("a//b", "a/b"),
    (".//out", "out"),
    ("//out", "out"),
    ("//out/", "out"),
    ("//sub/out", "sub/out"),
    ("//../work/out", "out"),
    ("there/../../work/out", "out"),
    ("/".join(["d"] * 120), "/".join(["d"] * 120)),
    (f"{'n' * 200}/{'m' * 200}/{'o' * 200}", f"{'n' * 200}/{'m' * 200}/{'o' * 200}"),
)
"""How a folder can be named from the one that the scene is in and the program is started in, and which one that is."""

TOO_LONG: tuple[str | bytes, ...] = (
    "o" * 256,
    "é" * 128,
    "/".join(["d" * 200] * 25),
    "a" * 5000,
    b"\xff" * 300,
)


def _scene(folder: Path, name: str | bytes = "scene.blend") -> Path:
    work = folder / "work"
    work.mkdir()
    return Path(shutil.copy(DEMO, work / os.fsdecode(name)))


def _made(output: str, files: tuple[str, ...]) -> tuple[str, ...]:
    parents = [str(parent) for parent in Path(output).parents][:-1]
    return (*parents, output, *(f"{output}/{name}" for name in files))


def _named(command: str, given: str | bytes, output: str, folder: Path) -> None:
    """The result is in that folder, and nowhere else."""
    scene = _scene(folder)
    options, files = COMMANDS[command]
    named = b"--output=" + given if isinstance(given, bytes) else f"--output={given}"
    assert_done(run_program(command, scene.name, named, *options, cwd=scene.parent))
    assert_nothing_left(folder, "work", f"work/{scene.name}", *(f"work/{name}" for name in _made(output, files)))


def _too_long(command: str, given: str | bytes, folder: Path) -> None:
    scene = _scene(folder)
    named = b"--output=" + given if isinstance(given, bytes) else f"--output={given}"
    assert_bad_input(run_program(command, scene.name, named, *COMMANDS[command][0], cwd=scene.parent))
    assert_nothing_left(folder, "work", f"work/{scene.name}")


def _long_place(command: str, length: int, folder: Path) -> None:
    """Near the longest path that the system takes: done, or refused in a line."""
    scene = _scene(folder)
    room = length - len(os.fsencode(scene.parent)) - 1
    parts, rest = divmod(room, 201)
    output = "/".join(["d" * 200] * parts + ["e" * max(rest - 1, 1)])
    outcome = run_program(command, scene.name, "--output", output, *COMMANDS[command][0], cwd=scene.parent)
    assert_one_line_or_done(outcome)
    files = _made(output, COMMANDS[command][1]) if outcome.status == 0 else ()
    assert_nothing_left(folder, "work", f"work/{scene.name}", *(f"work/{name}" for name in files))


def is_utf8(name: bytes) -> bool:
    try:
        name.decode("utf-8")
    except UnicodeDecodeError:
        return False
    return True


def _of_scene(name: str | bytes, folder: Path) -> None:
    """A scene of that name is rendered like any other; frames are called by the scene's output path, not by it."""
    scene = _scene(folder, name)
    outcome = run_program("animate", scene, "--output", folder / "out", "--frames", "1", *SMALLEST)
    if not is_utf8(os.fsencode(scene.name)):
        # Blender opens none.
        assert_bad_input(outcome, "not UTF-8")
        assert_nothing_left(folder, "work", f"work/{scene.name}")
        return
    assert_done(outcome)
    assert_nothing_left(folder, "work", f"work/{scene.name}", "out", *(f"out/{made}" for made in ANIMATION))


def _movie(name: str, folder: Path) -> None:
    """A movie is where it is said to be, or refused in a line; nothing else of it is left anywhere."""
    scene = _scene(folder)
    arguments = ["--output", "out", "--frames", "1", "--layout", "side-by-side", *SMALLEST, f"--movie={name}"]
    outcome = run_program("animate", scene.name, *arguments, cwd=scene.parent)
    assert_one_line_or_done(outcome)
    kept = () if outcome.status else (*ANIMATION, "0001.png")
    if outcome.status == 0:
        movie = scene.parent / name
        assert movie.is_file(), f"no movie at {movie}: {[str(path) for path in folder.rglob('*')]}"
        assert movie.stat().st_size > 500, f"an empty movie: {movie}"
        made = [f"work/{parent}" for parent in _made(name, ())]
        files = [f"work/out/{file}" for file in kept if "_L" not in file and "_R" not in file]
        assert_nothing_left(folder, "work", "work/scene.blend", "work/out", *made, *files)
    else:
        assert_nothing_left(folder, "work", "work/scene.blend")


SCENES: tuple[str | bytes, ...] = (
    *NAMES[0:24:4],
    "a\\b.blend",
    "a\nb.blend",
    "scene",
    "{blend_name}.blend",
    "x.blend1",
    "#.blend",
    "é.blend",
    b"\xff.blend",
    b"\xed\xa0\x80.blend",
    unicodedata.normalize("NFD", "ünï"),
    "s" * 249 + ".blend",
)
MOVIES = (
    "m.mp4",
    "a b.mp4",
    "m\\n.mp4",
    "é.mkv",
    "{frame}.mp4",
    "m####.mp4",
    "-m.mp4",
    "a/m.mp4",
    "m.mp4.mp4",
    "%d.mp4",
    "m\nn.mp4",
    "m" * 251 + ".mp4",
)


def _outputs() -> Iterator[Case]:
    for number, name in enumerate(NAMES):
        # Animations alone name files of their own below it.
        for command in COMMANDS if number % 2 else ("animate",):
            check = functools.partial(_named, command, name, os.fsdecode(name))
            yield Case(f"{command} into a folder called {repr(name)[:50]}", check)
    for way, output in WAYS:
        for command in COMMANDS:
            yield Case(f"{command} --output={way[:40]!r}", functools.partial(_named, command, way, output))
    for number, name in enumerate(TOO_LONG):
        for command in COMMANDS:
            yield Case(f"{command} into a name too long, {number}", functools.partial(_too_long, command, name))
    for length in (3900, 3990, 4040, 4070, 4090):
        for command in COMMANDS:
            yield Case(f"{command} into a path of {length} bytes", functools.partial(_long_place, command, length))


def cases() -> Iterator[Case]:
    yield from _outputs()
    for name in SCENES:
        yield Case(f"a scene called {repr(name)[:30]}", functools.partial(_of_scene, name))
    for movie in MOVIES:
        yield Case(f"a movie called {movie[:30]!r}", functools.partial(_movie, movie))
