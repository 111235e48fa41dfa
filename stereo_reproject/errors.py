"""The two ways in which a run ends early, each with the exit status that a command line gives it."""

import traceback

from .words import Words


class StereoReprojectError(Exception):
    """The base of this package's errors: the run failed. The message says in one line what failed, where, and what the
    user can do. `exit_status` is the exit status of the command line then."""

    exit_status = 1


class BadInputError(StereoReprojectError):
    """The input cannot be used as it was given, such as a wrong option or an unusable scene. The message is for the
    user who gave it."""

    exit_status = 2


class OutputError(BadInputError):
    """The folder for the results cannot be written to. Every other frame would fail there too, so an animation stops at
    once."""


class OtherRunError(BadInputError):
    """Another run renders the same frames into the same folder, but by other settings or of another scene. This run has
    to give way."""


LIMITED = "if its memory is limited (ulimit -v), allow it more"
"""Advice for a program that has met with its memory limit."""

NO_ROOM_FOR_A_LIBRARY = (
    "failed to map segment",
    "cannot map zero-fill pages",
    "cannot change memory protections",
    "Cannot allocate memory",
    "cannot allocate memory",
)
"""Parts of the messages of the C libraries of Linux and macOS when there is no room for a library."""

NAME_BYTES = 63
"""The longest name that a datablock had before Blender 5."""


def in_one_line(error: Exception) -> StereoReprojectError:
    """Return any exception as an error of this package with a message of one line, for the user.

    An error of this package is returned as it is. An exception of a kind that is not known here counts as a defect: its
    traceback is also printed on standard error.
    """
    match error:
        case StereoReprojectError():
            return error
        case MemoryError():
            return StereoReprojectError("out of memory: take a smaller size, or free some")
        case ImportError() if any(words in str(error) for words in NO_ROOM_FOR_A_LIBRARY):
            return StereoReprojectError(
                Words(
                    "out of memory, a library cannot be loaded ({reason}): {limited}",
                    reason=str(error),
                    limited=Words(LIMITED),
                )
            )
        case UnicodeDecodeError():
            # Blender keeps such bytes, and Python cannot read them; files themselves are read as bytes.
            name = error.object[:NAME_BYTES].decode("ascii", "backslashreplace")
            return BadInputError(
                Words("a name in the .blend is no UTF-8 ({name}): rename what is called so in Blender", name=name)
            )
        case OSError():
            return BadInputError(
                Words(
                    "{reason}: {where}",
                    reason=error.strerror or str(error),
                    where=error.filename or Words("while writing"),
                )
            )
    traceback.print_exception(error)
    return StereoReprojectError(
        Words("a defect of stereo_reproject: {kind}: {reason}", kind=type(error).__name__, reason=str(error))
    )
