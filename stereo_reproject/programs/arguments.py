"""The options of the command line, each with its check, and what they come to: settings."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from ..delivery.displays import DISPLAYS
from ..delivery.layouts import LAYOUTS
from ..errors import BadInputError
from ..settings.accuracy import SETTINGS
from ..settings.animation import AnimationSettings, read_every, read_frames
from ..settings.frame import (
    ACCURACIES,
    CONVERGENCE_MODES,
    EYES,
    FILL_METHODS,
    INTERPOLATIONS,
    PACKED_CAMERAS,
    PANORAMAS,
    SOURCE_ENGINES,
    WARPS,
    SceneOverrides,
    StereoSettings,
)
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
from ..tradeoff.cases import tradeoff_cases
from .converters import number, panorama_size, read_by, size, value_of, whole_number


def overrides_of(arguments: argparse.Namespace) -> SceneOverrides:
    """Return the scene values that the parsed command-line options replace; an option that was not given is None.
    Raises BadInputError where two of them give a size."""
    panorama = next((name for name in PANORAMAS if getattr(arguments, name) is not None), None)
    own_size = getattr(arguments, panorama) or None if panorama else None
    if own_size and arguments.size:
        raise BadInputError(f"--size and --{panorama} each say how large an eye is: leave one of the sizes out")
    return SceneOverrides(
        frame=arguments.frame,
        size=own_size or arguments.size,
        samples=arguments.samples,
        seed=arguments.seed,
        interocular_distance=arguments.interocular,
        convergence_distance=arguments.convergence,
        convergence_mode=arguments.mode,
        source_engine=arguments.source_engine,
        denoise=arguments.denoise,
        panorama=panorama,
    )


def settings_of(arguments: argparse.Namespace) -> StereoSettings:
    """Return the settings of a pair from the parsed command-line options. Raises BadInputError."""
    return StereoSettings(
        source=arguments.source,
        accuracy=arguments.accuracy,
        tolerance=arguments.tolerance,
        fill=arguments.fill,
        packed_by=arguments.packed_by,
        grid_threshold=arguments.grid_threshold,
        interpolation=arguments.interpolation,
        warp=arguments.warp,
        compare=arguments.compare,
        scene=overrides_of(arguments),
    )


def add_render_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the `render` command to a parser."""
    _add_scene(parser)
    _add_output(parser)
    _add_pair(parser)
    parser.add_argument(
        "--compare", action="store_true", help="also render with Blender's multiview, and measure against it"
    )
    _add_quiet(parser)


def animation_of(arguments: argparse.Namespace, output: Path) -> AnimationSettings:
    """Return the settings of an animation from the parsed command-line options. `output` is the absolute path of the
    folder for the frames. Raises BadInputError."""
    if arguments.frame is not None and arguments.frames is not None:
        raise BadInputError("--frame and --frames each say which frames are rendered: leave one of them out")
    frames = arguments.frames if arguments.frame is None else (arguments.frame,)
    return AnimationSettings(
        frames=frames,
        existing="resume" if arguments.resume else "overwrite" if arguments.overwrite else "refuse",
        output=str(output),
        layout=arguments.layout,
        file_format=arguments.format,
        movie=arguments.movie,
        holes=arguments.holes,
        compare_every=arguments.every,
        views=arguments.view_files,
    )


