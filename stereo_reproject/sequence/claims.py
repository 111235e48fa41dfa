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
    """The claims of frames: files in the journal, each of which says that a run (named by its token) renders a frame
    now.

    A claim has a number; of several claims of one frame, the one with the highest number counts. A run that was thought
    dead and goes on finds a higher number than its own, and leaves the frame alone. The claims are those of the frames
    of one name.
    """

    def __init__(self, folder: JournalFolder, runs: LiveRuns) -> None:
        self._folder, self._runs = folder, runs

    def take(self, frame: int, token: str) -> int | None:
        """Claim a frame for the run `token`. Return the claim's number, or None where another live run has the frame.
        Raises OSError."""
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
        """Return the token of the run that has claimed a frame, alive or dead; None for a frame without a claim. For a
        claim that names no run it is the claim's file name. Raises OSError."""
        claims = self._claims(frame)
        return self._token(claims[-1][1]) if claims else None

    def holds(self, frame: int, number: int, token: str) -> bool:
        """Return True if the run `token` still has the claim with this number, and no other run has claimed the frame
        since. Raises OSError."""
        claims = self._claims(frame)
        return bool(claims) and claims[-1][0] == number and self.holder(frame) == token

    def is_held(self, frame: int) -> bool:
        """Return True if a live run has claimed a frame. Raises OSError."""
        return self._is_held(self._claims(frame))

    def release(self, frame: int, number: int, token: str) -> None:
        """Remove all claims of a frame if the run `token` still has the claim with this number; else do nothing. Raises
        OSError."""
        if self.holds(frame, number, token):
            for _, path in self._claims(frame):
                # Anything else of such a name is not ours to remove.
                if is_regular(path):
                    remove(path)

    def _is_held(self, claims: Sequence[tuple[int, Path]]) -> bool:
        """Return True if the last of a frame's claims, given in the order of their numbers, is a live run's."""
        return bool(claims) and self._runs.lives(self._token(claims[-1][1]))

    def _claims(self, frame: int) -> list[tuple[int, Path]]:
        """Return the claims of a frame as (number, path), in the order of the numbers."""
        stem = f"{self._folder.stem(frame)}{CLAIM}"
        pattern = re.compile(re.escape(stem) + r"([1-9][0-9]{0,17})")
        found = ((pattern.fullmatch(path.name), path) for path in self._folder.path.glob(f"{stem}*"))
        return sorted((int(match[1]), path) for match, path in found if match)

    def _token(self, claim: Path) -> str:
        """Return the token in a claim's file. A claim without a token gives its own file name, which `LiveRuns.lives`
        understands; "" where the file is gone or no claim."""
        try:
            token = read_small(claim, TOKEN_BYTES).decode("ascii", "replace")
        except (FileNotFoundError, UnusableFileError):
            # Released, or not made by a run.
            return ""
        # A claim without a token was made a moment ago, or its run died just then, or its drive lost power.
        return token if TOKEN.fullmatch(token) else claim.name
