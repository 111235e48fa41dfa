"""Damaged journals and claims. Nobody hangs, nothing outside is touched, nothing whole is lost; a record that cannot be
read is named, its frame is rendered again, and comes out byte for byte as it was."""

from __future__ import annotations

import functools
import json
import os
import re
import shutil
import socket
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from stereo_reproject.sequence.journal_folder import JOURNAL
from tests.hostile.blends import DONE, EITHER, REFUSED, blends_of, private_folder
from tests.hostile.case import Case
from tests.hostile.odd_records import DEEP, LONG, damaged, odd_fields
from tests.hostile.odd_runs import MEMORY, assert_ended
from tests.hostile.program import Outcome, assert_done, names_in, run_program

TITLE = "damaged journals and claims"
SEEN_BEFORE = 88

FRAMES = (1, 2, 3)
LOST = 2
"""The frame whose record, claim or files are damaged; the others are whole, and must stay as they are."""

OPTIONS = ("--fill", "packed", "--no-denoise", "--accuracy", "draft", "--frames", f"{FRAMES[0]}-{FRAMES[-1]}")

SECONDS = 240.0
"""More than STALE_SECONDS, for which a claim is watched that may be somebody's, and what three frames take."""

TOKEN = "0123456789abcdef"
"""Of a run that never was."""

Damage = Callable[[Path], object]
"""What a case does to the folder of frames."""


@dataclass(frozen=True)
class Whole:
    """A folder of finished frames, the scene that they are of, and their files of each frame."""

    blend: Path
    frames: Path

    def record(self, frame: int) -> bytes:
        return (self.frames / JOURNAL / f"{frame:04d}.json").read_bytes()

    def files(self, frame: int) -> tuple[str, ...]:
        return tuple(json.loads(self.record(frame))["files"])

    def pictures(self) -> dict[str, bytes]:
        return {name: (self.frames / name).read_bytes() for frame in FRAMES for name in self.files(frame)}


@functools.cache
def whole_frames() -> Whole:
    """The frames that all cases begin with, made once."""
    folder = private_folder("frames")
    (made,) = blends_of("frames_scene")
    assert not made.unmade, made.unmade
    blend = folder / "shot.blend"
    shutil.copyfile(made.path, blend)
    assert_done(animate(folder, "--movie"))
    return Whole(blend, folder / "frames")


def animate(folder: Path, *options: str) -> Outcome:
    """Render what is missing of the frames in the folder."""
    output = ("--output", folder / "frames", "--resume")
    return run_program("animate", folder / "shot.blend", *output, *OPTIONS, *options, timeout=SECONDS, limits=MEMORY)


def cases() -> Iterable[Case]:
    whole = whole_frames()
    record, files = whole.record(LOST), whole.files(LOST)
    for name, content in damaged(record):
        yield _case(f"record: {name}", _writing(f"{LOST:04d}.json", content), named=_is_no_record(content))
    for name, content in odd_fields(record, files):
        yield _case(f"record: {name}", _writing(f"{LOST:04d}.json", content))
    yield from _odd_places("record", f"{LOST:04d}.json", lambda _: None)
    yield from _more_records(whole)
    yield from _claims(files)
    yield from _runs(files)
    yield from _found(files)
    yield from _unfinished(files)
    yield from _movies()
    yield from _journals()
    yield from _frames(files)


def _is_no_record(content: bytes) -> bool:
    try:
        return not isinstance(json.loads(content), dict)
    except (ValueError, RecursionError):
        return True


def _case(
    name: str,
    damage: Damage,
    *,
    statuses: tuple[int, ...] = DONE,
    words: tuple[str, ...] = (),
    named: bool = False,
    options: tuple[str, ...] = (),
    whole_at_end: bool = True,
) -> Case:
    """The frames are damaged and resumed. named: what is said must name the frame; whole_at_end: all are there then."""

    def check(folder: Path) -> None:
        before = _lay_out(folder, damage)
        outcome = animate(folder, *options)
        assert_ended(outcome, statuses, *words)
        _assert_nothing_lost(folder, before, outcome, whole_at_end=whole_at_end and outcome.status == 0)
        if named:
            said = (outcome.stdout + outcome.stderr).decode("utf-8", "replace")
            pattern = rf"{LOST:04d}\.json|(?m:^.*rendered again.*\b{LOST}\b)"
            assert re.search(pattern, said), f"frame {LOST} is not named: {said!r}"

    return Case(name, check)


