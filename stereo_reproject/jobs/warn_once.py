"""Warnings that are given once, however often they are found: by every start of Blender, and for every frame."""

from __future__ import annotations

from collections.abc import Callable, Iterable


class WarnOnce:
    """A function that passes each text on to `warn` the first time that it is called with it, and ignores repetitions.

    The attribute `given` lists the texts so far, in order. The argument `given` has texts that count as given before.
    """

    def __init__(self, warn: Callable[[str], None], given: Iterable[str] = ()) -> None:
        self._warn = warn
        self.given = list(given)

    def __call__(self, text: str) -> None:
        if text not in self.given:
            self.given.append(text)
            self._warn(text)
