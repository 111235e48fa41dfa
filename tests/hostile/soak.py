"""Many frames, rendered by several processes that are killed again and again on a disk that fills twice.

    python -m tests.hostile.soak [--frames 300] [--processes 3] [--kill-every 20] [--samples N] [--output DIR]

Each run is `python -m stereo_reproject animate --resume` on the same folder of one tmpfs, which takes root (or a user
namespace) to be mounted. At random moments, every so many seconds on average, SIGKILL ends a random process of a random
run (the one that talks to the user, the one that renders, the writer, the heartbeat) or all of them at once; whatever
has ended is started again. At a third and at two thirds of the frames a ballast file fills the disk until each run has
ended with "the disk is full"; then it goes. At the end all must be as if nothing had happened: see `checks_of`. A run
before that nothing befalls says what the frames' bytes are to be, and its processes live long enough for their memory
and open files to be judged. How long a frame takes is for its samples to say: a soak that is over before anything was
killed has failed.

DIR (soak-output unless given) gets soak.json and the runs' last words. Exit status 1 if a check fails, 2 where no tmpfs
can be mounted.
"""

from __future__ import annotations

import argparse
import contextlib
import hashlib
import json
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter, defaultdict
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from stereo_reproject.jobs.work_folder import WORK_PREFIX
from stereo_reproject.sequence.checksums import checksum
from stereo_reproject.sequence.journal import Journal
from stereo_reproject.sequence.journal_folder import JOURNAL

ROOT = Path(__file__).resolve().parents[2]
DEMO = ROOT / "demo" / "cornell-box" / "cornell-box.blend"
OPTIONS = ["--size", "32x32", "--no-denoise", "--fill", "packed", "--accuracy", "draft"]

SAMPLES = 1024
"""By which a frame takes a second or so."""
DISK = "64m"
POLL_SECONDS = 0.1
SAMPLE_SECONDS = 2.0
START_SECONDS = 15.0
"""Of a run until its first frame, on a slow machine; some of them are lost with each kill."""
FRAME_SECONDS = 3.0
"""Of a frame, generously: by it the soak ends at the latest."""
FULL_SECONDS = 240.0
"""Within which all runs on a full disk have ended."""
SETTLING_SECONDS = 30.0
"""Of a run, in which it makes what it makes once: memory is looked at after that."""
MEMORY_SLOPE = 0.5
"""MB per frame by which a process may grow, over lives of `LONG_LIFE` frames or more."""
LONG_LIFE = 20
TELLING_FRAMES = 150
"""Of a soak that must be able to say so."""
DESCRIPTORS = 8
"""By which the open files of a process may differ from one look to another."""
FULL = "the disk is full"

SAVING = """
import sys, bpy
bpy.ops.wm.open_mainfile(filepath=sys.argv[1], load_ui=False)
scene = bpy.context.scene
# Two marks in Blender's files that are of the clock, and the only ones.
scene.render.use_stamp_date = scene.render.use_stamp_render_time = False
bpy.ops.wm.save_as_mainfile(filepath=sys.argv[2], compress=False)
"""


def main() -> int:
    options = _parse()
    output = options.output.resolve()
    output.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix="soak-") as temporary:
        blend, disk = Path(temporary) / "demo.blend", Path(temporary) / "disk"
        disk.mkdir()
        mount = ["mount", "-t", "tmpfs", "-o", f"size={DISK}", "none", str(disk)]
        mounted = subprocess.run(mount, capture_output=True, text=True, check=False)
        if mounted.returncode:
            print(f"soak: no tmpfs can be mounted here ({mounted.stderr.strip()}): run it as root", file=sys.stderr)
            return 2
        try:
            subprocess.run([sys.executable, "-c", SAVING, str(DEMO), str(blend)], check=True, capture_output=True)
            wanted, undisturbed = _render_undisturbed(blend, Path(temporary) / "expected", options)
            soak = Soak(options, blend, disk / "frames", output)
            try:
                soak.run()
            finally:
                soak.end_all()
            soak.undisturbed = undisturbed
            checks = checks_of(soak, wanted)
        finally:
            # Whoever was killed may take a moment to let go of it.
            subprocess.run(["umount", "--lazy", str(disk)], check=True)
    return _tell(checks, soak, output)


