"""`blender --command stereo_reproject …`: the same command line as `python -m stereo_reproject`."""

from __future__ import annotations

from collections.abc import Sequence

from ..stereo_reproject.blender.commands.processes import module_in_blender
from ..stereo_reproject.blender.scene.devices import devices_in_use
from ..stereo_reproject.programs.cli import Host, main

COMMAND = "stereo_reproject"


def run_command(arguments: Sequence[str]) -> int:
    """Run the package's command line with `arguments`, those after the command's name, and return its exit status.
    Blender calls this.
    """
    host = Host(f"blender --command {COMMAND}", module_in_blender("programs.worker"), devices_in_use())
    return main(arguments, host=host)
