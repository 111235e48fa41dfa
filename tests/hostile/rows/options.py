"""Option values: those that mean nothing are refused before Blender starts, by the option's name; those that mean
something, however oddly they are written, are taken as what they mean, or refused."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from tests.hostile.case import Case
from tests.hostile.program import (
    DEMO,
    PAIR,
    SMALLEST,
    assert_bad_input,
    assert_done,
    assert_interrupted,
    assert_nothing_left,
    assert_one_line_or_done,
    run_program,
    start_program,
)

TITLE = "option values"
SEEN_BEFORE = 199

SCENE = str(DEMO)
RENDER = ("render", SCENE, "--output", "out")
ANIMATE = ("animate", SCENE, "--output", "out")
TRADEOFF = ("tradeoff", SCENE, "--output", "out")
INSPECT = ("inspect", SCENE)

Argument = str | bytes

NO_NUMBER: tuple[Argument, ...] = (
    "",
    " ",
    "\t",
    "\n",
    "nan",
    "-nan",
    "NaN",
    "inf",
    "-inf",
    "Infinity",
    "0x10",
    "0b1",
    "1,5",
    "1.000,5",
    "1'000",
    "1 000",
    "1\u00a0000",
    "½",
    "²",
    "Ⅷ",
    "五",
    "\u22125",
    "1e",
    "1e+",
    "--5",
    "+-5",
    "5+",
    "5;6",
    "1..2",
    "1/2",
    "5j",
    "5%",
    "5px",
    "[5]",
    "'5'",
    "$((1+1))",
    "%d",
    "{0}",
    "None",
    "True",
    "5\u200b",
    "\ufeff5",
    "\u202e5",
    "\U0001f522",
    b"5\xff",
    b"\xc3(",
    "x" * 5000,
)
"""Of these, no number can be made."""

NOT_WHOLE: tuple[Argument, ...] = (
    "5.0",
    "5.",
    ".5",
    "1e3",
    "1_000",
    "1,000",
    " 5",
    "5 ",
    "5\n",
    "5\v",
    "५",
    "५१",
    "５",
    "٣",
    "1" * 19,
    "9" * 4301,
    "-" + "9" * 400,
)

NO_SIZE: tuple[Argument, ...] = (
    "",
    " ",
    "x",
    "16",
    "16x",
    "x16",
    "16x16x16",
    "16xx16",
    "16×16",
    "16*16",
    "16,16",
    "16 x 16",
    "16x 16",
    "16x16 ",
    "16x16\n",
    "\n16x16",
    "(16,16)",
    "16x-16",
    "-16x16",
    "+16x16",
    "16.0x16.0",
    "1e2x16",
    "0x10x0x10",
    "16_0x16",
    "१६x१६",
    "１６x１６",
    "16х16",
    "16\0301x16".replace("\0301", "\u0301"),
    "nanxnan",
    "infxinf",
    "0x0",
    "0x16",
    "16x0",
    "3x16",
    "16x3",
    "1x1",
    "65537x4",
    "4x65537",
    "99999x1",
    "4294967296x4294967296",
    "9" * 18 + "x4",
    "9" * 19 + "x4",
    "9" * 5000 + "x" + "9" * 5000,
    "50%",
    "1920x1080@60",
    "1920x1080p",
    "HD",
    "{16}x{16}",
    b"16x\xff16",
    b"\xed\xa0\x80x16",
)

NO_FRAMES: tuple[Argument, ...] = (
    "",
    " ",
    ",",
    "1,",
    ",1",
    "1,,2",
    "-",
    "1-",
    "-1",
    "-5-3",
    "1--3",
    "1-2-3",
    "5-1",
    "5-1:1",
    "1-5:0",
    "1-5:-1",
    "1-5:",
    "1-5::2",
    "1:2",
    ":2",
    "1-5:2:3",
    "1..5",
    "1…5",
    "1–5",
    "1−5",
    "1 5",
    "1;5",
    "1-5x2",
    "[1-5]",
    "{1..5}",
    "1-5:1.5",
    "1.0-5.0",
    "0x1-0x5",
    "1e0-5e0",
    "1_0-2_0",
    "all",
    "nan-nan",
    "1-inf",
    "#",
    "####",
    "1048575",
    "0-1048575",
    "1-999999999",
    "1-9999999999",
    "999999999-999999999",
    "1" * 10,
    "9" * 5000,
    "1-5\x00".replace("\x00", "\x01"),
    "1-5\u200b",
    b"1-\xff5",
)

NO_EVERY: tuple[Argument, ...] = (
    "",
    " ",
    "0",
    "00",
    "01",
    "+1",
    "-1",
    "1.5",
    "1e3",
    "every",
    "every=",
    "every=0",
    "every=-1",
    "every=1.5",
    "every= 6",
    "every=6 ",
    "Every=6",
    "every=every=6",
    "every:6",
    "every=6,7",
    "each=6",
    "6=every",
    "9" * 10,
    "every=" + "9" * 5000,
    "1\n",
    b"every=\xff",
)

NO_CHOICE: tuple[Argument, ...] = (
    "",
    " ",
    "0",
    "none",
    "--",
    "draft\n",
    b"\xff",
    "x" * 5000,
    "*",
    "../draft",
    "dr\u0430ft",
)


@dataclass(frozen=True)
class Refusal:
    """Arguments that are refused before anything is done, and what the line about it has in it."""

    name: str
    arguments: tuple[Argument, ...]
    words: tuple[str, ...]


def _named(command: tuple[str, ...], *arguments: Argument) -> str:
    shown = [repr(argument)[:60] for argument in arguments]
    return " ".join((command[0], *shown))


def _values(command: tuple[str, ...], option: str, values: Iterable[Argument], *more: Argument) -> Iterator[Refusal]:
    """Each value of an option, in turn as one argument and as two."""
    for number, value in enumerate(values):
        dashed = value[:1] in ("-", b"-")
        if number % 2 or dashed:
            name = option.encode() + b"=" + value if isinstance(value, bytes) else f"{option}={value}"
            given: tuple[Argument, ...] = (name,)
        else:
            given = (option, value)
        yield Refusal(_named(command, *given), (*command, *more, *given), (option,))


def _numbers() -> Iterator[Refusal]:
    whole = (*NO_NUMBER, *NOT_WHOLE)
    yield from _values(RENDER, "--frame", (*whole, "-1048575", "1048575", "2147483648", "1-5", "1,2"))
    yield from _values(ANIMATE, "--samples", (*whole[::2], "0", "-0", "-1", "16777217", "4294967297"))
    yield from _values(INSPECT, "--seed", (*whole[1::2], "-1", "2147483648", "4294967296"))
    yield from _values(RENDER, "--interocular", (*NO_NUMBER, "-0.065", "-1e-300", "1e309", "0.065m", "6.5cm", "auto"))
    yield from _values(ANIMATE, "--convergence", (*NO_NUMBER[::2], "0", "-0", "0e5", "1e-400", "-2", "2m", "1e400"))
    yield from _values(RENDER, "--tolerance", (*NO_NUMBER[1::2], "1", "1.0", "0.999", "0", "-1.1", "1e999", "110%"))
    yield from _values(INSPECT, "--grid-threshold", (*NO_NUMBER[::3], "-1", "-1e-9", "1e999", "1'", "0.1deg"))


def _shapes() -> Iterator[Refusal]:
    yield from _values(RENDER, "--size", NO_SIZE)
    yield from _values(ANIMATE, "--frames", NO_FRAMES)
    yield from _values(ANIMATE, "--compare", NO_EVERY)


def _choices() -> Iterator[Refusal]:
    yield from _values(
        RENDER, "--mode", (*NO_CHOICE[:4], "Off-Axis", "offaxis", "OFFAXIS", "toe_in", "off-axis,parallel")
    )
    yield from _values(RENDER, "--source", (*NO_CHOICE[3:6], "LEFT", "both", "l", "cycles", "center"))
    yield from _values(RENDER, "--source-engine", (*NO_CHOICE[5:8], "CYCLES", "workbench", "BLENDER_EEVEE", "left"))
    yield from _values(RENDER, "--accuracy", (*NO_CHOICE, "Draft", "custom", "medium", "1.1", "exact,high"))
    yield from _values(RENDER, "--fill", (*NO_CHOICE[2:5], "AUTO", "none", "packed,card", "card packed"))
    yield from _values(RENDER, "--packed-by", (*NO_CHOICE[2:5], "OSL", "none", "osl,portal"))
    yield from _values(RENDER, "--interpolation", (*NO_CHOICE[:2], "Cubic", "nearest", "bicubic", "3"))
    yield from _values(RENDER, "--warp", (*NO_CHOICE[6:9], "GPU", "cuda", "0", "numpy,gpu"))
    yield from _values(ANIMATE, "--layout", (*NO_CHOICE, "side by side", "sbs", "side_by_side", "anaglyph", "_LR"))
    yield from _values(TRADEOFF, "--only", (*NO_CHOICE[:9], "Full", "holes", "full,card"))


def _structures() -> Iterator[Refusal]:
    """Options that are missing, incomplete, given to the wrong command, at odds with another, or no options."""
    for command, arguments, word in (
        ((), (), "COMMAND"),
        ((), ("",), "invalid choice"),
        ((), ("Render",), "invalid choice"),
        ((), ("render ",), "invalid choice"),
        ((), ("--output", "out"), "COMMAND"),
        ((), ("--",), "COMMAND"),
        ((), ("-h=5",), ""),
        ((), ("--version=1",), "--version"),
        ((), (b"\xff",), "invalid choice"),
        ((), ("ren\nder",), "invalid choice"),
        ((), ("render",), "SCENE.blend"),
        ((), ("render", SCENE), "--output"),
        ((), ("render", "--output", "out"), "SCENE.blend"),
        ((), ("render", SCENE, "--output"), "--output"),
        ((), ("render", SCENE, "--output", ""), "--output"),
        ((), ("render", SCENE, "--output="), "--output"),
        ((), ("animate", SCENE, "--output="), "--output"),
        ((), ("render", SCENE, "--output", "--quiet"), "--output"),
        ((), ("render", SCENE, SCENE, "--output", "out"), "unrecognized"),
        ((), ("render", SCENE, "--", "--output", "out"), ""),
        (RENDER, ("--", "--quiet"), "--quiet"),
        (RENDER, ("--siz", "16x16"), "--siz"),
        (RENDER, ("--SIZE", "16x16"), "--SIZE"),
        (RENDER, ("-size", "16x16"), "-size"),
        (RENDER, ("—size", "16x16"), "unrecognized"),
        (RENDER, ("--size:16x16",), "--size:16x16"),
        (RENDER, ("--size 16x16",), "--size 16x16"),
        (RENDER, ("/size", "16x16"), "unrecognized"),
        (RENDER, ("size=16x16",), "unrecognized"),
        (RENDER, ("--size", "16x16", "16x16"), "unrecognized"),
        (RENDER, ("--size", "0x0", "--size", "16x16"), "--size"),
        (RENDER, ("--size", "--samples", "1"), "--size"),
        (RENDER, ("--quiet=yes",), "--quiet"),
        (RENDER, ("--quiet=",), "--quiet"),
        (RENDER, ("--compare=every=2",), "--compare"),
        (RENDER, ("--compare", "every=2"), "unrecognized"),
        (RENDER, ("--no-quiet",), "--no-quiet"),
        (RENDER, ("--denoise=no",), "--denoise"),
        (RENDER, ("--denoise", "off"), "unrecognized"),
        (RENDER, ("--denoise", "--no-denoise"), "not allowed"),
        (RENDER, ("--accuracy", "draft", "--tolerance", "1.1"), "not allowed"),
        (RENDER, ("--tolerance", "1.1", "--accuracy", "draft"), "not allowed"),
        (RENDER, ("--frames", "1-3"), "--frames"),
        (RENDER, ("--resume",), "--resume"),
        (RENDER, ("--layout", "side-by-side"), "--layout"),
        (RENDER, ("--json",), "--json"),
        (RENDER, ("--only", "full"), "--only"),
        (RENDER, ("@options.txt",), "unrecognized"),
        (RENDER, ("-v",), "-v"),
        (RENDER, (b"--\xff",), "unrecognized"),
        (RENDER, ("--\x1b[31m",), "unrecognized"),
        (ANIMATE, ("--resume", "--overwrite"), "not allowed"),
        (ANIMATE, ("--overwrite", "--resume"), "not allowed"),
        (ANIMATE, ("--frame", "1", "--frames", "1-3"), "--frames"),
        (ANIMATE, ("--frame=-1",), "frames must be from 0"),
        (ANIMATE, ("--frames",), "--frames"),
        (ANIMATE, ("--frames", "1", "2"), "unrecognized"),
        (ANIMATE, ("--frames", "1-3", "--resume=yes"), "--resume"),
        (ANIMATE, ("--holes=all",), "--holes"),
        (ANIMATE, ("--movie", "a.mp4", "b.mp4"), "unrecognized"),
        (ANIMATE, ("--compare",), "--compare"),
        (ANIMATE, ("--json",), "--json"),
        (INSPECT, ("--output", "out"), "--output"),
        (INSPECT, ("--json=file.json",), "--json"),
        (INSPECT, ("--quiet",), "--quiet"),
        (INSPECT, ("--compare",), "--compare"),
        (TRADEOFF, ("--only",), "--only"),
        (TRADEOFF, ("--only", "full", "nothing"), "--only"),
        (TRADEOFF, ("--accuracy", "draft"), "--accuracy"),
        (TRADEOFF, ("--fill", "packed"), "--fill"),
        (TRADEOFF, ("--compare",), "--compare"),
    ):
        yield Refusal(_named(command or ("",), *arguments).replace(SCENE, "SCENE"), (*command, *arguments), (word,))


def _scenes() -> Iterator[Refusal]:
    """The scene's place, with what is none."""
    for value in (
        "",
        " ",
        ".",
        "..",
        "/",
        "-",
        "//",
        "//cornell-box.blend",
        "~/cornell-box.blend",
        "$HOME/x.blend",
        "*.blend",
        "file:///x.blend",
        "https://example.invalid/x.blend",
        f"{SCENE}/x.blend",
        f"{SCENE} ",
        f"{SCENE}\n",
        f"{SCENE}@2",
        f"{SCENE}?frame=1",
        f"{SCENE}1",
        f'"{SCENE}"',
        SCENE.upper(),
        SCENE.replace("/", "\\"),
        "/dev/null",
        "/dev/zero",
        "/dev/stdin",
        "/proc/self/mem",
        "/proc/self/environ",
        "x" * 256,
        "x/" * 2100,
        "Makefile\x07",
        b"\xff.blend",
    ):
        yield Refusal(_named(("the scene",), value).replace(SCENE, "SCENE"), ("render", value, "--output", "out"), ())