def _parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m tests.hostile.soak", description=__doc__.partition("\n")[0])
    parser.add_argument("--frames", type=int, default=300)
    parser.add_argument("--processes", type=int, default=3)
    parser.add_argument("--kill-every", type=float, default=20.0, metavar="SECONDS", help="on average")
    parser.add_argument("--samples", type=int, default=SAMPLES, help="of a frame, which takes the longer for them")
    parser.add_argument("--seed", type=int, default=17)
    parser.add_argument("--limit", type=float, metavar="SECONDS", help="after which it has failed")
    parser.add_argument("--output", type=Path, default=Path("soak-output"))
    return parser.parse_args()


def _command(blend: Path, folder: Path, options: argparse.Namespace) -> list[str]:
    frames, samples = f"1-{options.frames}", str(options.samples)
    arguments = [str(blend), "--output", str(folder), "--frames", frames, "--samples", samples, *OPTIONS, "--resume"]
    return [sys.executable, "-m", "stereo_reproject", "animate", *arguments]


def _environment(temporary: Path) -> dict[str, str]:
    temporary.mkdir(parents=True, exist_ok=True)
    return {**os.environ, "PYTHONPATH": str(ROOT), "TMPDIR": str(temporary)}


def _render_undisturbed(blend: Path, folder: Path, options: argparse.Namespace) -> tuple[dict[str, str], list[Life]]:
    """The digests of the frames' files as one run makes them that nothing befalls, and its processes over time."""
    environment = _environment(folder.with_name("temporary"))
    lives: dict[tuple[int, str], Life] = {}
    command = _command(blend, folder, options)
    process = subprocess.Popen(command, env=environment, cwd=ROOT, stdout=subprocess.DEVNULL, start_new_session=True)
    began, ends = time.monotonic(), time.monotonic() + FRAME_SECONDS * options.frames + 300.0
    try:
        while process.poll() is None and time.monotonic() < ends:
            frames = sum(1 for _ in (folder / JOURNAL).glob("[0-9]*.json"))
            for pid in _family(process.pid):
                _sample(pid, lives, time.monotonic() - began, frames)
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.wait(SAMPLE_SECONDS)
    finally:
        for pid in _family(process.pid):
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        process.wait()
    return _digests(folder), list(lives.values())


def _digests(folder: Path) -> dict[str, str]:
    return {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in folder.glob("[0-9]*.png")}


# Processes


def _stat_of(pid: int) -> list[str] | None:
    """The fields of /proc/PID/stat after the name: state, parent, and more."""
    with contextlib.suppress(OSError):
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return None


def _all_processes() -> dict[int, int]:
    """Parents by process."""
    numbers = (int(entry.name) for entry in Path("/proc").iterdir() if entry.name.isdecimal())
    return {pid: int(fields[1]) for pid in numbers if (fields := _stat_of(pid)) is not None and fields[0] not in "ZX"}


def _role_of(pid: int) -> str:
    with contextlib.suppress(OSError):
        command = Path(f"/proc/{pid}/cmdline").read_bytes()
        for role in (b"worker", b"writer", b"heartbeat"):
            if b"stereo_reproject.programs." + role in command or b"." + role + b"\0" in command:
                return role.decode()
    return "main"


def _memory_of(pid: int) -> float | None:
    """MB that a process holds."""
    with contextlib.suppress(OSError, IndexError, ValueError):
        found = re.search(r"VmRSS:\s+(\d+) kB", Path(f"/proc/{pid}/status").read_text())
        return int(found[1]) / 1024 if found else None
    return None


def _descriptors_of(pid: int) -> int | None:
    with contextlib.suppress(OSError):
        return len(list(Path(f"/proc/{pid}/fd").iterdir()))
    return None


def _processes_of(folder: Path) -> list[int]:
    """Those that name the folder on their command line, or work in it."""
    found = []
    for pid in _all_processes():
        with contextlib.suppress(OSError):
            if os.fsencode(folder) in Path(f"/proc/{pid}/cmdline").read_bytes() and pid != os.getpid():
                found.append(pid)
    return found


@dataclass
class Life:
    """A process: when it was looked at, the frames that were recorded then, MB, and open files."""

    role: str
    looks: list[tuple[float, int, float, int]] = field(default_factory=list)


def _family(pid: int) -> list[int]:
    """A process and all that it has started."""
    parents = _all_processes()
    family = [pid]
    for member in family:
        family += [child for child, parent in parents.items() if parent == member]
    return family


