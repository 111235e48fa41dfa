"""Memory: given back to the system, and whether a process was ended or held short for want of it."""

from __future__ import annotations

import contextlib
import ctypes
import re
import sys
from pathlib import Path

SYSTEM = Path("/")
"""Root of the file system in which Linux has its counters."""


def give_back_freed() -> None:
    """Have the C library return freed memory to the system. Does nothing where it has no function for that.

    To be called between the frames of an animation: glibc keeps freed memory that lies below memory in use, and the
    next frame's pictures may not fit in there, so that the process would grow with each frame.
    """
    if sys.platform == "linux":
        # Not every C library of Linux has it.
        trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
        if trim is not None:
            trim(0)


def oom_kills() -> int | None:
    """Return how many processes the kernel has ended so far because memory had run out; None where nobody counts them.
    The count is that of this process's control group if it has one, else of the machine. Two counts, before and after,
    tell why a process was killed."""
    for place in (*_group_counters(), SYSTEM / "proc/vmstat"):
        with contextlib.suppress(OSError):
            found = re.search(r"^oom_kill (\d+)$", place.read_text(encoding="ascii", errors="replace"), re.MULTILINE)
            if found:
                return int(found[1])
    return None


def _group_counters() -> list[Path]:
    """Return the files that may hold the count of `oom_kills` for the control group of this process, for cgroup
    versions 1 and 2. They need not exist."""
    groups = SYSTEM / "sys/fs/cgroup"
    places = []
    with contextlib.suppress(OSError, ValueError):
        for line in (SYSTEM / "proc/self/cgroup").read_text(encoding="utf-8", errors="replace").splitlines():
            _, kinds, name = line.split(":", 2)
            if not kinds:
                places.append(groups / name.lstrip("/") / "memory.events")
            elif "memory" in kinds.split(","):
                places.append(groups / "memory" / name.lstrip("/") / "memory.oom_control")
    return places


def is_limited() -> bool:
    """Return True if the memory of this process, and so of those that it starts, is limited, as by `ulimit -v`."""
    if sys.platform == "win32":
        return False
    import resource

    return resource.getrlimit(resource.RLIMIT_AS)[0] != resource.RLIM_INFINITY