def refusals() -> list[Refusal]:
    """All that are refused before a worker starts, in whatever folder."""
    found = [*_numbers(), *_shapes(), *_choices(), *_structures(), *_scenes()]
    return list({refusal.name: refusal for refusal in found}.values())


def _is_refused(refusal: Refusal, folder: Path) -> None:
    outcome = run_program(*refusal.arguments, cwd=folder, timeout=30)
    assert_bad_input(outcome, *refusal.words)
    assert not outcome.stdout, f"it prints, though it is refused: {outcome}"
    assert len(outcome.stderr) < 30000, f"{len(outcome.stderr)} bytes are no one line: {outcome}"
    assert_nothing_left(folder)


Check = Callable[[dict[str, Any]], bool]


def _pair(folder: Path, *options: Argument, asked: Check | None, output: Argument = "out") -> None:
    """A pair is made, and its report says that it is the one that was asked for; without `asked`, it may be refused."""
    # What follows replaces what comes before.
    named = b"--output=" + output if isinstance(output, bytes) else f"--output={output}"
    outcome = run_program("render", SCENE, named, *SMALLEST, *options, cwd=folder, timeout=300)
    if asked is None and outcome.status != 0:
        assert_one_line_or_done(outcome)
        assert_nothing_left(folder)
        return
    assert_done(outcome)
    files = (*PAIR, "difference.png") if "--compare" in options else PAIR
    assert_nothing_left(folder, os.fsdecode(output), *(f"{os.fsdecode(output)}/{name}" for name in files))
    report = json.loads((folder / os.fsdecode(output) / "report.json").read_text())
    assert asked is None or asked(report), f"the report is of something else: {json.dumps(report)[:600]}"


