"""`python -m stereo_reproject`: hands over to the command line."""

import os
import signal
import sys
from types import FrameType


def _leave(signum: int, _frame: FrameType | None) -> None:
    """End the process at once on Ctrl-C, with exit status 128 plus the signal's number. A signal handler for the time
    before the command line runs."""
    os._exit(128 + signum)


def run() -> int:
    """Run the command line and return its exit status. Ctrl-C ends the process at once before the command line runs,
    and is ignored afterwards."""
    # Imports take a moment too; until a run has begun there is nothing that would have to be cleaned up.
    signal.signal(signal.SIGINT, _leave)
    from .programs.cli import main

    status = main()
    # The outcome is settled: a late Ctrl-C must not replace it while the interpreter winds down.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    return status


if __name__ == "__main__":
    sys.exit(run())