@dataclass(frozen=True)
class Before:
    """What must not change: names in the case's folder, the files outside of the frames, and those of whole frames."""

    names: set[str]
    outside: dict[str, bytes]
    kept: dict[str, int]


def _lay_out(folder: Path, damage: Damage) -> Before:
    whole = whole_frames()
    shutil.copyfile(whole.blend, folder / "shot.blend")
    shutil.copytree(whole.frames, folder / "frames")
    outside = folder / "outside"
    outside.mkdir()
    for name in ("canary", "run-away", ".draft.tmp", "notes.claim.txt", "0002.claim.1", "0002.json", "movie-x.json"):
        (outside / name).write_text(f"somebody's {name}")
    damage(folder / "frames")
    others = [name for frame in FRAMES if frame != LOST for name in whole.files(frame)]
    kept = {name: os.lstat(folder / "frames" / name).st_mtime_ns for name in others}
    return Before(names_in(folder), _contents(outside), kept)


def _contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.is_file()}


def _assert_nothing_lost(folder: Path, before: Before, outcome: Outcome, *, whole_at_end: bool) -> None:
    whole = whole_frames()
    outside = _contents(folder / "outside")
    changed = {name for name, content in before.outside.items() if outside.get(name) != content}
    assert not changed, f"changed outside: {changed}: {outcome}"
    for name, moment in before.kept.items():
        path = folder / "frames" / name
        assert path.exists(), f"{name} was whole, and is lost: {outcome}"
        assert path.stat().st_mtime_ns == moment, f"{name} was whole, and was rendered again: {outcome}"
    usual = {f"frames/{name}" for name in names_in(whole.frames)} | {"frames/animation.png", "frames/animation.svg"}
    usual |= {name.replace(f"frames/{JOURNAL}/", "outside/") for name in usual}
    new = names_in(folder) - before.names - usual
    assert not new, f"left behind: {sorted(new)}: {outcome}"
    if not whole_at_end:
        return
    for name, content in whole.pictures().items():
        path = folder / "frames" / name
        assert path.is_file(), f"{name} is no file: {outcome}"
        assert path.read_bytes() == content, f"{name} is another picture: {outcome}"
    rows = json.loads((folder / "frames" / "animation.json").read_bytes())["frames"]
    counted = [row["frame"] for row in rows]
    assert len(counted) == len(set(counted)), f"the report has a frame twice: {counted}"
    assert {1, 3} <= set(counted), f"the report lacks frames: {counted}"


# Damage


def _writing(name: str, content: bytes) -> Damage:
    """The file of this name in the journal has this content."""
    return lambda frames: (frames / JOURNAL / name).write_bytes(content)


def _without_frame(files: Iterable[str], then: Damage) -> Damage:
    """The frame is not there, and to be rendered."""

    def damage(frames: Path) -> None:
        (frames / JOURNAL / f"{LOST:04d}.json").unlink()
        for name in files:
            (frames / name).unlink()
        then(frames)

    return damage


def _clear(path: Path) -> None:
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)


def _bound(path: Path) -> None:
    with socket.socket(socket.AF_UNIX) as one:
        os.chdir(path.parent)
        one.bind(path.name)


