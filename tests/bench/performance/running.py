"""Runs as processes of their own: started, waited for, ended with this one, and read by what they report."""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tests.bench.performance.keeping import DONE, FAILED, LEFT_OUT, Record
from tests.bench.performance.plan import MULTIVIEW, Run
from tests.bench.warp.measure import LEFT_TO_NUMPY
from tests.bench.warp.settings import CARRIERS

ROOT = Path(__file__).resolve().parents[3]
END_SECONDS = 20.0
"""What a process has to clean up, once it is asked to end."""

MESSAGE_LENGTH = 240

NO_GPU = ("no usable GPU", LEFT_TO_NUMPY)
"""Words of `tests.bench.warp` where there is none, or none for pictures of that size, which is no failure."""


@dataclass(frozen=True)
class Ended:
    """What became of a process. peak_mb: the most that it, or one that it has waited for, has held; None where the
    system does not tell."""

    status: int
    seconds: float
    peak_mb: float | None
    output: str
    errors: str

    def message(self) -> str:
        """The last thing that it complained of, on one line."""
        lines = [line.strip() for line in self.errors.splitlines() if line.strip()]
        told = next((line for line in reversed(lines) if "error" in line.lower()), lines[-1] if lines else "")
        return (told.removeprefix("stereo_reproject: error: ") or f"exit status {self.status}")[:MESSAGE_LENGTH]


def run_process(arguments: Sequence[str], folder: Path) -> Ended:
    """Run Python with these arguments, from the root of the checkout; its output, and what else it makes for the time,
    goes into the folder."""
    folder.mkdir(parents=True, exist_ok=True)
    paths = (str(ROOT), os.environ.get("PYTHONPATH", ""))
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, paths))}
    environment |= dict.fromkeys(("TMPDIR", "TEMP", "TMP"), str(folder))
    names = [folder / name for name in ("out.log", "err.log")]
    start = time.perf_counter()
    with names[0].open("wb") as out, names[1].open("wb") as err:
        process = subprocess.Popen(
            [sys.executable, *arguments], stdin=subprocess.DEVNULL, stdout=out, stderr=err, env=environment, cwd=ROOT
        )
        try:
            status, peak = _wait(process)
        except BaseException:
            _end(process)
            raise
    seconds = time.perf_counter() - start
    texts = [name.read_text(encoding="utf-8", errors="replace") for name in names]
    for name in names:
        name.unlink()
    return Ended(status, seconds, peak, *texts)


def _wait(process: subprocess.Popen[bytes]) -> tuple[int, float | None]:
    if not hasattr(os, "wait4"):
        return process.wait(), None
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    return process.returncode, usage.ru_maxrss / (1 << 20 if sys.platform == "darwin" else 1 << 10)


def _end(process: subprocess.Popen[bytes]) -> None:
    """As Ctrl-C on a terminal does it, which it may have got by now."""
    with suppress(OSError):
        process.send_signal(signal.SIGINT if os.name == "posix" else signal.SIGTERM)
    with suppress(subprocess.TimeoutExpired, OSError):
        process.wait(END_SECONDS)
        return
    process.kill()
    process.wait()


def code_digest() -> str:
    """Of the package's sources and of the analysis's own: what was measured of others says nothing of these."""
    digest = hashlib.sha256()
    folders = (ROOT / "stereo_reproject", Path(__file__).parent)
    for path in sorted(path for folder in folders for path in folder.rglob("*")):
        if path.suffix in (".py", ".osl"):
            digest.update(str(path.relative_to(ROOT)).encode())
            digest.update(path.read_bytes())
    return digest.hexdigest()


def commit() -> str | None:
    """What is checked out, and whether files of it are changed; None where that cannot be told."""
    try:
        told = ["git", "describe", "--always", "--dirty=, with changes", "--abbrev=12", "--exclude=*"]
        return subprocess.run(told, cwd=ROOT, capture_output=True, text=True, check=True).stdout.strip() or None
    except (OSError, subprocess.CalledProcessError):
        return None


class Runner:
    """Makes runs, with their files in a folder of their own for the time; pictures are not kept."""

    def __init__(self, work: Path) -> None:
        self._work = work / "run"

    def __call__(self, run: Run) -> Record:
        if run.scene.amiss:
            return {"status": FAILED, "message": run.scene.amiss}
        try:
            if run.method in CARRIERS:
                return self._stage(run)
            return self._peer(run) if run.method == MULTIVIEW else self._ours(run)
        finally:
            shutil.rmtree(self._work, ignore_errors=True)

    def _ours(self, run: Run) -> Record:
        output = self._work / "pair"
        scene = [str(run.scene.blend), "--output", str(output), "--quiet"]
        ended = run_process(["-m", "stereo_reproject", "render", *scene, *run.options()], self._work)
        return record_of(ended, _read(output / "report.json"))

    def _stage(self, run: Run) -> Record:
        file = self._work / "stage.json"
        ended = run_process(["-m", "tests.bench.warp", *run.options(), f"--json={file}"], self._work)
        if any(words in ended.errors for words in NO_GPU):
            return {"status": LEFT_OUT, "message": ended.message()}
        report = _read(file)
        told = report and {"seconds": {"total": report["seconds"]}, "stage": report}
        return record_of(ended, told)

    def _peer(self, run: Run) -> Record:
        module = "tests.bench.performance.multiview"
        ended = run_process(["-m", module, str(run.scene.blend), *run.options()], self._work)
        return record_of(ended, last_json(ended.output))


def record_of(ended: Ended, report: dict[str, Any] | None) -> Record:
    """What is kept of a run that has left this report."""
    if ended.status != 0 or report is None:
        message = ended.message() if ended.status != 0 else "it ended without a report"
        return {"status": FAILED, "message": message, "exit_status": ended.status}
    return {"status": DONE, "wall_seconds": ended.seconds, "process_peak_mb": ended.peak_mb, "report": report}


def _read(path: Path) -> dict[str, Any] | None:
    with suppress(OSError, ValueError):
        return json.loads(path.read_text(encoding="utf-8"))
    return None


def last_json(text: str) -> dict[str, Any] | None:
    """The last line of a program that is a JSON object: Blender prints what it likes before."""
    for line in reversed(text.splitlines()):
        with suppress(ValueError):
            value = json.loads(line)
            if isinstance(value, dict):
                return value
    return None