def _sample(pid: int, lives: dict[tuple[int, str], Life], seconds: float, frames: int) -> None:
    memory, descriptors, fields = _memory_of(pid), _descriptors_of(pid), _stat_of(pid)
    if memory is None or descriptors is None or fields is None:
        return
    # A number may be another process's later: its start tells them apart.
    life = lives.setdefault((pid, fields[19]), Life(_role_of(pid)))
    life.looks.append((seconds, frames, memory, descriptors))


@dataclass
class Started:
    process: subprocess.Popen[bytes]
    words: Path
    began: float


class Soak:
    """The runs, and what befalls them."""

    def __init__(self, options: argparse.Namespace, blend: Path, folder: Path, output: Path) -> None:
        self.options, self.blend, self.folder, self.output = options, blend, folder, output
        self.ballast = folder.parent / "ballast"
        self.words = output / "words"
        shutil.rmtree(self.words, ignore_errors=True)
        self.words.mkdir()
        self.runs: list[Started] = []
        self.moments = random.Random(options.seed)
        self.kills: Counter[str] = Counter()
        self.statuses: Counter[str] = Counter()
        self.unexpected: list[str] = []
        self.lives: dict[tuple[int, str], Life] = {}
        self.published: defaultdict[int, set[tuple[int, int]]] = defaultdict(set)
        self.claims: defaultdict[int, set[tuple[str, int, int]]] = defaultdict(set)
        self.undisturbed: list[Life] = []
        self.filled = self.said_full = 0
        self.began = time.monotonic()
        killing = 1.0 + START_SECONDS / options.kill_every
        per_frame = FRAME_SECONDS * options.frames + 4 * FULL_SECONDS
        self.limit = options.limit or killing * per_frame + 300.0
        self.timed_out = False
        self._looked, self._number = 0.0, 0
        self._next_kill = self._kill_in()

    def _kill_in(self) -> float:
        return time.monotonic() + self.moments.expovariate(1.0 / self.options.kill_every)

    def run(self) -> None:
        """Until all frames are there and every run has ended by itself, or the time is up."""
        fills = [self.options.frames // 3, 2 * self.options.frames // 3]
        while not self.timed_out:
            done = self._look()
            if fills and done >= fills[0]:
                fills.pop(0)
                self._fill()
            if done >= self.options.frames:
                break
            self._start_those_missing()
            if time.monotonic() > self._next_kill:
                self._kill()
                self._next_kill = self._kill_in()
            self._wait()
        # What is left comes to its end by itself, and one more run clears away what the killed have left.
        while self.runs and not self.timed_out:
            self._look()
            self._wait()
        self._start()
        while self.runs and not self.timed_out:
            self._wait()

    def _wait(self) -> None:
        time.sleep(POLL_SECONDS)
        self._collect()
        self.timed_out = time.monotonic() - self.began > self.limit

    def _start_those_missing(self) -> None:
        while len(self.runs) < self.options.processes:
            self._start()

    def _start(self) -> None:
        self._number += 1
        words = self.words / f"{self._number:04d}.log"
        with words.open("wb") as log:
            process = subprocess.Popen(
                _command(self.blend, self.folder, self.options),
                env=_environment(self.folder.parent.parent / "temporary"),
                cwd=ROOT,
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=subprocess.STDOUT,
                start_new_session=True,
            )
        self.runs.append(Started(process, words, time.monotonic()))

    def _collect(self) -> None:
        """Note how runs have ended, and forget them."""
        for run in [run for run in self.runs if run.process.poll() is not None]:
            self.runs.remove(run)
            status, said = run.process.returncode, run.words.read_text(errors="replace").splitlines()
            last = next((line for line in reversed(said) if line.strip()), "")
            full = status == 2 and FULL in last
            self.said_full += full
            self.statuses["full" if full else str(status)] += 1
            if status == 0:
                run.words.unlink()
            elif status not in (1, -signal.SIGKILL) and not full:
                self.unexpected.append(f"{run.words.name}: exit status {status}: {last[:200]}")
            if "defect" in last or "Traceback" in "\n".join(said):
                self.unexpected.append(f"{run.words.name}: {last[:200]}")

    def _kill(self) -> None:
        """A random process of a random run, or all of them."""
        if not self.runs:
            return
        run = self.moments.choice(self.runs)
        family = _family(run.process.pid)
        whole = self.moments.random() < 0.2
        victims = family if whole else [self.moments.choice(family)]
        self.kills["all of a run" if whole else _role_of(victims[0])] += 1
        for pid in victims:
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)

    def _fill(self) -> None:
        """Fill the disk until every run that was at work has ended; then make room again."""
        self.filled += 1
        before = list(self.runs)
        with contextlib.suppress(OSError), self.ballast.open("wb") as ballast:
            while True:
                ballast.write(bytes(1 << 20))
                ballast.flush()
        ends = time.monotonic() + FULL_SECONDS
        while any(run in self.runs for run in before) and time.monotonic() < ends:
            # What the ended runs took with them is room again.
            with contextlib.suppress(OSError), self.ballast.open("ab") as ballast:
                while True:
                    ballast.write(bytes(1 << 12))
                    ballast.flush()
            self._look()
            self._wait()
        if any(run in self.runs for run in before):
            self.unexpected.append(f"runs went on for {FULL_SECONDS:.0f} s on a full disk")
        self.ballast.unlink(missing_ok=True)

    def _look(self) -> int:
        """Look at the folder, and now and then at the processes; how many frames are recorded."""
        journal = self.folder / JOURNAL
        with contextlib.suppress(OSError):
            for path in journal.iterdir():
                with contextlib.suppress(OSError):
                    self._note(path)
        if time.monotonic() - self._looked > SAMPLE_SECONDS:
            self._looked = time.monotonic()
            for run in self.runs:
                for pid in _family(run.process.pid):
                    _sample(pid, self.lives, time.monotonic() - self.began, len(self.published))
        return len(self.published)

    def _note(self, path: Path) -> None:
        if record := re.fullmatch(r"(\d{4,})\.json", path.name):
            look = path.stat()
            self.published[int(record[1])].add((look.st_ino, look.st_mtime_ns))
        elif claim := re.fullmatch(r"(\d{4,})\.claim\.\d+", path.name):
            look = path.stat()
            self.claims[int(claim[1])].add((path.name, look.st_ino, look.st_mtime_ns))

    def end_all(self) -> None:
        for run in self.runs:
            for pid in _family(run.process.pid):
                with contextlib.suppress(ProcessLookupError):
                    os.kill(pid, signal.SIGKILL)
            run.process.wait()


