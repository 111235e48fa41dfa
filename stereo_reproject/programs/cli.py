"""The command line: reads and checks the arguments, has the work done by `supervisor`, and says how it went.

Nothing here imports bpy; what cannot be checked without Blender is checked by the worker process.
"""

from __future__ import annotations

import argparse
import contextlib
import importlib.metadata
import os
import stat
import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NoReturn

from ..errors import BadInputError, StereoReprojectError
from ..files import to_json
from ..jobs.console import PROGRAM, Console
from ..jobs.interrupts import Interrupts, RunInterruptedError
from ..jobs.supervisor import Event, Job, run_worker
from ..jobs.work_folder import CUTOUTS, pair_files, views_files, with_cutouts
from ..report.inspection import format_inspection
from ..report.table import format_report_table
from ..report.views_table import format_views_table
from ..sequence.report import format_animation
from ..sequence.supervisor import run_animation
from ..settings.frame import StereoSettings, for_mono
from ..tradeoff.cases import TRADEOFF_FILES, format_price_table
from .animate_options import add_animate_arguments
from .converters import OneLineParser
from .inspect_options import add_inspect_arguments
from .render_options import add_render_arguments
from .shared_options import animation_of, overrides_of, settings_of
from .tradeoff_options import add_tradeoff_arguments
from .views_options import add_views_arguments, check_frames_of_views, views_of

INTERRUPTED_STATUS = 130
# As saved by Blender: plain, with gzip (before 3.0), with Zstandard (from 3.0).
BLEND_MAGICS = (b"BLENDER", b"\x1f\x8b", b"\x28\xb5\x2f\xfd")


@dataclass(frozen=True)
class Host:
    """The facts about the program that runs this command line. program is its name in help texts. worker_command starts
    the worker process; None starts our own. devices are Cycles' devices, as in `supervisor.Session`; None leaves them
    to the worker's preferences."""

    program: str = f"python -m {PROGRAM}"
    worker_command: Sequence[str] | None = None
    devices: Mapping[str, Any] | None = None

    def job(self, job: Job) -> Job:
        """Return the job with this host's devices put into its session."""
        return replace(job, session=replace(job.session, devices=self.devices))


def main(argv: Sequence[str] | None = None, *, host: Host | None = None) -> int:
    """Run the command line and return its exit status; errors are printed, not raised. argv are the arguments without
    the program's name, by default those of this process. host is the program that it runs in, by default `python -m
    stereo_reproject`."""
    host = host or Host()
    console = Console()
    try:
        arguments = _parser(host.program).parse_args(argv)
        status = arguments.run(arguments, console, host)
    except SystemExit as finished:
        # That is how argparse ends after --help and --version.
        status = finished.code if isinstance(finished.code, int) else 0
    except StereoReprojectError as error:
        # That a run was interrupted has been said already.
        if not isinstance(error, RunInterruptedError):
            console.complain(str(error), kind="error")
        status = error.exit_status
    except KeyboardInterrupt:
        console.complain("interrupted", kind=None)
        status = INTERRUPTED_STATUS
    return console.finish(status)


def _render(arguments: argparse.Namespace, console: Console, host: Host) -> int:
    """Run the `render` command: render a pair, print its report, and return the exit status."""
    settings = settings_of(arguments)
    job = _scene_job(arguments, settings, files=pair_files(compare=settings.compare))
    return _run(job, arguments, console, host, format_report_table)


def _animate(arguments: argparse.Namespace, console: Console, host: Host) -> int:
    """Run the `animate` command: render the frames, print the summary and the files, and return the exit status."""
    settings = settings_of(arguments)
    if arguments.mono:
        # Here to refuse what is of two eyes; the worker does it again.
        for_mono(settings)
    return _run_frames(_scene_job(arguments, settings, command="animate", files=()), arguments, console, host)


def _run_frames(job: Job, arguments: argparse.Namespace, console: Console, host: Host) -> int:
    """Have the frames of an animation rendered by a job that lacks only the animation's settings, print the summary and
    the files, and return the exit status."""
    assert job.output is not None
    if arguments.movie:
        named = arguments.movie.endswith(("/", os.sep))
        arguments.movie = f"{_beside(arguments.movie, job.blend)}{os.sep if named else ''}"
    job = replace(job, animation=animation_of(arguments, job.output))
    console.quiet = arguments.quiet
    report = _have_done(job, console, host, console.on_event, run=run_animation)
    console.show(format_animation(report))
    for movie in report.get("movies", ()):
        console.show(f"movie         {movie}")
    console.show(f"files         {job.output}{os.sep}")
    return 0


