"""Finished runs, kept one file each, so that an analysis that was interrupted goes on where it ended."""

from __future__ import annotations

import contextlib
import hashlib
import json
import re
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from stereo_reproject.files import write_json
from tests.bench.performance.plan import Case, Run, described

DONE, FAILED, LEFT_OUT = "done", "failed", "left out"

TIME_IS_UP = "the time was up"

Record = dict[str, Any]
"""Of a run: "status"; "message" where it is not done; else what the runner has found, "report" among it."""


class Kept:
    """The finished runs of a folder. programs, and whatever else a time depends on, tell runs of one state of things
    from those of another; only what is done is kept, and what has failed is tried again by the next."""

    def __init__(self, folder: Path, surroundings: Mapping[str, Any]) -> None:
        self._folder = folder
        self._surroundings = json.dumps(surroundings, sort_keys=True)

    @staticmethod
    def files(folder: Path) -> list[Path]:
        """Those of any state of things."""
        return [path for path in folder.glob("*.json") if re.fullmatch(r".+-[0-9a-f]{16}", path.stem)]

    def path(self, run: Run) -> Path:
        digest = hashlib.sha256((self._surroundings + described(run)).encode()).hexdigest()[:16]
        words = re.sub(r"[^a-z0-9]+", "-", run.title.lower()).strip("-")
        return self._folder / f"{words}-{digest}.json"

    def find(self, run: Run) -> Record | None:
        with contextlib.suppress(OSError, ValueError):
            record = json.loads(self.path(run).read_text(encoding="utf-8"))
            if isinstance(record, dict) and record.get("status") == DONE:
                return record
        return None

    def add(self, run: Run, record: Record) -> None:
        self._folder.mkdir(parents=True, exist_ok=True)
        write_json(self.path(run), record)


def have_run(
    cases: Sequence[Case],
    kept: Kept,
    runner: Callable[[Run], Record],
    *,
    tell: Callable[[str], None],
    seconds: float | None = None,
    clock: Callable[[], float] = time.monotonic,
) -> dict[Run, Record]:
    """The record of each case's run: as kept, or made now by the runner, which says itself what has failed.

    After `seconds`, no run is begun any more; what is missing then is left out.
    """
    runs = list(dict.fromkeys(case.run for case in cases))
    records: dict[Run, Record] = {run: record for run in runs if (record := kept.find(run)) is not None}
    if records:
        tell(f"{len(records)} of {len(runs)} runs are there already (--fresh makes them again)")
    started = clock()
    for number, run in enumerate(runs, 1):
        if run in records:
            continue
        if seconds is not None and clock() - started > seconds:
            records[run] = {"status": LEFT_OUT, "message": TIME_IS_UP}
            continue
        record = records[run] = runner(run)
        if record["status"] == DONE:
            kept.add(run, record)
        tell(f"{number:4d} of {len(runs)}  {run.title}: {_outcome(record)}")
    return records


def _outcome(record: Record) -> str:
    if record["status"] != DONE:
        return f"{record['status']}: {record['message']}"
    return f"{record['wall_seconds']:.1f} s"