# What must be true in the end


@dataclass(frozen=True)
class Check:
    name: str
    passed: bool
    found: str


def checks_of(soak: Soak, wanted: dict[str, str]) -> list[Check]:
    journal, frames = Journal(soak.folder), soak.options.frames
    records = {record.frame: record for record in journal.records.read_all()}
    whole = [frame for frame, record in records.items() if _is_whole(soak.folder, record.files)]
    made = _digests(soak.folder)
    other = sorted(name for name in {*made, *wanted} if made.get(name) != wanted.get(name))
    again = [frame for frame, looks in soak.published.items() if len(looks) > 1]
    left, running = _left_over(soak), _processes_of(soak.folder)
    memory, descriptors = _slopes(soak), _descriptors(soak)
    return [
        Check("in time", not soak.timed_out, f"{time.monotonic() - soak.began:.0f} of {soak.limit:.0f} s"),
        Check("processes were killed", bool(soak.kills), f"{sum(soak.kills.values())} times"),
        Check("nothing lost", len(whole) == frames, f"{len(whole)} of {frames} frames whole by the journal"),
        Check(
            "nothing doubled",
            not journal.records.new_doubts() and not again,
            f"recorded more than once: {again or 'none'}",
        ),
        Check("the same bytes", not other, f"{len(made)} files, others: {other[:6] or 'none'}"),
        Check("nothing left behind", not left, ", ".join(left[:6]) or "nothing"),
        Check("no processes", not running, str(running or "none")),
        Check("the disk was full twice", soak.filled == 2 and soak.said_full >= 2, f"said {soak.said_full} times"),
        Check("no other ends", not soak.unexpected, "; ".join(soak.unexpected[:3]) or "none"),
        Check("memory is flat", _all_within(memory, MEMORY_SLOPE, frames), _spelled(memory, "MB/frame")),
        Check("descriptors are flat", _all_within(descriptors, DESCRIPTORS, frames), _spelled(descriptors, "")),
    ]


def _all_within(values: dict[str, float], most: float, frames: int) -> bool:
    """Of a short soak, in which nothing lives long enough, nothing can be said."""
    told = {"main", "worker", "writer"} <= values.keys() or frames < TELLING_FRAMES
    return told and all(value <= most for value in values.values())


