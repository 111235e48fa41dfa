"""The command line: reads and checks the arguments, has the work done by `supervisor`, and says how it went.

Nothing here imports bpy; what cannot be checked without Blender is checked by the worker process.
"""

from __future__ import annotations

import argparse
import contextlib
import importlib.metadata
import os
import re
import stat
import tomllib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn

from .console import PROGRAM, Console
from .errors import BadInputError, StereoReprojectError
from .inspection import format_inspection
from .report import format_report_table, to_json
from .settings import (
    ACCURACIES,
    CONVERGENCE_MODES,
    EYES,
    FILL_METHODS,
    INTERPOLATIONS,
    SceneOverrides,
    StereoSettings,
)
from .supervisor import Event, Interrupts, Job, RunInterruptedError, run_worker

INTERRUPTED_STATUS = 130
# As saved by Blender: plain, with gzip (before 3.0), with Zstandard (from 3.0).
BLEND_MAGICS = (b"BLENDER", b"\x1f\x8b", b"\x28\xb5\x2f\xfd")


def main(argv: Sequence[str] | None = None, *, worker_command: Sequence[str] | None = None) -> int:
    """Run the command line with `argv` and return its exit status; `worker_command` starts another worker."""
    console = Console()
    try:
        arguments = _parser().parse_args(argv)
        status = arguments.run(arguments, console, worker_command)
    except SystemExit as finished:
        # That is how argparse ends after --help and --version.
        status = finished.code if isinstance(finished.code, int) else 0
    except StereoReprojectError as error:
        console.complain(str(error), kind=None if isinstance(error, RunInterruptedError) else "error")
        status = error.exit_status
    except KeyboardInterrupt:
        console.complain("interrupted", kind=None)
        status = INTERRUPTED_STATUS
    return console.finish(status)


def _render(arguments: argparse.Namespace, console: Console, worker_command: Sequence[str] | None) -> int:
    console.quiet = arguments.quiet
    if not arguments.output:
        raise BadInputError("--output is empty; name a folder for the result")
    job = Job(_blend_file(arguments.scene), _absolute(arguments.output), _settings(arguments))
    with Interrupts() as interrupts:
        report = run_worker(
            job, console.on_event, on_tick=console.on_tick, interrupts=interrupts, command=worker_command
        )
    console.end_stage()
    console.show(format_report_table(report))
    console.show(f"files         {job.output}{os.sep}\n  {', '.join(job.files)}")
    return 0


def _inspect(arguments: argparse.Namespace, console: Console, worker_command: Sequence[str] | None) -> int:
    command = "plan" if arguments.no_sketch else "inspect"
    job = Job(_blend_file(arguments.scene), None, _settings(arguments), command, files=())

    def on_event(event: Event) -> None:
        # As JSON, nothing else may be on standard output.
        if event["event"] == "warning" or not arguments.json:
            console.on_event(event)

    with Interrupts() as interrupts:
        inspection = run_worker(job, on_event, on_tick=console.on_tick, interrupts=interrupts, command=worker_command)
    console.end_stage()
    console.show(to_json(inspection) if arguments.json else format_inspection(inspection))
    return 0


def _settings(arguments: argparse.Namespace) -> StereoSettings:
    overrides = SceneOverrides(
        frame=arguments.frame,
        size=arguments.size,
        samples=arguments.samples,
        seed=arguments.seed,
        interocular_distance=arguments.interocular,
        convergence_distance=arguments.convergence,
        convergence_mode=arguments.mode,
    )
    return StereoSettings(
        source=arguments.source,
        accuracy=arguments.accuracy,
        tolerance=arguments.tolerance,
        fill=arguments.fill,
        grid_threshold=arguments.grid_threshold,
        interpolation=arguments.interpolation,
        compare=arguments.compare,
        scene=overrides,
    )


def _absolute(name: str) -> Path:
    # Links stay as they are: paths in a .blend are relative to where it was opened.
    return Path(os.path.abspath(name))  # noqa: PTH100


