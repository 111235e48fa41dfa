"""Runs docs/farm's job template on this machine, with Open Job Description's own command line."""

import os
import re
import shlex
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
TEMPLATE = ROOT / "docs" / "farm" / "stereo-animation.openjd.yaml"

_STAMP = re.compile(r"^\d+:\d\d:\d\d\.\d+\t", re.MULTILINE)


@dataclass(frozen=True)
class Job:
    status: int
    out: str

    @property
    def lines(self) -> list[str]:
        return self.out.splitlines()

    @property
    def steps(self) -> list[str]:
        """In the order in which they were begun."""
        return re.findall(r"Running step '(\w+)'", self.out)

    @property
    def chunks(self) -> list[str]:
        return re.findall(r"^Frames\(CHUNK\[INT\]\) = (.*)$", self.out, re.MULTILINE)

    def told(self, what: str) -> list[str]:
        """What the session was told by `openjd_WHAT: ...`."""
        return [line.partition(": ")[2] for line in self.lines if line.startswith(f"openjd_{what}: ")]


def typed(*command: str | Path) -> str:
    """The command as a user would type it for the parameter Command."""
    return shlex.join(map(str, command)) if os.name != "nt" else subprocess.list2cmdline(map(str, command))


def openjd(action: str, **parameters: str | int | Path) -> list[str]:
    """The command line of an action on the template; the few lines around the program run in this Python."""
    given = {"Python": sys.executable, **parameters} if parameters else {}
    options = [part for name, value in given.items() for part in ("-p", f"{name}={value}")]
    return [sys.executable, "-m", "openjd", action, str(TEMPLATE), *options]


def finished_job(status: int, out: str) -> Job:
    return Job(status, _STAMP.sub("", out))


def run_job(folder: Path, *, seconds: float, **parameters: str | int | Path) -> Job:
    """The whole job, from `folder` and with this checkout's package."""
    ran = subprocess.run(
        openjd("run", **parameters),
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        encoding="utf-8",
        timeout=seconds,
        check=False,
    )
    return finished_job(ran.returncode, ran.stdout)