def _is_whole(folder: Path, files: Any) -> bool:
    with contextlib.suppress(OSError):
        return all(checksum(folder / name) == known for name, known in files.items())
    return False


def _left_over(soak: Soak) -> list[str]:
    report = re.compile(rf"animation\.(json|png|svg)|{re.escape(JOURNAL)}|\d{{4,}}(_[LR])?\.png")
    record = re.compile(r"\d{4,}\.json|found-[0-9a-f]{16}(-gpu|-costs-[a-z]+)?\.json")
    stray = [path.name for path in soak.folder.iterdir() if not report.fullmatch(path.name)]
    stray += [path.name for path in (soak.folder / JOURNAL).iterdir() if not record.fullmatch(path.name)]
    temporary = soak.folder.parent.parent / "temporary"
    return stray + [path.name for path in temporary.iterdir() if path.name.startswith(WORK_PREFIX)]


def _slopes(soak: Soak) -> dict[str, float]:
    """MB per frame by which the processes of each kind grow once they are settled, in the median of long lives."""
    slopes = defaultdict(list)
    for life in (*soak.lives.values(), *soak.undisturbed):
        settled = [look for look in life.looks if look[0] - life.looks[0][0] > SETTLING_SECONDS]
        frames, memory = np.array([look[1] for look in settled]), np.array([look[2] for look in settled])
        if len(settled) > 3 and np.ptp(frames) >= LONG_LIFE:
            slopes[life.role].append(float(np.polyfit(frames, memory, 1)[0]))
    return {role: float(np.median(values)) for role, values in slopes.items()}


def _descriptors(soak: Soak) -> dict[str, float]:
    """By how many open files a settled process has had more at its end than at its beginning, at most."""
    grown: dict[str, float] = {}
    for life in (*soak.lives.values(), *soak.undisturbed):
        settled = [look[3] for look in life.looks if look[0] - life.looks[0][0] > SETTLING_SECONDS]
        if len(settled) > 3:
            third = max(len(settled) // 3, 1)
            more = float(np.median(settled[-third:]) - np.median(settled[:third]))
            grown[life.role] = max(more, grown.get(life.role, 0.0))
    return grown


def _spelled(values: dict[str, float], unit: str) -> str:
    told = ", ".join(f"{role} {value:+.2f} {unit}".strip() for role, value in sorted(values.items()))
    return told or "no process lived long enough to tell"


def _tell(checks: list[Check], soak: Soak, output: Path) -> int:
    seconds = time.monotonic() - soak.began
    claimed = {frame: len(claims) for frame, claims in soak.claims.items()}
    peaks = defaultdict(float)
    for life in (*soak.lives.values(), *soak.undisturbed):
        peaks[life.role] = max([peaks[life.role], *(look[2] for look in life.looks)])
    facts = {
        "frames": soak.options.frames,
        "processes": soak.options.processes,
        "kill_every": soak.options.kill_every,
        "samples": soak.options.samples,
        "seed": soak.options.seed,
        "seconds": seconds,
        "kills": dict(soak.kills),
        "ends": dict(soak.statuses),
        "renders_begun": {"in all": sum(claimed.values()), "of one frame at most": max(claimed.values(), default=0)},
        "recorded": {str(frame): len(looks) for frame, looks in sorted(soak.published.items())},
        "peak_mb": dict(peaks),
        "memory_slope_mb_per_frame": _slopes(soak),
        "descriptors_grown": _descriptors(soak),
        "checks": {check.name: {"passed": check.passed, "found": check.found} for check in checks},
    }
    (output / "soak.json").write_text(json.dumps(facts, indent=2) + "\n")
    print(f"{soak.options.frames} frames, {soak.options.processes} processes, {seconds:.0f} s")
    print(f"kills         {sum(soak.kills.values())}: {dict(soak.kills)}")
    print(f"ends          {dict(soak.statuses)}")
    print(
        f"begun         {sum(claimed.values())} times, a frame {facts['renders_begun']['of one frame at most']} at most"
    )
    print(f"MB at most    { {role: round(value) for role, value in peaks.items()} }")
    for check in checks:
        print(f"{'passed' if check.passed else 'FAILED'}  {check.name:<24}{check.found}")
    return 0 if all(check.passed for check in checks) else 1


if __name__ == "__main__":
    sys.exit(main())
