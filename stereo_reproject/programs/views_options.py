"""The options of the command `views`, and what they come to: settings of many views."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from ..delivery.displays import DISPLAYS
from ..errors import BadInputError
from ..settings.frame import PANORAMAS, StereoSettings
from ..settings.views import (
    DEFAULT_CONE_DEGREES,
    DEFAULT_COUNT,
    MAX_COUNT,
    MIN_COUNT,
    VIEWS_LAYOUTS,
    ViewsSettings,
    read_quilt,
    views_settings,
)
from .converters import number, read_by, value_of, whole_number
from .shared_options import (
    add_accuracy,
    add_denoise,
    add_frames,
    add_movie,
    add_output,
    add_packed_by,
    add_picture,
    add_quiet,
    add_scene_file,
    add_warp,
)


def views_of(arguments: argparse.Namespace) -> ViewsSettings:
    """Return the settings of many views from the parsed command-line options. Raises BadInputError."""
    if arguments.from_scene:
        columns, rows = arguments.quilt or (None, None)
        return ViewsSettings(
            arguments.views or 0,
            arguments.cone,
            arguments.baseline,
            arguments.focus,
            columns,
            rows,
            arguments.aspect,
            arguments.display,
            from_scene=True,
            fresh=arguments.fresh,
            layout=arguments.views_layout,
        )
    views = views_settings(
        display=arguments.display,
        count=arguments.views,
        cone_degrees=arguments.cone,
        baseline=arguments.baseline,
        focus_distance=arguments.focus,
        quilt=arguments.quilt,
        aspect=arguments.aspect,
    )
    return replace(views, fresh=arguments.fresh, layout=arguments.views_layout)


def check_frames_of_views(arguments: argparse.Namespace) -> None:
    """Raise BadInputError where options of many views that go with several frames are given for one, or the other way
    round."""
    if arguments.frames is not None:
        if arguments.compare:
            raise BadInputError(
                "--compare is for one frame alone: leave it out with --frames, or name one frame by --frame"
            )
        if arguments.from_scene and arguments.movie is not None and arguments.quilt is None:
            raise BadInputError("--movie shows quilts, and the scene's own views have one with --quilt alone: name it")
        if arguments.view_files and arguments.views_layout != VIEWS_LAYOUTS[0]:
            raise BadInputError("--view-files has each view in a file of its own, --layout all in one: leave one out")
        return
    given = {
        "--resume": arguments.resume,
        "--overwrite": arguments.overwrite,
        "--movie": arguments.movie is not None,
        "--view-files": arguments.view_files,
    }
    option = next((option for option, is_given in given.items() if is_given), None)
    if option is not None:
        raise BadInputError(f"{option} is for several frames: name them by --frames")


def add_views_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the `views` command to a parser."""
    add_scene_file(parser)
    add_picture(parser, size_of="one view")
    add_output(parser)
    add_frames(parser, without="the one of --frame")
    add_movie(parser, named="the scene and the grid of its quilts")
    parser.add_argument(
        "--view-files",
        action="store_true",
        help="with --frames: also each view of each frame as an EXR of its own, in DIR/views",
    )
    _add_views(parser)
    add_denoise(parser, what="all views")
    add_accuracy(parser, of="each view")
    add_packed_by(parser)
    add_warp(parser)
    parser.add_argument(
        "--compare",
        action="store_true",
        help="also render three of the views plainly, the outermost and one between, and measure against them",
    )
    add_quiet(parser)
    # What is said of pairs alone.
    parser.set_defaults(
        reuse=None,
        mono=False,
        interocular=None,
        convergence=None,
        mode=None,
        source=StereoSettings.source,
        source_engine=None,
        fill=StereoSettings.fill,
        layout=None,
        format=None,
        holes=False,
        every=None,
        **dict.fromkeys(PANORAMAS),
    )


def _one_of_views(**field: Any) -> ViewsSettings:
    """Return settings of many views with this one field, so that it is checked by itself."""
    cone = {} if "baseline" in field else {"cone_degrees": DEFAULT_CONE_DEGREES}
    return ViewsSettings(**{"count": MIN_COUNT, **cone, **field})


def _add_views(parser: argparse.ArgumentParser) -> None:
    """Add the options that say how many views there are, where their cameras stand and how they are put together to a
    parser."""

    def add(option: str, metavar: str, field: str, read: Callable[[str], Any], text: str) -> None:
        group.add_argument(option, metavar=metavar, type=value_of(_one_of_views, field, read), help=text)

    parser.add_argument(
        "--display",
        metavar="NAME",
        type=str.lower,
        choices=DISPLAYS,
        help="the light-field display that the views are for, which says their number, cone, quilt, aspect and size: "
        f"{', '.join(DISPLAYS)}",
    )
    parser.add_argument(
        "--from-scene",
        action="store_true",
        help="the scene's own views, by cameras of their own anywhere: Output > Stereoscopy > Multi-View",
    )
    group: Any = parser
    add("--views", "N", "count", whole_number, f"number of views, {MIN_COUNT} to {MAX_COUNT} ({DEFAULT_COUNT})")
    group = parser.add_mutually_exclusive_group()
    cone = "angle between the outermost cameras, seen from the middle of the focus plane, in degrees"
    add("--cone", "DEGREES", "cone_degrees", number, f"{cone} ({DEFAULT_CONE_DEGREES:g})")
    add("--baseline", "D", "baseline", number, "distance between the outermost cameras, in scene units")
    group = parser
    focus = "distance at which all views show the same, in scene units; without it the camera's convergence distance"
    add("--focus", "D", "focus_distance", number, focus)
    parser.add_argument(
        "--quilt",
        metavar="COLUMNSxROWS",
        type=read_by(read_quilt),
        help="grid of the quilt, the picture of all views; without it one that suits their number (8x6)",
    )
    parser.add_argument(
        "--layout",
        dest="views_layout",
        type=str.lower,
        choices=VIEWS_LAYOUTS,
        default=VIEWS_LAYOUTS[0],
        help="how views are stored: individual, an EXR for each, or multi-view, one EXR of all (%(default)s)",
    )
    aspect = "width of the display over its height, where the pixels of a view are not square; such as 1.7778"
    add("--aspect", "RATIO", "aspect", number, aspect)
    fresh = (
        "share of each made view, 0 to 1, that is traced anew, so that less noise is common to neighbouring views (0)"
    )
    add("--fresh", "SHARE", "fresh", number, fresh)
    parser.set_defaults(fresh=ViewsSettings.fresh)