def _scalar(*keys: str, near: Any) -> Check:
    def check(report: dict[str, Any]) -> bool:
        value: Any = report
        for key in keys:
            value = value[key]
        return abs(value - near) <= 1e-6 * abs(near) if isinstance(near, float) else value == near

    return check


def _size(width: int, height: int) -> Check:
    return _scalar("size", near=[width, height])


def _eyes(near: float) -> Check:
    return _scalar("stereo", "interocular_distance", near=near)


def _plane(near: float) -> Check:
    return _scalar("stereo", "convergence_distance", near=near)


def _odd_pairs() -> Iterator[tuple[tuple[Argument, ...], Check | None]]:
    """Options of a pair that mean something, and what they mean; None where a refusal is an answer as well."""
    yield ("--frame=+5",), _scalar("frame", near=5)
    yield ("--frame", "005"), _scalar("frame", near=5)
    yield ("--frame=-0",), _scalar("frame", near=0)
    yield ("--frame", "-5"), _scalar("frame", near=-5)
    yield ("--frame=1048574",), _scalar("frame", near=1048574)
    yield ("--frame=-1048574",), _scalar("frame", near=-1048574)
    yield ("--frame=1", "--frame=2"), _scalar("frame", near=2)
    yield ("--size", "4x4"), _size(4, 4)
    yield ("--size", "5x7"), _size(5, 7)
    yield ("--size", "16X16"), _size(16, 16)
    yield ("--size=0016x0000000016",), _size(16, 16)
    yield ("--size=16x16", "--size=8x8"), _size(8, 8)
    yield ("--size", "4x1024"), _size(4, 1024)
    yield ("--size", "4096x4"), _size(4096, 4)
    yield ("--size", "65536x4"), None
    yield ("--size", "4x65536"), None
    yield ("--samples", "0003"), _scalar("samples", near=3)
    yield ("--samples=+2",), _scalar("samples", near=2)
    yield ("--seed", "0"), lambda _: True
    yield ("--seed", "2147483647"), lambda _: True
    yield ("--seed=-0",), lambda _: True
    yield ("--interocular", "0"), _eyes(0.0)
    yield ("--interocular=-0",), _eyes(0.0)
    yield ("--interocular=-0.0e0",), _eyes(0.0)
    yield ("--interocular", ".1"), _eyes(0.1)
    yield ("--interocular", "1."), _eyes(1.0)
    yield ("--interocular", "1E-1"), _eyes(0.1)
    yield ("--interocular", "+0.1"), _eyes(0.1)
    yield ("--interocular", f"0.{'0' * 300}1"), None
    yield ("--interocular", f"0.1{'0' * 5000}"), _eyes(0.1)
    yield ("--interocular", " 0.1 "), None
    yield ("--interocular", "1_0"), None
    yield ("--interocular", "०.१"), None
    yield ("--interocular", "1e-7"), None
    yield ("--interocular", "1e-45"), None
    yield ("--interocular", "1e-400"), None
    yield ("--interocular", "100"), _eyes(100.0)
    yield ("--interocular", "1e5"), None
    yield ("--interocular", "1e10"), None
    yield ("--interocular", "1e20"), None
    yield ("--interocular", "3.4e38"), None
    yield ("--interocular", "1e39"), None
    yield ("--interocular", "1.7976931348623157e308"), None
    yield ("--convergence", "0.00001"), None
    yield ("--convergence", "1e-20"), None
    yield ("--convergence", "1e-45"), None
    yield ("--convergence", "5e-324"), None
    yield ("--convergence", "1e5"), _plane(1e5)
    yield ("--convergence", "1e20"), None
    yield ("--convergence", "1e39"), None
    yield ("--convergence", "1e308"), None
    yield ("--convergence", "1e-5", "--interocular", "1e5"), None
    yield ("--mode", "parallel", "--convergence", "1e-20"), None
    yield ("--mode", "toe-in", "--convergence", "1e-5"), None
    yield ("--mode", "toe-in", "--interocular", "1e5"), None
    yield ("--mode", "toe-in", "--interocular", "0"), _eyes(0.0)
    yield ("--mode", "toe-in", "--interocular", "1e20", "--convergence", "1e-20"), None
    yield ("--grid-threshold", "0"), lambda _: True
    yield ("--grid-threshold=-0",), lambda _: True
    yield ("--grid-threshold", "5e-324"), lambda _: True
    yield ("--grid-threshold", "1e308"), lambda _: True
    yield ("--grid-threshold", "1e308", "--mode", "toe-in"), lambda _: True
    yield ("--quiet", "--quiet"), lambda _: True
    yield ("--no-denoise", "--no-denoise"), lambda _: True
    yield ("--source", "right", "--source=left"), _scalar("stereo", "source", near="left")
    yield ("--source", "right", "--size", "5x4"), _scalar("stereo", "source", near="right")
    yield ("--fill", "card", "--size", "4x4"), _scalar("fill", "method", near="card")
    yield ("--fill", "full", "--size", "4x4"), _scalar("fill", "method", near="full")
    yield ("--warp", "gpu", "--size", "4x4"), lambda report: report["warp"]["used"] in ("numpy", "gpu")
    yield ("--interpolation", "cubic", "--size", "4x4"), lambda _: True
    yield ("--accuracy", "exact", "--size", "4x4"), _scalar("accuracy", near="exact")
    yield ("--accuracy", "exact", "--interocular", "0"), _scalar("accuracy", near="exact")
    yield ("--compare", "--size", "4x4", "--interocular", "0"), None


