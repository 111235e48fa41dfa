"""The animation that a job renders: how its frames are made, which of them it has finished, and what it leaves."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from ..stereo_reproject.jobs.work_folder import remove_abandoned
from ..stereo_reproject.sequence.leftovers import missing_folders, remove_empty, remove_leftovers
from ..stereo_reproject.sequence.listing import Listing
from ..stereo_reproject.sequence.record_store import RecordStore
from ..stereo_reproject.settings.animation import AnimationSettings


@dataclass
class Animation:
    """An animation that a job renders: how its frames are made, the folders into which the job itself writes, the
    files of its frames, those that are there already included, and where the finished ones are recorded. It is made
    before its job begins.
    """

    settings: AnimationSettings
    written: Sequence[Path]
    files: Mapping[int, Sequence[Path]]
    """Files of each frame, by its number."""
    records: RecordStore
    frames: Sequence[int] = field(init=False)
    """Numbers of the frames in their order."""
    _missing: list[Path] = field(init=False)
    """Folders that were not there before the job, inner ones first."""
    _recorded: dict[int, int] = field(init=False)
    """Times at which frames were recorded before the job."""
    _found: frozenset[int] = field(init=False)
    """Frames whose files were all there before the job, where it keeps such frames."""

    def __post_init__(self) -> None:
        self.frames = sorted(self.files)
        self._missing = missing_folders(self.written)
        self._recorded = self.records.times()
        listing = Listing()
        keeps = self.settings.existing == "keep"
        self._found = frozenset(
            frame
            for frame, paths in self.files.items()
            if keeps and all(listing.may_hold(path) and path.is_file() for path in paths)
        )

    def newly_recorded(self) -> frozenset[int]:
        """Return the frames that were finished since the job began, by their records."""
        times = self.records.times().items()
        return frozenset(frame for frame, when in times if frame in self.files and self._recorded.get(frame) != when)

    def there_already(self) -> int:
        """Return the number of frames that were there before the job, and that it has kept so far."""
        return len(self._found - self.newly_recorded())

    def clean_up(self) -> None:
        """Remove what the job, which is over, has left that is of no use to a later one."""
        for folder in self.written:
            remove_abandoned(folder)
            remove_leftovers(folder)
        remove_empty(self._missing)