PLACES: dict[str, Callable[[Path], object]] = {
    "a FIFO": os.mkfifo,
    "a folder": Path.mkdir,
    "a folder with a file": lambda path: (path.mkdir(), (path / "x").touch()),
    "a link to /dev/zero": lambda path: path.symlink_to("/dev/zero"),
    "a link to /dev/full": lambda path: path.symlink_to("/dev/full"),
    "a link outside": lambda path: path.symlink_to(_outside(path) / "canary"),
    "a link to nowhere outside": lambda path: path.symlink_to(_outside(path) / "new"),
    "a link to itself": lambda path: path.symlink_to(path.name),
    "a socket": _bound,
    "another name of a file outside": lambda path: path.hardlink_to(_outside(path) / "canary"),
}


def _outside(path: Path) -> Path:
    parents = [folder for folder in path.parents if folder.name == "frames"]
    return parents[0].parent / "outside"


def _odd_places(
    kind: str, name: str, first: Damage, statuses: tuple[int, ...] = DONE, options: tuple[str, ...] = ()
) -> Iterator[Case]:
    """In the journal, something else is called as a file of it."""
    for what, make in PLACES.items():

        def damage(frames: Path, make: Callable[[Path], object] = make) -> None:
            first(frames)
            path = frames / JOURNAL / name
            _clear(path)
            make(path)

        # What is no file of ours may be left where it is, and then stands in the way of one.
        in_the_way = kind in ("record", "unfinished file") or "folder" in what
        own = EITHER if in_the_way else statuses
        yield _case(f"{kind} is {what}", damage, statuses=own, options=options)


def _more_records(whole: Whole) -> Iterator[Case]:
    record = whole.record(LOST)
    for name in ("00002.json", "000000002.json", "2.json", "0002.JSON", "0002.json.json", "0002 .json", "٠٠٠٢.json"):
        yield _case(f"another record of the frame: {name}", _writing(name, record))
    for name, content in (("0009.json", b"{"), ("9999999999999999999999.json", b"{}"), ("0009.json", record)):
        yield _case(f"record of a frame that nobody asks for: {name}, {len(content)} bytes", _writing(name, content))
    other = json.loads(record)
    other.update(frame=9, files={"../outside/canary": {"bytes": 17, "sha256": "0" * 64}})
    yield _case("record of a frame that nobody asks for, outside", _writing("0009.json", json.dumps(other).encode()))
    other.update(frame=9, files={"/dev/zero": {"bytes": 0, "sha256": "0" * 64}}, figures={"fractions": 5})
    yield _case(
        "record of a frame that nobody asks for, of a device", _writing("0009.json", json.dumps(other).encode())
    )
    yield _case("ten thousand other files in the journal", _crowded)


def _crowded(frames: Path) -> None:
    for number in range(10_000):
        (frames / JOURNAL / f"note-{number}.txt").touch()


CLAIMS: dict[str, bytes] = {
    "of a run that never was": TOKEN.encode(),
    "NULs, as after a power cut": bytes(16),
    "no UTF-8": b"\xff\xfe\xfd\xfc" * 4,
    "5000 letters": b"a" * 5000,
    "100 MB": b"a" * LONG,
    "a path outside": b"../../outside/canary",
    "an absolute path": b"/dev/zero",
    "a dot": b".",
    "lines": b"\n\n\n",
    "its own name": b"0002.claim.1",
    "a line end behind the token": TOKEN.encode() + b"\n",
    "JSON": b'{"run": "x"}',
    "half a token": TOKEN[:5].encode(),
    "NUL in the token": b"01234567\x0089abcdef",
}


def _claims(files: tuple[str, ...]) -> Iterator[Case]:
    for what, content in CLAIMS.items():
        damage = _without_frame(files, _writing("0002.claim.1", content))
        yield _case(f"claim: {what}", damage)
    for number in ("99999999999999999999999", "-1", "x", "٣", "01", "0", "1.5", ""):
        damage = _without_frame(files, _writing(f"0002.claim.{number}", TOKEN.encode()))
        yield _case(f"claim: its number is {number!r}", damage)
    damage = _without_frame(files, _writing(f"0002.claim.{'9' * 200}", TOKEN.encode()))
    yield _case("claim: its number has 200 digits", damage)
    damage = _without_frame(files, _two_claims)
    yield _case("claim: two, of runs that never were", damage)
    yield _case("claim: of a frame that nobody asks for", _writing("0009.claim.1", b"\xff"))
    yield _case("claim: of a frame that is whole", _writing("0002.claim.1", bytes(16)))
    yield _case("claim: empty", _without_frame(files, _writing("0002.claim.1", b"")))
    yield from _odd_places("claim", "0002.claim.1", _without_frame(files, lambda _: None))


