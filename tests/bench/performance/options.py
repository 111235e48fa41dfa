"""What the analysis is told on its command line, and the plan that it comes to."""

from __future__ import annotations

import argparse
import math
import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from stereo_reproject.programs.converters import OneLineParser
from stereo_reproject.settings.frame import ACCURACIES
from tests.bench.performance.plan import QUICK, Plan

QUICK_SECONDS = 270.0
"""After these, --quick begins no run any more: it ends within five minutes on a slow machine too."""

OUTPUT = Path("build/bench")

MOST_FRAMES = 1000
LEAST_SIDE = 4


def parse(arguments: Sequence[str] | None = None) -> argparse.Namespace:
    """Raises BadInputError or ValueError, which says in one line what is wrong."""
    parser = OneLineParser(
        prog="python -m tests.bench.performance",
        description="Measure multiview, card and packed over scenes and sizes, along a camera path, and how their "
        "stages grow. It may be interrupted: the same command goes on.",
    )
    parser.add_argument("names", nargs="*", metavar="SCENE", help="only these scenes of the folder")
    parser.add_argument("--scenes", type=Path, metavar="DIR", help="holds NAME/NAME.blend or NAME.blend")
    parser.add_argument("--output", type=_folder, default=OUTPUT, metavar="DIR", help="(%(default)s)")
    parser.add_argument("--quick", action="store_true", help="the Cornell box, small, in five minutes at most")
    parser.add_argument("--fresh", action="store_true", help="make finished runs again too")
    parser.add_argument("--seconds", type=_seconds, metavar="S", help="begin no run after these")
    parser.add_argument("--parts", nargs="+", choices=Plan().parts, metavar="PART", help=_PARTS)
    parser.add_argument("--sizes", nargs="+", type=_size, metavar="WxH", help="of the scenes")
    parser.add_argument("--samples", type=_count, metavar="N", help="of the scenes")
    parser.add_argument("--path-sizes", nargs="+", type=_size, metavar="WxH", help="of the path (those of the scenes)")
    parser.add_argument("--path-samples", type=_count, metavar="N", help="of the path")
    parser.add_argument("--study-samples", type=_count, metavar="N", help="where these are not what is varied")
    parser.add_argument("--turns", type=_count, metavar="N", help="how often each run is made; medians are told")
    parser.add_argument("--accuracy", choices=ACCURACIES, help="of card and packed (balanced)")
    parser.add_argument(
        "--study", metavar="SCENE", help="of which one thing is varied, and a path is made (the Cornell box)"
    )
    parser.add_argument("--animated", type=Path, metavar="FILE", help="a .blend whose camera moves, in place of a path")
    parser.add_argument(
        "--frames", type=_frames, metavar="A-B[:STEP]", help="of the path, or of that .blend; fewer at larger sizes"
    )
    options = parser.parse_args(arguments)
    if options.scenes is None and not options.quick:
        parser.error("name a folder of scenes (--scenes DIR; make bench SCENES=DIR), or take --quick")
    if options.quick:
        # Neither a folder nor any of its scenes is needed for it.
        options.seconds = QUICK_SECONDS if options.seconds is None else options.seconds
    return options


_PARTS = f"only these of {', '.join(Plan().parts)}"


def plan_of(options: argparse.Namespace) -> Plan:
    """How much is measured, by --quick or not, and by what else was said."""
    said = {
        "parts": options.parts,
        "sizes": options.sizes,
        "samples": options.samples,
        "path_sizes": options.path_sizes,
        "path_samples": options.path_samples,
        "study_samples": options.study_samples,
        "turns": options.turns,
        "accuracy": options.accuracy,
        "frames": options.frames,
    }
    told = {name: tuple(value) if isinstance(value, list) else value for name, value in said.items()}
    plan = QUICK if options.quick else Plan()
    if options.sizes:
        plan = replace(plan, path_sizes=None)
    return replace(plan, **{name: value for name, value in told.items() if value})


def _folder(text: str) -> Path:
    if not text:
        raise argparse.ArgumentTypeError("is empty; name a folder for the results")
    return Path(text)


def _seconds(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 0.0 <= value < math.inf:
        raise argparse.ArgumentTypeError(f"must be a number of seconds, not {text!r}")
    return value


def _size(text: str) -> tuple[int, int]:
    if not re.fullmatch(r"[1-9][0-9]{0,4}x[1-9][0-9]{0,4}", text):
        raise argparse.ArgumentTypeError(f"must be of the form WIDTHxHEIGHT, such as 1920x1080, not {text!r}")
    width, height = (int(number) for number in text.split("x"))
    if min(width, height) < LEAST_SIDE:
        raise argparse.ArgumentTypeError(f"must be at least {LEAST_SIDE}x{LEAST_SIDE}, not {text}")
    return width, height


def _count(text: str) -> int:
    if not re.fullmatch(r"[1-9][0-9]{0,6}", text):
        raise argparse.ArgumentTypeError(f"must be a whole number from 1, not {text!r}")
    return int(text)


def _frames(text: str) -> tuple[int, ...]:
    found = re.fullmatch(r"([0-9]{1,6})-([0-9]{1,6})(?::([1-9][0-9]{0,5}))?", text)
    if not found or int(found[1]) > int(found[2]):
        raise argparse.ArgumentTypeError(f"must be of the form A-B or A-B:STEP, such as 1-24, not {text!r}")
    if int(found[2]) > MOST_FRAMES:
        raise argparse.ArgumentTypeError(f"must not go beyond frame {MOST_FRAMES}, not {text!r}")
    return tuple(range(int(found[1]), int(found[2]) + 1, int(found[3] or 1)))
