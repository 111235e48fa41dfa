"""Memory that is freed, back to the system."""

from __future__ import annotations

import ctypes
import sys


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
