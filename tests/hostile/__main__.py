"""Attempts to break the program, a process and a folder for each: make hostile.

    python -m tests.hostile [ROW ...] [--match TEXT] [--jobs N] [--json FILE] [--list] [--keep]

Failures are printed as they come, at the end a table. Exit status: 0 all passed, 1 some did not, 2 bad input, 130
interrupted. docs/reliability.md says what the rows are.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import multiprocessing
import os
import shutil
import signal
import sys
import tempfile
import time
import traceback
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass
from multiprocessing.connection import Connection, wait
from pathlib import Path

from tests.hostile.case import Case, Row, load_row, row_names
from tests.hostile.program import CASE_MARK, end_all

CASE_SECONDS = 900.0
"""A case that takes longer has failed. Its own runs have limits of their own, so none should."""

JOBS = 2
INTERRUPTED_STATUS = 130


@dataclass(frozen=True)
class Result:
    """error is empty where the case passed; folder is where what it left is, if that is kept."""

    row: str
    case: str
    seconds: float
    error: str
    folder: str


class _Attempt:
    """A case under way, in a process of its own: what it mounts, limits or changes goes with that."""

    def __init__(self, row: Row, case: Case, folder: Path) -> None:
        self.row, self.case, self.folder = row, case, folder
        self._started = time.monotonic()
        self.ended, theirs = multiprocessing.Pipe(duplex=False)
        # A fork: checks are closures, and need not be picklable.
        fork = multiprocessing.get_context("fork")
        self._process = fork.Process(target=_try, args=(case, folder, theirs))
        self._process.start()
        theirs.close()

    @property
    def is_late(self) -> bool:
        return time.monotonic() - self._started > CASE_SECONDS

    def result(self, *, keep: bool) -> Result:
        """How it went. The folder is removed, unless it is to be kept or the case failed and it is."""
        error = f"not done after {CASE_SECONDS:.0f} s"
        if not self.is_late or self.ended.poll():
            try:
                error = self.ended.recv()
            except EOFError:
                self._process.join()
                error = f"the case itself ended with {self._process.exitcode}"
        self.stop()
        if not keep:
            _remove(self.folder)
        seconds = time.monotonic() - self._started
        return Result(self.row.name, self.case.name, seconds, error, str(self.folder) if keep else "")

    def stop(self) -> None:
        with contextlib.suppress(OSError):
            os.killpg(self._process.pid or 0, signal.SIGKILL)
        self._process.join()
        # A case that was ended has not ended its runs.
        end_all(CASE_MARK, str(self.folder))


def _try(case: Case, folder: Path, answer: Connection) -> None:
    os.setpgid(0, 0)
    # Whoever started this in the background may have switched the second off, and the runs of a case inherit that.
    for signum in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(signum, signal.SIG_DFL)
    os.chdir(folder)
    os.environ[CASE_MARK] = str(folder)
    error = ""
    try:
        case.check(folder)
    except AssertionError as broken:
        error = str(broken) or _last_line(broken)
    except BaseException as odd:  # noqa: BLE001 - a case that breaks is a failure, and the others go on
        error = f"the case is wrong: {''.join(traceback.format_exception(odd))}"
    answer.send(error)
    answer.close()
    # Without the parent's own clean-up.
    os._exit(0)


def _last_line(broken: AssertionError) -> str:
    last = traceback.extract_tb(broken.__traceback__)[-1]
    return f"{Path(last.filename).name}, line {last.lineno}: {last.line}"


def _remove(folder: Path) -> None:
    """Whatever rights a case has taken away from it."""
    for place, folders, _ in os.walk(folder):
        for name in folders:
            path = Path(place) / name
            if not path.is_symlink():
                with contextlib.suppress(OSError):
                    path.chmod(0o700)
    shutil.rmtree(folder, ignore_errors=True)


def attempt(rows: Sequence[Row], place: Path, *, jobs: int, keep: bool) -> Iterator[Result]:
    """The results as they come in, of so many cases at once."""
    left = iter([(row, case) for row in rows for case in row.cases])
    running: list[_Attempt] = []
    try:
        for number, (row, case) in enumerate(left):
            folder = place / f"{row.name}-{number}"
            folder.mkdir()
            running.append(_Attempt(row, case, folder))
            if len(running) >= jobs:
                yield from _ended(running, keep=keep)
        while running:
            yield from _ended(running, keep=keep)
    finally:
        for one in running:
            one.stop()


def _ended(running: list[_Attempt], *, keep: bool) -> Iterator[Result]:
    """Those that have ended, at least one; they are taken out of `running`."""
    done: list[_Attempt] = []
    while not done:
        ready = wait([one.ended for one in running], timeout=1.0)
        done = [one for one in running if one.ended in ready or one.is_late]
    for one in done:
        running.remove(one)
        yield one.result(keep=keep)


def table(rows: Iterable[Row], results: Sequence[Result]) -> str:
    """Each row with the number of cases tried and passed."""
    lines = [f"{'row':<12} {'':<44} {'first round':>11} {'tried':>6} {'passed':>6}"]
    for row in rows:
        mine = [result for result in results if result.row == row.name]
        passed = sum(not result.error for result in mine)
        lines.append(f"{row.name:<12} {row.title:<44} {row.seen_before:>11} {len(mine):>6} {passed:>6}")
    return "\n".join(lines)


def _chosen(names: Sequence[str], match: str) -> list[Row]:
    rows = []
    for row in map(load_row, names or row_names()):
        cases = tuple(case for case in row.cases if match in case.name)
        if cases:
            rows.append(Row(row.name, row.title, row.seen_before, cases))
    return rows


def _parse(argv: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m tests.hostile", description="Try to break the program.")
    parser.add_argument("rows", nargs="*", metavar="ROW", help=f"only these rows: {', '.join(row_names())}")
    parser.add_argument("--match", metavar="TEXT", default="", help="only cases whose name holds this text")
    parser.add_argument("--jobs", metavar="N", type=int, default=JOBS, help="cases at once (%(default)s)")
    parser.add_argument("--json", metavar="FILE", type=Path, help="also write every result into this file")
    parser.add_argument("--list", action="store_true", help="name the cases, and try none")
    parser.add_argument("--keep", action="store_true", help="keep the folders of all cases, and say where they are")
    arguments = parser.parse_args(argv)
    unknown = sorted(set(arguments.rows) - set(row_names()))
    if unknown:
        parser.error(f"there is no row {', '.join(unknown)}; there are {', '.join(row_names())}")
    if arguments.jobs < 1:
        parser.error("--jobs must be at least 1")
    return arguments


def _interrupt(_signum: int, _frame: object) -> None:
    raise KeyboardInterrupt


def main(argv: Sequence[str] | None = None) -> int:
    arguments = _parse(argv)
    # A script that starts it in the background has switched the first of them off.
    for signum in (signal.SIGINT, signal.SIGTERM):
        signal.signal(signum, _interrupt)
    # The user's own files are neither read nor written.
    os.environ["STEREO_REPROJECT_USER_FOLDER"] = ""
    rows = _chosen(arguments.rows, arguments.match)
    if arguments.list:
        for row in rows:
            print(*(f"{row.name}: {case.name!r}" for case in row.cases), sep="\n")
        return 0
    place = Path(tempfile.mkdtemp(prefix="stereo-reproject-hostile-"))
    # Cases that give up root's rights must get to their folders.
    place.chmod(0o755)
    started, results = time.monotonic(), []
    try:
        for result in attempt(rows, place, jobs=arguments.jobs, keep=arguments.keep):
            results.append(result)
            if result.error:
                print(f"FAILED {result.row}: {result.case!r}: {result.error}", flush=True)
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        return INTERRUPTED_STATUS
    finally:
        if not arguments.keep:
            _remove(place)
    print(table(rows, results))
    print(f"{time.monotonic() - started:.0f} s{f', folders in {place}' if arguments.keep else ''}")
    if arguments.json:
        arguments.json.write_text(json.dumps([asdict(result) for result in results], indent=1), encoding="utf-8")
    return int(any(result.error for result in results))


if __name__ == "__main__":
    sys.exit(main())
