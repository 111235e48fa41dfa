"""`blender --command stereo_reproject …`: the same command line as `python -m stereo_reproject`."""

from __future__ import annotations

from collections.abc import Sequence

from ..stereo_reproject.cli import main
from .run import worker_command

COMMAND = "stereo_reproject"


def run_command(arguments: Sequence[str]) -> int:
    """What Blender calls with what follows the command's name; the exit status."""
    return main(arguments, worker_command=worker_command())