def _two_claims(frames: Path) -> None:
    for number in (1, 2):
        _writing(f"0002.claim.{number}", f"{number:016x}".encode())(frames)


RUNS: dict[str, bytes] = {
    "empty": b"",
    "NULs": bytes(64),
    "no UTF-8": b"\xff" * 64,
    "100 MB": b"9" * LONG,
    "lists in lists": b"[" * DEEP,
    "a dead process of here": b"",
    "no pid": b'{"machine": "x"}\n00000000000000000001',
    "its pid a text": b'{"machine": "x", "pid": "y"}\n00000000000000000001',
    "its pid huge": b'{"machine": "x", "pid": 1e999}\n00000000000000000001',
    "a list": b"[]\n00000000000000000001",
    "a number": b"5",
}


def _runs(files: tuple[str, ...]) -> Iterator[Case]:
    for what, content in RUNS.items():
        yield _case(f"run: {what}", _writing(f"run-{TOKEN}", content))
    for name in ("run-", "run-x", "run-..", "run-" + "f" * 200):
        yield _case(f"run: its file is called {name[:20]}", _writing(name, b"hello"))
    yield from _odd_places("run's file", f"run-{TOKEN}", lambda _: None)

    def claimed(frames: Path) -> None:
        _writing("0002.claim.1", TOKEN.encode())(frames)
        _writing(f"run-{TOKEN}", b'{"machine": "elsewhere", "pid": 1}\n00000000000000000007')(frames)

    yield _case("run: of another machine, which has claimed the frame and never moves", _without_frame(files, claimed))

    def claimed_by_fifo(frames: Path) -> None:
        _writing("0002.claim.1", TOKEN.encode())(frames)
        os.mkfifo(frames / JOURNAL / f"run-{TOKEN}")

    yield _case("run: a FIFO, which has claimed the frame", _without_frame(files, claimed_by_fifo))


FOUND: dict[str, bytes] = {
    "empty": b"",
    "NULs": bytes(64),
    "no UTF-8": b"\xff\xfe",
    "cut": b'{"seconds": 0.0',
    "a list": b"[1, 2]",
    "a number": b"5",
    "none": b"null",
    "NaN": b'{"seconds": NaN, "sync_seconds": NaN, "denoise_seconds": NaN}',
    "infinite": b'{"seconds": Infinity, "sync_seconds": 1e999, "denoise_seconds": 0}',
    "texts": b'{"seconds": "x", "sync_seconds": "y", "denoise_seconds": "z"}',
    "groups": b'{"seconds": {}, "sync_seconds": [], "denoise_seconds": null}',
    "without its names": b"{}",
    "with other names": b'{"colour": 5}',
    "negative": b'{"seconds": -5, "sync_seconds": -5, "denoise_seconds": -1e300}',
    "huge": b'{"seconds": 1e300, "sync_seconds": 1e300, "denoise_seconds": 1e300}',
    "lists in lists": b"[" * DEEP,
    "100 MB": b" " * LONG,
}


def _found(files: tuple[str, ...]) -> Iterator[Case]:
    def name_of(frames: Path) -> str:
        (path,) = (frames / JOURNAL).glob("found-*.json")
        return path.name

    for what, content in FOUND.items():

        def damage(frames: Path, content: bytes = content) -> None:
            _writing(name_of(frames), content)(frames)

        yield _case(f"finding: {what}", _without_frame(files, damage))
    yield from _odd_places("finding", name_of(whole_frames().frames), _without_frame(files, lambda _: None))
    yield _case("finding: of nobody, a FIFO", lambda frames: os.mkfifo(frames / JOURNAL / "found-0.json"))


