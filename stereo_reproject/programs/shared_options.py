"""The options that several commands of the command line have, each with its check, and what they come to: settings."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import Any

from ..errors import BadInputError
from ..settings.accuracy import SETTINGS
from ..settings.animation import AnimationSettings, read_frames
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
        reuse=arguments.reuse,
        mono=arguments.mono,
        views=arguments.view_files,
    )


def add_scene(parser: argparse.ArgumentParser, *, frame: str = "frame to render") -> None:
    """Add the argument for the .blend, and the options that replace values of the scene for a pair, to a parser.
    `frame` is the help text of the option --frame."""
    add_scene_file(parser)
    add_picture(parser, frame=frame)
    _add_override(parser, "--interocular", "D", number, "distance between the eyes, in scene units")
    _add_override(parser, "--convergence", "D", number, "distance of zero parallax, in scene units")
    parser.add_argument("--mode", choices=CONVERGENCE_MODES, help="how the eyes converge")
    parser.add_argument(
        "--source", choices=EYES, default=StereoSettings.source, help="eye that is rendered whole (%(default)s)"
    )
    _add_panorama(parser)
    add_denoise(parser)
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


def add_scene_file(parser: argparse.ArgumentParser) -> None:
    """Add the argument for the .blend, and the option that forbids what it may lack, to a parser."""
    parser.add_argument("scene", metavar="SCENE.blend", help="the scene")
    parser.add_argument(
        "--strict",
        action="store_true",
        help="whatever the scene is known to lack before the first render is an error, such as a missing library or "
        "texture; without it, a warning",
    )


def add_picture(parser: argparse.ArgumentParser, *, frame: str = "frame to render", size_of: str = "one eye") -> None:
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
            f"roll are left out, and depth of field is off; SIZE is one eye's, {short} ({width}x{height}), or WxH of "
            "any shape: the same view, with pixels of other angles across than down",
        )


def add_denoise(parser: argparse.ArgumentParser, *, what: str = "both eyes") -> None:
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


def add_output(parser: argparse.ArgumentParser) -> None:
    """Add the option for the output folder to a parser."""
    parser.add_argument("--output", metavar="DIR", required=True, help="folder for the result; made if it is missing")


def add_quiet(parser: argparse.ArgumentParser) -> None:
    """Add the option that turns off progress and summary to a parser."""
    parser.add_argument("--quiet", action="store_true", help="no progress and no summary, only warnings and errors")


def add_frames(parser: argparse.ArgumentParser, *, without: str = "those of the scene") -> None:
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


def add_movie(parser: argparse.ArgumentParser, *, named: str) -> None:
    """Add the option for a movie of all frames, which is named after `named` where no name is given."""
    parser.add_argument(
        "--movie",
        metavar="FILE",
        nargs="?",
        const="",
        help=f"make a movie of all frames when they are there; in DIR and named after {named}, if FILE is left out",
    )


def add_pair(parser: argparse.ArgumentParser) -> None:
    """Add the options that say how the pair is made to a parser: accuracy, fill method, grid, interpolation and
    warp."""
    add_accuracy(parser, of="the other eye")
    parser.add_argument(
        "--fill",
        choices=FILL_METHODS,
        default=StereoSettings.fill,
        help="how it is traced: packed renders the missing pixels alone; card renders them through a card with "
        "openings; full renders the whole eye; auto takes the cheapest (%(default)s)",
    )
    add_packed_by(parser)
    add_warp(parser)


def add_accuracy(parser: argparse.ArgumentParser, *, of: str) -> None:
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


def _promises() -> str:
    """Return a text for the help of --accuracy: the honest ratio that each setting promises at most."""
    words = []
    for name, accuracy in SETTINGS.items():
        promise = "nothing" if accuracy.promise is None else f"an honest ratio of at most {accuracy.promise:g}"
        worst = f" and worst tiles of at most {accuracy.tile_limit:g}" if accuracy.promises_worst_tiles else ""
        words.append(f"{name} {promise}{worst}")
    return ", ".join(words)


def add_packed_by(parser: argparse.ArgumentParser) -> None:
    """Add the option that chooses the camera of packed pixels to a parser."""
    parser.add_argument(
        "--packed-by",
        choices=PACKED_CAMERAS,
        default=StereoSettings.packed_by,
        help="what shoots the rays of packed pixels: osl is an OSL camera, on CPU and OptiX; portal is a Ray Portal, "
        "on every device; auto takes osl where it can trace the scene, else portal (%(default)s)",
    )


def add_warp(parser: argparse.ArgumentParser) -> None:
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