def add_animate_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the `animate` command to a parser."""
    _add_scene(parser, frame="the one frame to render, as --frames N")
    _add_output(parser)
    _add_frames(parser)
    _add_delivery(parser)
    _add_pair(parser)
    parser.add_argument(
        "--compare",
        metavar="every=N",
        dest="every",
        type=read_by(read_every),
        help="also render each N-th frame, from the scene's first on, with Blender's multiview, and measure against it",
    )
    _add_quiet(parser)
    parser.set_defaults(compare=False, view_files=False)


def _add_frames(parser: argparse.ArgumentParser, *, without: str = "those of the scene") -> None:
    """Add the options that say which frames are rendered, and how frames that exist already are treated. `without`
    names the frames that are rendered without the first of them."""
    parser.add_argument(
        "--frames",
        metavar="A-B[:STEP]",
        type=read_by(read_frames),
        help=f"frames to render, such as 1-24, 1-24:2 or 1-10,15; without it {without}",
    )
    existing = parser.add_mutually_exclusive_group()
    existing.add_argument(
        "--resume",
        action="store_true",
        help="keep frames that are there, whole and of this scene and settings, and render the rest; as many processes "
        "as you like may do so in one folder",
    )
    existing.add_argument("--overwrite", action="store_true", help="render all anew, whatever is there")


def _add_delivery(parser: argparse.ArgumentParser) -> None:
    """Add the options that say how an animation is stored: movie, stereo layout, file format, and pictures of the
    holes."""
    _add_movie(parser, named="its layout")
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


def _add_movie(parser: argparse.ArgumentParser, *, named: str) -> None:
    """Add the option for a movie of all frames, which is named after `named` where no name is given."""
    parser.add_argument(
        "--movie",
        metavar="FILE",
        nargs="?",
        const="",
        help=f"make a movie of all frames when they are there; in DIR and named after {named}, if FILE is left out",
    )


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


def add_views_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the `views` command to a parser."""
    _add_scene_file(parser)
    _add_picture(parser, size_of="one view")
    _add_output(parser)
    _add_frames(parser, without="the one of --frame")
    _add_movie(parser, named="the scene and the grid of its quilts")
    parser.add_argument(
        "--view-files",
        action="store_true",
        help="with --frames: also each view of each frame as an EXR of its own, in DIR/views",
    )
    _add_views(parser)
    _add_denoise(parser, what="all views")
    _add_accuracy(parser, of="each view")
    _add_packed_by(parser)
    _add_warp(parser)
    parser.add_argument(
        "--compare",
        action="store_true",
        help="also render three of the views plainly, the outermost and one between, and measure against them",
    )
    _add_quiet(parser)
    # What is said of pairs alone.
    parser.set_defaults(
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


def add_inspect_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the `inspect` command to a parser."""
    _add_scene(parser)
    parser.add_argument("--json", action="store_true", help="print JSON and nothing else on standard output")
    parser.add_argument(
        "--no-sketch", action="store_true", help="the plan alone: nothing is rendered, and no time predicted"
    )
    _add_pair(parser)
    parser.set_defaults(compare=False)


def add_tradeoff_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the `tradeoff` command to a parser."""
    _add_scene(parser)
    _add_output(parser)
    names = [run.name for run in tradeoff_cases()]
    parser.add_argument(
        "--only",
        metavar="RUN",
        nargs="+",
        choices=names,
        default=[],
        help=f"only these of its runs: {', '.join(names)}",
    )
    _add_quiet(parser)


def _promises() -> str:
    """Return a text for the help of --accuracy: the honest ratio that each setting promises at most."""
    words = []
    for name, accuracy in SETTINGS.items():
        promise = "nothing" if accuracy.promise is None else f"an honest ratio of at most {accuracy.promise:g}"
        worst = f" and worst tiles of at most {accuracy.tile_limit:g}" if accuracy.promises_worst_tiles else ""
        words.append(f"{name} {promise}{worst}")
    return ", ".join(words)


def _add_output(parser: argparse.ArgumentParser) -> None:
    """Add the option for the output folder to a parser."""
    parser.add_argument("--output", metavar="DIR", required=True, help="folder for the result; made if it is missing")


def _add_quiet(parser: argparse.ArgumentParser) -> None:
    """Add the option that turns off progress and summary to a parser."""
    parser.add_argument("--quiet", action="store_true", help="no progress and no summary, only warnings and errors")


def _add_scene(parser: argparse.ArgumentParser, *, frame: str = "frame to render") -> None:
    """Add the argument for the .blend, and the options that replace values of the scene for a pair, to a parser.
    `frame` is the help text of the option --frame."""
    _add_scene_file(parser)
    _add_picture(parser, frame=frame)
    _add_override(parser, "--interocular", "D", number, "distance between the eyes, in scene units")
    _add_override(parser, "--convergence", "D", number, "distance of zero parallax, in scene units")
    parser.add_argument("--mode", choices=CONVERGENCE_MODES, help="how the eyes converge")
    parser.add_argument(
        "--source", choices=EYES, default=StereoSettings.source, help="eye that is rendered whole (%(default)s)"
    )
    _add_panorama(parser)
    _add_denoise(parser)
    parser.add_argument(
        "--source-engine",
        choices=SOURCE_ENGINES,
        help="what renders it, in place of the scene's engine; Cycles traces the holes of either",
    )


OVERRIDES = {
    "--frame": "frame",
    "--size": "size",
    "--samples": "samples",
    "--seed": "seed",
    "--interocular": "interocular_distance",
    "--convergence": "convergence_distance",
}
"""Options that replace one value of the scene, each with its field of `SceneOverrides`."""


def _add_override(
    parser: argparse.ArgumentParser, option: str, metavar: str, read: Callable[[str], Any], text: str
) -> None:
    """Add one of OVERRIDES to a parser, with the function that reads its text, and its help text."""
    parser.add_argument(option, metavar=metavar, type=value_of(SceneOverrides, OVERRIDES[option], read), help=text)


def _add_scene_file(parser: argparse.ArgumentParser) -> None:
    """Add the argument for the .blend, and the option that forbids what it may lack, to a parser."""
    parser.add_argument("scene", metavar="SCENE.blend", help="the scene")
    parser.add_argument(
        "--strict",
        action="store_true",
        help="whatever the scene is known to lack before the first render is an error, such as a missing library or "
        "texture; without it, a warning",
    )


def _add_picture(parser: argparse.ArgumentParser, *, frame: str = "frame to render", size_of: str = "one eye") -> None:
    """Add the options that say which frame is rendered, how large and by how many samples to a parser. `frame` is the
    help text of the option --frame, size_of names what has the size."""
    _add_override(parser, "--frame", "N", whole_number, frame)
    _add_override(parser, "--size", "WxH", size, f"size of {size_of} in pixels, such as 1920x1080")
    _add_override(parser, "--samples", "N", whole_number, "samples per pixel")
    _add_override(parser, "--seed", "N", whole_number, "seed of the noise")


def _add_panorama(parser: argparse.ArgumentParser) -> None:
    """Add the two options that render a scene for headsets to a parser. Without a size the parsed value is empty, and
    without the option None."""
    either = parser.add_mutually_exclusive_group()
    for name, what, short in (("vr180", "VR180", "N for N x N"), ("vr360", "360°", "N for N x N/2")):
        width, height = PANORAMAS[name]
        either.add_argument(
            f"--{name}",
            metavar="SIZE",
            nargs="?",
            const=(),
            type=value_of(SceneOverrides, "size", panorama_size(name)),
            help=f"{what} for headsets, from the camera's place and with its heading: it stands upright, so pitch and "
            f"roll are left out, and depth of field is off; SIZE is one eye's, WxH or {short} ({width}x{height})",
        )


def _add_denoise(parser: argparse.ArgumentParser, *, what: str = "both eyes") -> None:
    """Add the two options that turn denoising on or off to a parser; with neither, the scene decides. `what` names what
    is denoised."""
    either = parser.add_mutually_exclusive_group()
    either.add_argument(
        "--denoise",
        action="store_true",
        default=None,
        help=f"denoise {what}, whatever the scene says; with the scene's own denoiser",
    )
    either.add_argument(
        "--no-denoise", dest="denoise", action="store_false", default=None, help="leave them noisy, whatever it says"
    )


def _add_pair(parser: argparse.ArgumentParser) -> None:
    """Add the options that say how the pair is made to a parser: accuracy, fill method, grid, interpolation and
    warp."""
    _add_accuracy(parser, of="the other eye")
    parser.add_argument(
        "--fill",
        choices=FILL_METHODS,
        default=StereoSettings.fill,
        help="how it is traced: packed renders the missing pixels alone; card renders them through a card with "
        "openings; full renders the whole eye; auto takes the cheapest (%(default)s)",
    )
    _add_packed_by(parser)
    _add_warp(parser)


def _add_accuracy(parser: argparse.ArgumentParser, *, of: str) -> None:
    """Add the two options that say what is promised to a parser. `of` names what the promise is of."""
    accuracy = parser.add_mutually_exclusive_group()
    accuracy.add_argument(
        "--accuracy",
        choices=ACCURACIES,
        default=StereoSettings.accuracy,
        help=f"what is promised of {of}: {_promises()} (%(default)s)",
    )
    accuracy.add_argument(
        "--tolerance",
        metavar="RATIO",
        type=value_of(StereoSettings, "tolerance", number),
        help="the same as the honest ratio that is allowed at most, such as 1.07: 1 is as good as rendering it again",
    )


def _add_packed_by(parser: argparse.ArgumentParser) -> None:
    """Add the option that chooses the camera of packed pixels to a parser."""
    parser.add_argument(
        "--packed-by",
        choices=PACKED_CAMERAS,
        default=StereoSettings.packed_by,
        help="what shoots the rays of packed pixels: osl is an OSL camera, on CPU and OptiX; portal is a Ray Portal, "
        "on every device; auto takes osl where it can trace the scene, else portal (%(default)s)",
    )


def _add_warp(parser: argparse.ArgumentParser) -> None:
    """Add the options that say how pixels are warped to a parser: grid, interpolation and warp."""
    _add_grid_threshold(parser)
    parser.add_argument(
        "--interpolation",
        choices=INTERPOLATIONS,
        default=StereoSettings.interpolation,
        help="how passes are looked up between pixels; cubic is sharper, and what auto takes for the colour of a "
        "denoised picture, and for light that stands above its noise (%(default)s)",
    )
    parser.add_argument(
        "--warp",
        choices=WARPS,
        default=StereoSettings.warp,
        help="what warps pixels; auto measures once which is faster, in animations of large pictures; "
        "gpu is numpy where no GPU can be used (%(default)s)",
    )


def _add_grid_threshold(parser: argparse.ArgumentParser) -> None:
    """Add the option --grid-threshold to a parser."""
    parser.add_argument(
        "--grid-threshold",
        metavar="ARCMIN",
        type=value_of(StereoSettings, "grid_threshold", number),
        default=StereoSettings.grid_threshold,
        help="parallax within a grid cell from which it is subdivided, in arc minutes (%(default)s)",
    )