def _tolerances(folder: Path, value: str) -> None:
    options = ["--size", "16x16", "--samples", "2", "--no-denoise", "--tolerance", value]
    outcome = run_program("render", SCENE, "--output", "out", *options, cwd=folder)
    assert_done(outcome)
    report = json.loads((folder / "out" / "report.json").read_text())
    assert report["estimate"]["promise"] == float(value), f"another promise: {report['estimate']}"


def _huge(folder: Path) -> None:
    """A picture of 4 billion pixels would take days: it can be stopped, and nothing of it stays."""
    with start_program("render", SCENE, "--output", "out", *SMALLEST, "--size=65536x65536", cwd=folder) as run:
        run.wait_for(lambda: list(folder.glob("out/.stereo_reproject-*/blender.log")))
        with contextlib.suppress(subprocess.TimeoutExpired):
            run.process.wait(3.0)
        run.process.send_signal(signal.SIGINT)
        outcome = run.end(60)
    if outcome.status in (1, 2):
        assert_one_line_or_done(outcome)
    else:
        assert_interrupted(outcome, signal.SIGINT)
    assert_nothing_left(folder)


def _frames(folder: Path, value: Argument, wanted: tuple[int, ...] | None, *options: str) -> None:
    """Frames that are named oddly are those, or are refused."""
    argument = b"--frames=" + value if isinstance(value, bytes) else f"--frames={value}"
    outcome = run_program(*ANIMATE, *SMALLEST, "--size", "8x8", argument, *options, cwd=folder, timeout=300)
    if wanted is None and outcome.status != 0:
        assert_one_line_or_done(outcome)
        assert_nothing_left(folder)
        return
    assert_done(outcome)
    made = sorted(int(path.stem.partition("_")[0]) for path in (folder / "out").glob("*_L.*"))
    assert wanted is None or made == list(wanted), f"other frames than {wanted}: {made}"


