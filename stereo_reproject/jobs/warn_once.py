"""Warnings, each of them passed on once."""

from __future__ import annotations

from collections.abc import Callable, Iterable


class WarnOnce:
    """A listener for warnings that passes each text on the first time, and keeps all texts in their order.

    `already` are texts that somebody else has passed on.
    """

    def __init__(self, warn: Callable[[str], None], already: Iterable[str] = ()) -> None:
        self._warn = warn
        self._texts = dict.fromkeys(already)

    def __call__(self, text: str) -> None:
        if text not in self._texts:
            self._texts[text] = None
            self._warn(text)

    @property
    def texts(self) -> list[str]:
        """The texts so far, those of others first."""
        return list(self._texts)