def _blend_file(name: str) -> Path:
    """The absolute path of the .blend called `name`. Raises BadInputError if it is none or cannot be read."""
    path = _absolute(name)
    try:
        if stat.S_ISDIR(path.stat().st_mode):
            raise BadInputError(f"{path} is a folder; name a .blend file")
        if not stat.S_ISREG(path.stat().st_mode):
            raise BadInputError(f"{path} is not a regular file; name a .blend file")
        with path.open("rb") as file:
            start = file.read(max(map(len, BLEND_MAGICS)))
    except (FileNotFoundError, NotADirectoryError) as error:
        raise BadInputError(f"{path} does not exist; check the path of the .blend file") from error
    except OSError as error:
        raise BadInputError(f"{path} cannot be read ({error.strerror}); check its permissions") from error
    if not start.startswith(BLEND_MAGICS):
        raise BadInputError(f"{path} is not a .blend file; name one that Blender saved")
    return path


def version() -> str:
    """The version of this package, from the manifest where that lies beside it, else from the installed metadata."""
    manifest = Path(__file__).resolve().parent.parent / "blender_manifest.toml"
    with contextlib.suppress(OSError, ValueError):
        fields = tomllib.loads(manifest.read_text(encoding="utf-8"))
        if fields.get("id") == PROGRAM:
            return str(fields["version"])
    with contextlib.suppress(importlib.metadata.PackageNotFoundError):
        return importlib.metadata.version(PROGRAM)
    return "of unknown version"


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        raise BadInputError(f"{message}; `{self.prog} --help` lists what can be given")


class _ShowVersion(argparse.Action):
    def __call__(self, parser: argparse.ArgumentParser, *_: Any) -> NoReturn:
        Console().show(f"{PROGRAM} {version()}")
        parser.exit()


@dataclass(frozen=True)
class Command:
    """One sub-command: what it is called, what it takes, and what it does."""

    name: str
    summary: str
    examples: str
    add_arguments: Callable[[argparse.ArgumentParser], None]
    run: Callable[[argparse.Namespace, Console, Sequence[str] | None], int]


def _whole_number(text: str) -> int:
    if not re.fullmatch(r"[+-]?[0-9]{1,18}", text):
        raise ValueError("a whole number")
    return int(text)


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise ValueError("a number") from None


def _size(text: str) -> tuple[int, int]:
    if not re.fullmatch(r"[0-9]{1,18}[xX][0-9]{1,18}", text):
        raise ValueError("of the form WIDTHxHEIGHT, such as 1920x1080")
    width, height = re.split("[xX]", text)
    return int(width), int(height)


def _value_of(settings: type, field: str, read: Callable[[str], Any]) -> Callable[[str], Any]:
    """A converter for argparse that has the settings check the value, so that a complaint names the option."""

    def convert(text: str) -> Any:
        try:
            value = read(text)
            settings(**{field: value})
        except ValueError as wanted:
            raise argparse.ArgumentTypeError(f"must be {wanted}, not {text!r}") from None
        except BadInputError as error:
            raise argparse.ArgumentTypeError(str(error)) from None
        return value

    return convert


def _add_render_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("scene", metavar="SCENE.blend", help="the scene to render")
    parser.add_argument("--output", metavar="DIR", required=True, help="folder for the result; made if it is missing")
    _add_pair_arguments(parser)
    parser.add_argument(
        "--compare", action="store_true", help="also render with Blender's multiview, and measure against it"
    )
    parser.add_argument("--quiet", action="store_true", help="no progress and no summary, only warnings and errors")


def _add_inspect_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("scene", metavar="SCENE.blend", help="the scene to inspect")
    parser.add_argument("--json", action="store_true", help="print JSON and nothing else on standard output")
    parser.add_argument(
        "--no-sketch", action="store_true", help="the plan alone: nothing is rendered, and no time predicted"
    )
    _add_pair_arguments(parser)
    parser.set_defaults(compare=False)


