"""Other tuned numbers in use for a while: what a measurement changes to see what it costs and buys."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any


@contextmanager
def in_use(tuning: Any) -> Iterator[None]:
    """Have these tuned numbers, an instance of a room's `…Tuning`, in use for the time of a `with` block.

    Every module of the package that holds the room's own instance, by whatever name, holds this one meanwhile. Numbers
    that a module has read when it was loaded stay as they were: tests/bench/test_spending.py says which those are.
    """
    shipped = sys.modules[type(tuning).__module__].TUNING
    places = [
        (module, name)
        for module in list(sys.modules.values())
        if getattr(module, "__name__", "").startswith("stereo_reproject.")
        for name, value in vars(module).items()
        if value is shipped
    ]
    try:
        for module, name in places:
            setattr(module, name, tuning)
        yield
    finally:
        for module, name in places:
            setattr(module, name, shipped)
