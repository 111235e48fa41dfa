"""The options of the command `animate`."""

from __future__ import annotations

import argparse

from ..delivery.layouts import LAYOUTS
from ..settings.animation import AUTO_REUSE, read_every, read_reuse
from .converters import read_by
from .shared_options import add_frames, add_movie, add_output, add_pair, add_quiet, add_scene


def add_animate_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the `animate` command to a parser."""
    add_scene(parser, frame="the one frame to render, as --frames N")
    add_output(parser)
    add_frames(parser)
    _add_delivery(parser)
    add_pair(parser)
    parser.add_argument(
        "--compare",
        metavar="every=N",
        dest="every",
        type=read_by(read_every),
        help="also render each N-th frame, from the scene's first on, with Blender's multiview, and measure against it",
    )
    parser.add_argument(
        "--reuse",
        metavar="K|auto|off",
        type=read_by(read_reuse),
        help="render an eye of each K-th frame alone, and make the frames after it from that one, tracing what has "
        f"changed; auto is {AUTO_REUSE}; off, the default, renders an eye of each frame",
    )
    parser.add_argument(
        "--mono",
        action="store_true",
        help="with --reuse: frames of one view, through the scene's own camera, as Blender renders an animation "
        "without stereoscopy; --compare is against plain renders with persistent data",
    )
    add_quiet(parser)
    parser.set_defaults(compare=False, view_files=False)


def _add_delivery(parser: argparse.ArgumentParser) -> None:
    """Add the options that say how an animation is stored: movie, stereo layout, file format, and pictures of the
    holes."""
    add_movie(parser, named="its layout")
    parser.add_argument(
        "--layout",
        type=str.lower,
        choices=LAYOUTS,
        metavar="LAYOUT",
        help=f"how a frame holds both eyes: {', '.join(LAYOUTS)}",
    )
    parser.add_argument(
        "--format", metavar="FORMAT", type=str.upper, help="of the frames, by Blender's name, such as PNG or OPEN_EXR"
    )
    parser.add_argument(
        "--holes", action="store_true", help="also a picture for each frame of what was traced, and why"
    )