def _views(arguments: argparse.Namespace, console: Console, host: Host) -> int:
    """Run the `views` command: render many views of a frame, or of many, print their report, and return the exit
    status."""
    views = views_of(arguments)
    check_frames_of_views(arguments)
    arguments.size = arguments.size or views.view_size
    files = views_files(views.names, views.layout) if arguments.frames is None else ()
    job = _scene_job(arguments, settings_of(arguments), command="views", views=views, files=files)
    if arguments.frames is not None:
        return _run_frames(job, arguments, console, host)
    return _run(job, arguments, console, host, format_views_table)


def _tradeoff(arguments: argparse.Namespace, console: Console, host: Host) -> int:
    """Run the `tradeoff` command: measure the price list, print its table, and return the exit status."""
    settings = StereoSettings(source=arguments.source, scene=overrides_of(arguments))
    job = _scene_job(arguments, settings, command="tradeoff", files=TRADEOFF_FILES, only=tuple(arguments.only))
    return _run(job, arguments, console, host, format_price_table)


def _run(
    job: Job,
    arguments: argparse.Namespace,
    console: Console,
    host: Host,
    table: Callable[[Any], str],
) -> int:
    """Have the job done by a worker, print the table that `table` makes of its report, and the files that it made.
    Return the exit status."""
    console.quiet = arguments.quiet
    report = _have_done(job, console, host, console.on_event)
    console.show(table(report))
    assert job.output is not None
    console.show(f"files         {job.output}{os.sep}\n  {', '.join(_shown_files(job, report, job.output))}")
    return 0


def _shown_files(job: Job, report: Mapping[str, Any], output: Path) -> Sequence[str]:
    """Return the names of the files that a finished job has put into the folder `output`, as they are printed: of each
    folder's only the first and the last."""
    if job.views is not None:
        shown: dict[str, list[str]] = {}
        for name in report["files"]:
            shown.setdefault(name.rpartition("/")[0] or name, []).append(name)
        return [names[0] if len(names) == 1 else f"{names[0]} to {names[-1]}" for names in shown.values()]
    return with_cutouts(job.files, cutouts=job.command == "render" and (output / CUTOUTS).is_file())


def _have_done(
    job: Job,
    console: Console,
    host: Host,
    on_event: Callable[[Event], None],
    *,
    run: Callable[..., dict[str, Any]] = run_worker,
) -> dict[str, Any]:
    """Have the job done by the host's worker and return its report, with signals held back meanwhile. on_event gets the
    worker's events. `run` is the function that starts the worker: `run_worker` or one with the same arguments. Where
    the run is interrupted, the error that it raises has been shown."""
    with Interrupts() as interrupts:
        try:
            report = run(
                host.job(job), on_event, on_tick=console.on_tick, interrupts=interrupts, command=host.worker_command
            )
        except RunInterruptedError as error:
            # Said while further signals are still held back: one that comes after this block may end the process.
            console.let_go()
            console.complain(str(error), kind=None)
            raise
    console.end_stage()
    return report


def _inspect(arguments: argparse.Namespace, console: Console, host: Host) -> int:
    """Run the `inspect` command: print what the scene calls for and what its pair will cost, as a table or as JSON, and
    return the exit status."""
    command = "plan" if arguments.no_sketch else "inspect"
    job = Job(_blend_file(arguments.scene), None, settings_of(arguments), command, files=(), strict=arguments.strict)

    def on_event(event: Event) -> None:
        # As JSON, nothing else may be on standard output.
        if event["event"] == "warning" or not arguments.json:
            console.on_event(event)

    inspection = _have_done(job, console, host, on_event)
    console.show(to_json(inspection) if arguments.json else format_inspection(inspection))
    return 0


def _scene_job(arguments: argparse.Namespace, settings: StereoSettings, **what: Any) -> Job:
    """Return the job for the .blend and the output folder in the parsed options; `what` are further fields of the
    `Job`. Raises BadInputError."""
    if not arguments.output:
        raise BadInputError("--output is empty; name a folder for the result")
    blend = _blend_file(arguments.scene)
    return Job(blend, _beside(arguments.output, blend), settings, strict=arguments.strict, **what)


def _beside(name: str, blend: Path) -> Path:
    """Return the absolute path of a file or folder that the user named. A name that begins with // is relative to the
    .blend's folder, as in Blender; any other is relative to the current folder."""
    return _absolute(f"{blend.parent}/{name[2:]}" if name.startswith("//") else name)