def _add_pair_arguments(parser: argparse.ArgumentParser) -> None:
    """What replaces the scene's own settings, and how its pair is made."""

    def override(option: str, metavar: str, field: str, read: Callable[[str], Any], text: str) -> None:
        parser.add_argument(option, metavar=metavar, type=_value_of(SceneOverrides, field, read), help=text)

    override("--frame", "N", "frame", _whole_number, "frame to render")
    override("--size", "WxH", "size", _size, "size of one eye in pixels, such as 1920x1080")
    override("--samples", "N", "samples", _whole_number, "samples per pixel")
    override("--seed", "N", "seed", _whole_number, "seed of the noise")
    override("--interocular", "D", "interocular_distance", _number, "distance between the eyes, in scene units")
    override("--convergence", "D", "convergence_distance", _number, "distance of zero parallax, in scene units")
    parser.add_argument("--mode", choices=CONVERGENCE_MODES, help="how the eyes converge")
    parser.add_argument(
        "--source", choices=EYES, default=StereoSettings.source, help="eye that is rendered whole (%(default)s)"
    )
    accuracy = parser.add_mutually_exclusive_group()
    accuracy.add_argument(
        "--accuracy",
        choices=ACCURACIES,
        default=StereoSettings.accuracy,
        help="how much of the other eye is traced anew where it cannot be taken over (%(default)s)",
    )
    accuracy.add_argument(
        "--tolerance",
        metavar="RATIO",
        type=_value_of(StereoSettings, "tolerance", _number),
        help="the same as the noise ratio that is allowed at most, such as 1.07: 1 is as good as rendering it again",
    )
    parser.add_argument(
        "--fill",
        choices=FILL_METHODS,
        default=StereoSettings.fill,
        help="how it is traced: packed needs Cycles with OSL on CPU or OptiX; card works everywhere; full renders the "
        "whole eye; auto takes the cheapest (%(default)s)",
    )
    parser.add_argument(
        "--grid-threshold",
        metavar="ARCMIN",
        type=_value_of(StereoSettings, "grid_threshold", _number),
        default=StereoSettings.grid_threshold,
        help="parallax within a grid cell from which it is subdivided, in arc minutes (%(default)s)",
    )
    parser.add_argument(
        "--interpolation",
        choices=INTERPOLATIONS,
        default=StereoSettings.interpolation,
        help="how colours are looked up between pixels; cubic is sharper (%(default)s)",
    )


COMMANDS = (
    Command(
        "render",
        "Render the stereo pair of one frame. What is left out comes from the .blend.",
        "  %(prog)s room.blend --output out\n"
        "  %(prog)s room.blend --output out --size 1920x1080 --samples 128 --compare\n"
        "  %(prog)s room.blend --output out --interocular 0.065 --convergence 2.5 --mode off-axis\n",
        _add_render_arguments,
        _render,
    ),
    Command(
        "inspect",
        "Say which effects a scene calls for, how each is handled, and what its pair will cost; renders only a sketch.",
        "  %(prog)s room.blend\n  %(prog)s room.blend --size 1920x1080 --samples 128 --json\n",
        _add_inspect_arguments,
        _inspect,
    ),
)


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog=f"python -m {PROGRAM}",
        description="A stereo pair from a Blender scene, for little more than the price of one eye.",
        epilog="exit status: 0 done, 1 failed, 2 bad input, 130 interrupted",
        allow_abbrev=False,
    )
    parser.add_argument("--version", nargs=0, action=_ShowVersion, help="show the version and exit")
    commands = parser.add_subparsers(metavar="COMMAND", required=True, parser_class=_Parser)
    for command in COMMANDS:
        subparser = commands.add_parser(
            command.name,
            help=command.summary,
            description=command.summary,
            epilog=f"examples:\n{command.examples}",
            formatter_class=argparse.RawDescriptionHelpFormatter,
            allow_abbrev=False,
        )
        command.add_arguments(subparser)
        subparser.set_defaults(run=command.run)
    return parser
