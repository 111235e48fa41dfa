"""Blender's own multiview of a scene, in a process that does nothing else: what it takes, and the most that it holds.

    python -m tests.bench.performance.multiview SCENE.blend [the scene's options of `render`]

The last line of standard output is JSON.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import tempfile
from pathlib import Path

from stereo_reproject.errors import StereoReprojectError
from stereo_reproject.programs.render_options import add_render_arguments
from stereo_reproject.programs.shared_options import overrides_of
from stereo_reproject.settings.frame import EYES


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    add_render_arguments(parser)
    options = parser.parse_args([*sys.argv[1:], "--output=."])
    status = 0
    try:
        print(json.dumps(_measured(options)), flush=True)
    except StereoReprojectError as error:
        print(f"error: {error}", file=sys.stderr, flush=True)
        status = error.exit_status
    # Blender's own clean-up at exit may not come to an end in 4.5.
    os._exit(status)


def _measured(options: argparse.Namespace) -> dict[str, object]:
    from stereo_reproject.blender.engines.render import render_views
    from stereo_reproject.blender.scene.working import open_blend, working_scene

    scene = open_blend(Path(options.scene))
    with working_scene(scene, overrides_of(options)) as working, tempfile.TemporaryDirectory() as folder:
        rendered = render_views(working, EYES, Path(folder))
    return {"seconds": {"total": rendered.seconds}, "memory": {"peak_mb": _peak_mb()}}


def _peak_mb() -> float | None:
    try:
        import resource
    except ImportError:
        return None
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / (1 << 20 if sys.platform == "darwin" else 1 << 10)


if __name__ == "__main__":
    main()
