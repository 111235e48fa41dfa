"""Claims of frames in the journal: each says which run renders a frame now, so that no two render the same."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from ..files import UnusableFileError, is_regular, read_small, remove, write_new
from .journal_folder import JournalFolder
from .runs import CLAIM, TOKEN, LiveRuns

TOKEN_BYTES = 16
"""Size of a run's token, and so of a claim that names one."""


class Claims:
    """The claims of frames of one name. Each has a number; of several claims of a frame, the highest number holds it.

    A run that was thought dead and wakes up finds that a higher number was taken, and leaves the frame alone.
    """

    def __init__(self, folder: JournalFolder, runs: LiveRuns) -> None:
        self._folder, self._runs = folder, runs

    def take(self, frame: int, token: str) -> int | None:
        """Claim a frame for a run: return the claim's number, or None where a live run has it. Raises OSError."""
        claims = self._claims(frame)
        if self._is_held(claims):
            return None
        number = claims[-1][0] + 1 if claims else 1
        path = self._folder.path / f"{self._folder.stem(frame)}{CLAIM}{number}"
        try:
            write_new(path, token)
        except FileExistsError:
            return None
        if any(self._runs.lives(self._token(other)) for _, other in self._claims(frame) if other != path):
            # The claim seen above was released since, and another run has claimed the frame under another number.
            remove(path)
            return None
        return number

    def holder(self, frame: int) -> str | None:
        """Return the token of the run that has claimed a frame, dead or alive; None without one. Raises OSError."""
        claims = self._claims(frame)
        return self._token(claims[-1][1]) if claims else None

    def holds(self, frame: int, number: int, token: str) -> bool:
        """Return whether a run still has the claim that it took: no other took the frame since. Raises OSError."""
        claims = self._claims(frame)
        return bool(claims) and claims[-1][0] == number and self.holder(frame) == token

    def is_held(self, frame: int) -> bool:
        """Return whether a live run has claimed a frame. Raises OSError."""
        return self._is_held(self._claims(frame))

    def release(self, frame: int, number: int, token: str) -> None:
        """Remove all claims of a frame, if the run still has it. Raises OSError."""
        if self.holds(frame, number, token):
            for _, path in self._claims(frame):
                # Anything else of such a name is not ours to remove.
                if is_regular(path):
                    remove(path)

    def _is_held(self, claims: Sequence[tuple[int, Path]]) -> bool:
        return bool(claims) and self._runs.lives(self._token(claims[-1][1]))

    def _claims(self, frame: int) -> list[tuple[int, Path]]:
        """A frame's claims with their numbers, in the order of the numbers."""
        stem = f"{self._folder.stem(frame)}{CLAIM}"
        pattern = re.compile(re.escape(stem) + r"([1-9][0-9]{0,17})")
        found = ((pattern.fullmatch(path.name), path) for path in self._folder.path.glob(f"{stem}*"))
        return sorted((int(match[1]), path) for match, path in found if match)

    def _token(self, claim: Path) -> str:
        """The token in a claim, or the claim's own file name where it holds none; "" where it is no claim."""
        try:
            token = read_small(claim, TOKEN_BYTES).decode("ascii", "replace")
        except (FileNotFoundError, UnusableFileError):
            # Released, or not made by a run.
            return ""
        # A claim without a token was made a moment ago, or its run died just then, or its drive lost power.
        return token if TOKEN.fullmatch(token) else claim.name
