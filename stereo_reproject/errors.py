"""The two ways in which a run ends early, each with the exit status that a command line gives it."""

import traceback


class StereoReprojectError(Exception):
    """The run failed; the message says what, where and what to do, on one line."""

    exit_status = 1


class BadInputError(StereoReprojectError):
    """Something that was asked for cannot be done as asked; the message is for whoever asked."""

    exit_status = 2


class OutputError(BadInputError):
    """Nothing can be written where the result belongs, so that other frames need not be tried."""


class OtherRunError(BadInputError):
    """Another run renders the same frames by other settings, or of another scene: one of the two has to end."""


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
    """Return any exception as an error of this package, in one line; one that nobody has foreseen is logged in full."""
    match error:
        case StereoReprojectError():
            return error
        case MemoryError():
            return StereoReprojectError("out of memory: take a smaller size, or free some")
        case ImportError() if any(words in str(error) for words in NO_ROOM_FOR_A_LIBRARY):
            return StereoReprojectError(f"out of memory, a library cannot be loaded ({error}): {LIMITED}")
        case UnicodeDecodeError():
            # Blender keeps such bytes, and Python cannot read them; files themselves are read as bytes.
            name = error.object[:NAME_BYTES].decode("ascii", "backslashreplace")
            return BadInputError(f"a name in the .blend is no UTF-8 ({name}): rename what is called so in Blender")
        case OSError():
            return BadInputError(f"{error.strerror or error}: {error.filename or 'while writing'}")
    traceback.print_exception(error)
    return StereoReprojectError(f"a defect of stereo_reproject: {type(error).__name__}: {error}")
