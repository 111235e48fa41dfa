"""The options of the command `tradeoff`."""

from __future__ import annotations

import argparse

from ..tradeoff.cases import tradeoff_cases
from .shared_options import add_output, add_quiet, add_scene


def add_tradeoff_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the `tradeoff` command to a parser."""
    add_scene(parser)
    add_output(parser)
    names = [run.name for run in tradeoff_cases()]
    parser.add_argument(
        "--only",
        metavar="RUN",
        nargs="+",
        choices=names,
        default=[],
        help=f"only these of its runs: {', '.join(names)}",
    )
    add_quiet(parser)
