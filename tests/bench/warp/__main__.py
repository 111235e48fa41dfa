"""Measure the warp stage on a synthetic scene, on one core, against SciPy's bare lookup; needs SciPy, and no Blender.

    python -m tests.bench.warp [--size WxH] [--scene room|smooth] [--mode off-axis|toe-in] [--warp numpy|gpu]
                               [--runs N] [--grid-threshold ARC_MINUTES] [--json FILE]

Exit status 0 done, 1 failed, 2 bad input, 130 interrupted.
"""

from __future__ import annotations

import argparse
import importlib
import os
import stat
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from stereo_reproject.errors import BadInputError, StereoReprojectError
from stereo_reproject.files import write_json
from stereo_reproject.programs.converters import OneLineParser, number, size, value_of, whole_number
from stereo_reproject.settings.frame import StereoSettings
from tests.bench.warp.settings import CARRIERS, FEWEST_RUNS, MODES, SCENES, BenchSettings, format_bench, use_one_core

if TYPE_CHECKING:
    from stereo_reproject.warp.warper import Warper

PROGRAM = "tests.bench.warp"


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, print the result for a person, and write the JSON file that is asked for. Returns the exit status."""
    try:
        options = parse(arguments)
        file = None if options.json is None else _file_to_write(options.json)
        settings = BenchSettings(options.size, options.scene, options.mode, options.warp, options.runs)
        # Before numpy is loaded.
        core = use_one_core()
        from tests.bench.warp.measure import measure

        report = measure(settings, options.grid_threshold, core=core, find_gpu=find_gpu)
        print(format_bench(report))
        if file is not None:
            _write(file, report)
    except StereoReprojectError as error:
        print(f"{PROGRAM}: error: {error}", file=sys.stderr)
        return error.exit_status
    except KeyboardInterrupt:
        print(f"{PROGRAM}: interrupted; nothing was written", file=sys.stderr)
        return 130
    return 0


def parse(arguments: Sequence[str] | None) -> argparse.Namespace:
    """Raises BadInputError."""
    parser = OneLineParser(
        prog=f"python -m {PROGRAM}", description=(__doc__ or "").partition("\n")[0], allow_abbrev=False
    )

    def measured(option: str, metavar: str, field: str, read: Callable[[str], Any], text: str) -> None:
        default = getattr(BenchSettings, field)
        parser.add_argument(
            option, metavar=metavar, type=value_of(BenchSettings, field, read), default=default, help=text
        )

    measured("--size", "WxH", "size", size, "size of one eye in pixels (1920x1080)")
    parser.add_argument(
        "--scene",
        choices=SCENES,
        default=BenchSettings.scene,
        help="a room full of posts, or one smooth surface, for which the adaptive grid is made (%(default)s)",
    )
    parser.add_argument("--mode", choices=MODES, default=BenchSettings.mode, help="how the eyes converge (%(default)s)")
    parser.add_argument("--warp", choices=CARRIERS, default=BenchSettings.warp, help="who does the work (%(default)s)")
    measured("--runs", "N", "runs", whole_number, f"how often it is timed, at least {FEWEST_RUNS} times (%(default)s)")
    parser.add_argument(
        "--grid-threshold",
        metavar="ARC_MINUTES",
        type=value_of(StereoSettings, "grid_threshold", number),
        default=StereoSettings.grid_threshold,
        help="binocular parallax above which the grid subdivides a cell (%(default)s)",
    )
    parser.add_argument("--json", metavar="FILE", help="also write all figures into this file")
    return parser.parse_args(arguments)


def find_gpu() -> tuple[Warper | None, str]:
    """Return the GPU that can warp, or None and why there is none."""
    try:
        # Without bpy, which brings `gpu`, there is still numpy to be measured.
        importlib.import_module("bpy")
        gpu_warp = importlib.import_module("stereo_reproject.blender.gpu.warp")
    except ImportError as error:
        return None, f"no usable GPU ({error})"
    stage = gpu_warp.gpu_warper()
    return stage, "" if stage is not None else "no usable GPU (Blender finds none)"


def _file_to_write(name: str) -> Path:
    """The absolute path of a file that is to be written, where links lead. Raises BadInputError where it cannot be."""
    if not name:
        raise BadInputError("the file has no name; give it one")
    try:
        path = Path(name).resolve()
        mode = _mode_of(path)
        beside = path.parent.is_dir()
    except (OSError, RuntimeError) as error:
        # Links in a circle are a RuntimeError up to Python 3.12.
        why = error.strerror if isinstance(error, OSError) else error
        raise BadInputError(f"{name} cannot be written ({why}); name another file") from error
    if mode is not None and stat.S_ISDIR(mode):
        raise BadInputError(f"{path} is a folder; name a file in it")
    if mode is not None and not stat.S_ISREG(mode):
        # The file that appears whole takes the place of what is there.
        raise BadInputError(f"{path} is not a regular file; name one, or a new one")
    if not beside:
        raise BadInputError(f"the folder {path.parent} does not exist; make it, or name a file in another")
    if not os.access(path.parent, os.W_OK):
        raise BadInputError(f"the folder {path.parent} cannot be written; name a file in another")
    return path


def _mode_of(path: Path) -> int | None:
    """None where nothing is there. Raises OSError."""
    try:
        return path.stat().st_mode
    except (FileNotFoundError, NotADirectoryError):
        return None


def _write(file: Path, report: dict[str, Any]) -> None:
    try:
        write_json(file, report)
    except OSError as error:
        raise BadInputError(f"{file} cannot be written ({error.strerror}); name another file") from error
    print(f"file          {file}")


if __name__ == "__main__":
    sys.exit(main())