def _delivered(folder: Path, *options: Argument, made: str | None) -> None:
    """How frames are delivered; made is a file that is there then, None where it may be refused."""
    outcome = run_program(*ANIMATE, *SMALLEST, "--frames", "1-2", *options, cwd=folder, timeout=300)
    assert_one_line_or_done(outcome)
    if made is not None:
        assert_done(outcome)
        assert (folder / made).stat().st_size, f"{made} is empty"
    if outcome.status:
        assert_nothing_left(folder)


def _odd_deliveries() -> Iterator[tuple[tuple[Argument, ...], str | None]]:
    yield ("--layout", "Side-By-Side"), "out/0001.png"
    yield ("--layout", "INDIVIDUAL"), "out/0001_L.png"
    yield ("--layout", "side-by-side", "--layout", "top-bottom"), "out/0002.png"
    yield ("--format", "jpeg", "--layout", "anaglyph-dubois"), "out/0001.jpg"
    yield ("--format", "oPeN_eXr"), "out/0001_L.exr"
    yield ("--format", ""), None
    yield ("--format", " "), None
    yield ("--format", ".png"), None
    yield ("--format", "PNG\n"), None
    yield ("--format", "FFMPEG"), None
    yield ("--format", "AVI_JPEG"), None
    yield ("--format", "x" * 5000), None
    yield ("--format", b"\xff"), None
    yield ("--format", "ßPNG"), None
    yield ("--format", "IRIS", "--layout", "multi-view"), None
    yield ("--format", "OPEN_EXR_MULTILAYER", "--layout", "side-by-side"), None
    yield ("--format", "OPEN_EXR", "--layout", "anaglyph-dubois"), None
    yield ("--format", "HDR", "--layout", "interlace-rows"), None
    yield ("--movie", ""), None
    yield ("--movie", " "), None
    yield ("--movie", "."), None
    yield ("--movie", "x.txt"), None
    yield ("--movie", "x.mp4/"), None
    yield ("--movie", "x"), None
    yield ("--movie", ".mp4"), None
    yield ("--movie", "--", "x"), None
    yield ("--movie", "x.MP4", "--layout", "side-by-side", "--size", "64x36"), None
    yield ("--movie", "x.webm", "--layout", "anaglyph-red-cyan", "--size", "4x4"), None
    yield ("--movie", "odd.mp4", "--size", "5x7"), None
    yield ("--compare=1",), "out/0002_R.png"
    yield ("--compare", "every=999999999"), "out/0002_R.png"
    yield ("--holes", "--holes", "--size", "4x4"), "out/holes/0001.png"
    yield ("--frames", "1-2", "--frames", "3"), "out/0003_L.png"


