"""The process that counts a run's number up as long as the run's process holds its standard input open, and then
removes what the run may have left; see `runs`."""

from __future__ import annotations

import contextlib
import os
import sys
import threading
from pathlib import Path

from ..files import is_regular, read_small
from ..sequence.runs import BEAT_DIGITS, BEAT_SECONDS, RUN_BYTES, LiveRuns


def main() -> None:
    """Count up the number in the run's file, whose path is the argument, every BEAT_SECONDS until standard input ends:
    then the run is over or dead. At last remove that file and what dead runs have left."""
    path = Path(sys.argv[1])
    ended = threading.Event()
    threading.Thread(target=_wait_for_end, args=(ended,), daemon=True).start()
    facts, beat = b"", 0
    while not ended.wait(BEAT_SECONDS):
        beat += 1
        # A drive that is away for a moment may come back.
        with contextlib.suppress(OSError):
            facts = _facts(path) or facts
            _write_number(path, facts, f"{beat:0{BEAT_DIGITS}}".encode("ascii"))
    LiveRuns(path.parent).clear(path.name.removeprefix("run-"))
    with contextlib.suppress(OSError):
        path.unlink(missing_ok=True)


def _facts(path: Path) -> bytes:
    """Return the content of the run's file without the number at its end. It is read each time, because it changes when
    the run settles. b"" where the file is missing."""
    with contextlib.suppress(FileNotFoundError):
        return read_small(path, RUN_BYTES)[:-BEAT_DIGITS]
    return b""


def _write_number(path: Path, facts: bytes, number: bytes) -> None:
    """Write the number over the one at the end of the run's file. A missing file is made anew from `facts` (other runs
    may have removed it, when this machine slept); anything that is no regular file is left alone."""
    if os.path.lexists(path) and not is_regular(path):
        # Somebody else's by now, and perhaps one that never answers.
        return
    try:
        with path.open("r+b") as file:
            # Over the number that is there: a full disk has room for that.
            file.seek(-BEAT_DIGITS, os.SEEK_END)
            file.write(number)
            file.flush()
            os.fsync(file.fileno())
    except FileNotFoundError:
        # This machine has slept, and was thought dead.
        if facts:
            path.write_bytes(facts + number)


def _wait_for_end(ended: threading.Event) -> None:
    """Wait until standard input ends, and set `ended` then; runs in a thread of its own."""
    while sys.stdin.buffer.read(1):
        pass
    ended.set()


if __name__ == "__main__":
    main()