def _absolute(name: str) -> Path:
    """Return the absolute path of a name; links are not followed. Raises BadInputError where the current folder is
    gone."""
    try:
        # Links stay as they are: paths in a .blend are relative to where it was opened.
        return Path(os.path.abspath(name))  # noqa: PTH100
    except FileNotFoundError as error:
        raise BadInputError(f"{name} is relative to a folder that is gone: change to another one") from error


def _blend_file(name: str) -> Path:
    """Return the absolute path of the .blend that the user named, once its first bytes were checked. Raises
    BadInputError if it cannot be read or is no .blend."""
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
    """Return the version of this package: from the extension's manifest if that lies beside the package, else from the
    installed metadata, else a text that says that it is unknown."""
    manifest = Path(__file__).resolve().parents[2] / "blender_manifest.toml"
    with contextlib.suppress(OSError, ValueError):
        fields = tomllib.loads(manifest.read_text(encoding="utf-8"))
        if fields.get("id") == PROGRAM:
            return str(fields["version"])
    with contextlib.suppress(importlib.metadata.PackageNotFoundError):
        return importlib.metadata.version(PROGRAM)
    return "of unknown version"


class _ShowVersion(argparse.Action):
    """The action of the option --version: print the version and exit."""

    def __call__(self, parser: argparse.ArgumentParser, *_: Any) -> NoReturn:
        Console().show(f"{PROGRAM} {version()}")
        parser.exit()


@dataclass(frozen=True)
class Command:
    """One sub-command of the command line, such as `render`: its name, its summary and examples for the help, the
    function that adds its options to a parser, and the function that runs it and returns the exit status."""

    name: str
    summary: str
    examples: str
    add_arguments: Callable[[argparse.ArgumentParser], None]
    run: Callable[[argparse.Namespace, Console, Host], int]


COMMANDS = (
    Command(
        "render",
        "Render the stereo pair of one frame. What is left out comes from the .blend.",
        "  %(prog)s room.blend --output out\n"
        "  %(prog)s room.blend --output out --size 1920x1080 --samples 128 --compare\n"
        "  %(prog)s room.blend --output out --interocular 0.065 --convergence 2.5 --mode off-axis\n",
        add_render_arguments,
        _render,
    ),
    Command(
        "animate",
        "Render the stereo pairs of many frames, in any number of processes, and go on where an earlier run ended.",
        "  %(prog)s shot.blend --output frames\n"
        "  %(prog)s shot.blend --output frames --frames 1-240 --resume --movie --layout side-by-side-half\n"
        "  %(prog)s shot.blend --output frames --frames 1-240 --resume --compare every=24\n",
        add_animate_arguments,
        _animate,
    ),
    Command(
        "views",
        "Render many views of a frame, or of many: for light-field displays, or the scene's own. Puts them in a quilt.",
        "  %(prog)s room.blend --output out --display portrait\n"
        "  %(prog)s room.blend --output out --views 48 --cone 40 --size 420x560 --focus 2.5\n"
        "  %(prog)s room.blend --output out --views 12 --baseline 0.3 --quilt 4x3 --compare\n"
        "  %(prog)s rig.blend --output out --from-scene --layout multi-view\n"
        "  %(prog)s shot.blend --output out --display portrait --frames 1-240 --resume --movie\n",
        add_views_arguments,
        _views,
    ),
    Command(
        "inspect",
        "Say which effects a scene calls for, how each is handled, and what its pair will cost; renders only a sketch.",
        "  %(prog)s room.blend\n  %(prog)s room.blend --size 1920x1080 --samples 128 --json\n",
        add_inspect_arguments,
        _inspect,
    ),
    Command(
        "tradeoff",
        "Measure what every setting costs on one frame and how good it is, against other ways to make the pair.",
        "  %(prog)s room.blend --output prices --size 640x360 --samples 64\n",
        add_tradeoff_arguments,
        _tradeoff,
    ),
)


def _parser(program: str) -> argparse.ArgumentParser:
    """Return the parser of the whole command line, with a sub-parser for each of COMMANDS. `program` is the program's
    name in help texts."""
    parser = OneLineParser(
        prog=program,
        description="A stereo pair from a Blender scene, for little more than the price of one eye.",
        epilog="exit status: 0 done, 1 failed, 2 bad input, 130 interrupted",
        allow_abbrev=False,
    )
    parser.add_argument("--version", nargs=0, action=_ShowVersion, help="show the version and exit")
    commands = parser.add_subparsers(metavar="COMMAND", required=True, parser_class=OneLineParser)
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