def _odd_outputs() -> Iterator[Argument]:
    yield from ("--quiet", "-", "-1", "=", "a=b", "--output", "1")


def _inspection(folder: Path, *options: str, bench: bool = False) -> None:
    """An inspection in JSON is JSON, and leaves nothing."""
    outcome = run_program(*INSPECT, *options, cwd=folder)
    assert_done(outcome)
    if "--json" in options:
        json.loads(outcome.stdout)
    assert_nothing_left(folder)


def cases() -> Iterable[Case]:
    for refusal in refusals():
        yield Case(refusal.name, partial(_is_refused, refusal))
    for options, asked in _odd_pairs():
        yield Case(_named(RENDER, *options), _bound(_pair, *options, asked=asked))
    for output in _odd_outputs():
        yield Case(f"render --output={os.fsdecode(output)}", _bound(_pair, asked=lambda _: True, output=output))
    for value in ("1.0000000001", "1.1", "1e300", "1.7976931348623157e308"):
        yield Case(f"a tolerance of {value}", partial(_with, _tolerances, value))
    yield Case("a picture that takes days is stopped", _huge)
    for value, wanted in (
        ("1,1,1", (1,)),
        ("3,1,2", (1, 2, 3)),
        ("1-3,2", (1, 2, 3)),
        (" 1 , 2 ", (1, 2)),
        ("0", (0,)),
        ("-0", None),
        ("1048574", (1048574,)),
        ("007", (7,)),
        ("1-1", (1,)),
        ("1-1:5", (1,)),
        ("1-10:9", (1, 10)),
        ("1-2:999999999", (1,)),
        ("1\n", None),
        ("१", None),
        ("１-２", None),
        ("1-2," * 20000 + "1", (1, 2)),
    ):
        yield Case(f"animate --frames={value[:30]!r}", partial(_with, _frames, value, wanted))
    for options, made in _odd_deliveries():
        yield Case(_named(ANIMATE, *options), _bound(_delivered, *options, made=made))
    for inspected in (("--json", "--json"), ("--no-sketch", "--json"), ("--size", "4x4", "--no-sketch")):
        yield Case(_named(INSPECT, *inspected), partial(_with, _inspection, *inspected))


def _with(check: Callable[..., None], *arguments: Any) -> None:
    """`check` with the folder before these arguments: `partial` alone would put it behind them."""
    *given, folder = arguments
    check(folder, *given)


def _bound(check: Callable[..., None], *arguments: Any, **named: Any) -> Callable[[Path], None]:
    return lambda folder: check(folder, *arguments, **named)
