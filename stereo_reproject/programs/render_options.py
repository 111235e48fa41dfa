"""The options of the command `render`."""

from __future__ import annotations

import argparse

from .shared_options import add_output, add_pair, add_quiet, add_scene


def add_render_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the `render` command to a parser."""
    add_scene(parser)
    add_output(parser)
    add_pair(parser)
    parser.add_argument(
        "--compare", action="store_true", help="also render with Blender's multiview, and measure against it"
    )
    add_quiet(parser)
