"""A wiggle encoded as a movie by a Blender in a process of its own."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

from ..errors import StereoReprojectError
from ..words import Words
from .worker_process import start_worker

MAX_SECONDS = 300.0
"""Time after which a movie of ten seconds is given up: one of 240 x 136 took 7 s, most of which Blender needed to
start."""


def make_wiggle_movie(
    command: Sequence[str], pictures: Sequence[Path], movie: Path, seconds: float, *, work: Path
) -> None:
    """Have the program `wiggle`, started by `command`, encode these PNG files as a movie of about `seconds` each, again
    and again. movie is the file to be made, work a run's private folder. Raises StereoReprojectError.
    """
    task = {
        "pictures": [str(path) for path in pictures],
        "movie": str(movie),
        "seconds": seconds,
        "folder": str(work / "tmp" / "encoded"),
    }
    with start_worker(command, work) as worker:
        worker.send(json.dumps(task).encode("ascii") + b"\n")
        status = worker.wait(MAX_SECONDS)
        if status is None:
            raise StereoReprojectError(
                Words(
                    "encoding the movie took more than {max_seconds} s, and was ended", max_seconds=f"{MAX_SECONDS:g}"
                )
            )
        if status or not movie.exists():
            raise StereoReprojectError(
                worker.last_words() or Words("no movie was made (exit status {status})", status=status)
            )
