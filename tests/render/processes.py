"""The real command in a process of its own, to be ended, killed or waited for by a test."""

import contextlib
import math
import subprocess
import sys
import time
from pathlib import Path

from tests.render.test_command_line import Run, environment


def start(command, blend, folder, *options, **variables):
    """Start `stereo_reproject COMMAND` of a scene into a folder, with these environment variables besides."""
    arguments = [command, str(blend), "--output", str(folder), *options]
    return subprocess.Popen(
        [sys.executable, "-m", "stereo_reproject", *arguments],
        env={**environment(), **variables},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


def end(process, folder, seconds):
    """Wait for so many seconds at most until a process ends; return how it did."""
    out, err = process.communicate(timeout=seconds)
    return Run(process.returncode, out, err, folder)


def children(pid):
    return [int(child) for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]


def wait_for(process, condition, seconds=math.inf):
    """For what the process is about to do, so many seconds at most; a line that it says is only read at its end."""
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(0.02)
            raise AssertionError(f"it ended too early: {process.communicate()}")
