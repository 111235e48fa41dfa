"""The process that writes an animation's frames while the next ones are rendered.

Writing needs Blender: its compositor, view transform, formats and file naming run after a render call, here one of
`blender.output.delivery`. But a render call for one scene has Blender drop what Cycles keeps of any other, and writing
would cost the renderer its synced scene with each frame. So it is done in a Blender of its own, which opens the same
file and keeps nothing of it but what pictures go through. `writer_process` is the other side.

stdin    one line of JSON, a `WriterJob` as a dict; then a line for each frame, a WrittenFrame as a dict. At the end the
         frames that were handed over are still written, and the process ends.
answers  NUMBER.json in the job's private folder: {"record": {...}}, {"record": null} of a frame that another run has
         claimed meanwhile, or {"error": "...", "words": what `words.to_data` returns of it, "status": 1 or 2,
         "hopeless": whether no other frame can be written either}
"""

from __future__ import annotations

import json
import os
import sys
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import Any

from ..errors import OutputError, in_one_line
from ..files import write_json
from ..words import to_data


def main() -> None:
    """Read a `WriterJob` and then frames from standard input, write each frame's files, and answer with a JSON file for
    each. End the process when standard input ends."""
    # What Blender prints belongs into its log.
    os.dup2(2, 1)
    # As bytes, for the same reason as in `worker`.
    job = json.loads(sys.stdin.buffer.readline())
    answers = Path(job["private"])
    write: Callable[[dict[str, Any]], dict[str, Any] | None] | None = None
    for line in sys.stdin.buffer:
        frame = json.loads(line)
        try:
            if write is None:
                from ..blender.output.frame_writer import FrameWriter

                write = FrameWriter(job).write
            answer = {"record": write(frame)}
        except Exception as error:  # noqa: BLE001 - whatever it is, the other side has to hear of it
            failure = in_one_line(error)
            hopeless = isinstance(failure, OutputError)
            words = str(failure)
            status = failure.exit_status
            answer = {"error": words, "words": to_data(words), "status": status, "hopeless": hopeless}
        try:
            write_json(answers / f"{frame['frame']}.json", answer)
        except OSError:
            # The folder is gone, or full: the other side finds that nobody answers any more.
            traceback.print_exc()
            os._exit(1)
    os._exit(0)


if __name__ == "__main__":
    main()
