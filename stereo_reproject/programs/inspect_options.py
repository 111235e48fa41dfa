"""The options of the command `inspect`."""

from __future__ import annotations

import argparse

from .shared_options import add_pair, add_scene


def add_inspect_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the `inspect` command to a parser."""
    add_scene(parser)
    parser.add_argument("--json", action="store_true", help="print JSON and nothing else on standard output")
    parser.add_argument(
        "--no-sketch", action="store_true", help="the plan alone: nothing is rendered, and no time predicted"
    )
    add_pair(parser)
    parser.set_defaults(compare=False)