def _unfinished(files: tuple[str, ...]) -> Iterator[Case]:
    nothing = _without_frame(files, lambda _: None)
    yield from _odd_places("unfinished file", ".0002.json.tmp", nothing)
    yield _case("unfinished file: of a record, half", _without_frame(files, _writing(".0002.json.tmp", b'{"fra')))
    yield _case("unfinished file: of a run", _writing(f".run-{TOKEN}.tmp", b'{"ma'))
    yield _case("unfinished file: of a movie's note", _writing(".movie-0123456789abcdef.json.tmp", b"{"))


def _movies() -> Iterator[Case]:
    def name_of(frames: Path) -> str:
        (path,) = (frames / JOURNAL).glob("movie-*.json")
        return path.name

    how = {"options": ("--movie",)}
    contents = {"empty": b"", "NULs": bytes(64), "none": b"null", "a list": b"[]", "lists in lists": b"[" * DEEP,
                "100 MB": bytes(LONG), "no UTF-8": b"\xff"}  # fmt: skip
    for what, content in contents.items():

        def damage(frames: Path, content: bytes = content) -> None:
            _writing(name_of(frames), content)(frames)

        yield _case(f"movie's note: {what}", damage, statuses=REFUSED, words=("no movie of these frames",), **how)
    yield from _odd_places("movie's note", name_of(whole_frames().frames), lambda _: None, EITHER, ("--movie",))
    yield _case("movie's note: another, a FIFO", lambda frames: os.mkfifo(frames / JOURNAL / "movie-0.json"), **how)


def _journals() -> Iterator[Case]:
    def moved(make: Callable[[Path], object]) -> Damage:
        def damage(frames: Path) -> None:
            shutil.rmtree(frames / JOURNAL)
            for frame in FRAMES:
                for name in whole_frames().files(frame):
                    if frame == LOST:
                        (frames / name).unlink()
            make(frames / JOURNAL)

        return damage

    for what in ("a FIFO", "a link to /dev/zero", "a link to itself", "a socket", "a link outside"):
        yield _case(f"journal is {what}", moved(PLACES[what]), statuses=REFUSED, words=(JOURNAL,))
    yield _case("journal is a file", moved(Path.touch), statuses=REFUSED, words=(JOURNAL,))
    yield _case("journal is a link to a folder outside", _linked_journal, statuses=EITHER)


def _linked_journal(frames: Path) -> None:
    """The journal lies elsewhere, beside files that look like ours and are somebody's."""
    outside = _outside(frames / JOURNAL)
    for path in (frames / JOURNAL).iterdir():
        shutil.copyfile(path, outside / path.name)
    shutil.rmtree(frames / JOURNAL)
    (frames / JOURNAL).symlink_to(outside)


def _frames(files: tuple[str, ...]) -> Iterator[Case]:
    """The frames themselves, and what lies beside them."""

    def instead(name: str, make: Callable[[Path], object]) -> Damage:
        def damage(frames: Path) -> None:
            _clear(frames / name)
            make(frames / name)

        return damage

    for what, make in PLACES.items():
        yield _case(f"frame is {what}", instead(files[0], make), statuses=EITHER)
        yield _case(f"report is {what}", instead("animation.json", make), statuses=EITHER)
    for what, content in {"empty": b"", "NULs": bytes(1164), "cut": b"\x89PNG", "longer": bytes(5_000_000)}.items():
        yield _case(f"frame: {what}", lambda frames, content=content: (frames / files[0]).write_bytes(content))
    yield _case("frame: the other eye's", lambda frames: shutil.copyfile(frames / files[1], frames / files[0]))
    for what, content in {"empty": b"", "lists in lists": b"[" * DEEP, "NULs": bytes(100)}.items():
        yield _case(f"report: {what}", lambda frames, content=content: (frames / "animation.json").write_bytes(content))
