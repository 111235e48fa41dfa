"""The process that encodes a wiggle as a movie: a Blender of its own, because encoding takes the Render Result, which
is the user's. It takes one task on standard input, as `jobs.wiggle_movie` sends it.
"""

from __future__ import annotations

import json
import os
import shutil
import sys
from pathlib import Path

from ..errors import in_one_line


def main() -> None:
    """Read the task, do it, and end the process. An error is the last line of standard error."""
    task = json.loads(sys.stdin.buffer.readline())
    status = 0
    try:
        from ..blender.output.wiggle import write_wiggle_movie

        pictures = [Path(name) for name in task["pictures"]]
        made = write_wiggle_movie(pictures, Path(task["folder"]), task["seconds"])
        # It may be wanted on another drive.
        shutil.move(made, task["movie"])
    except Exception as error:  # noqa: BLE001 - whatever goes wrong is reported in one line
        failure = in_one_line(error)
        status = failure.exit_status
        print(failure, file=sys.stderr, flush=True)
    # As in the worker: 4.5 may not come to an end at all.
    os._exit(status)


if __name__ == "__main__":
    main()
