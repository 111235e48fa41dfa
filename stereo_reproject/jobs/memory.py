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
    """Have the allocator keep nothing for later; where it cannot be asked, nothing happens.

    glibc keeps what is freed below something that is not, and the pictures of the next frame may not fit in there: a
    long animation would hold more with each frame, though nothing is left of it.
    """
    if sys.platform == "linux":
        # Not every C library of Linux has it.
        trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
        if trim is not None:
            trim(0)


def oom_kills() -> int | None:
    """Processes that the kernel has ended so far because memory had run out: of this control group where it counts
    them, else of the machine; None where nobody counts them."""
    for place in (*_group_counters(), SYSTEM / "proc/vmstat"):
        with contextlib.suppress(OSError):
            found = re.search(r"^oom_kill (\d+)$", place.read_text(encoding="ascii", errors="replace"), re.MULTILINE)
            if found:
                return int(found[1])
    return None


def _group_counters() -> list[Path]:
    """Files that count for the control group of this process, of either version."""
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
    """Return whether the memory of this process and of those that it starts is limited, as by `ulimit -v`."""
    if sys.platform == "win32":
        return False
    import resource

    return resource.getrlimit(resource.RLIMIT_AS)[0] != resource.RLIM_INFINITY
