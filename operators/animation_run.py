"""The animation that a job renders: how its frames are made, which of them it has finished, and what it leaves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from ..stereo_reproject.jobs.work_folder import remove_abandoned
from ..stereo_reproject.sequence.leftovers import missing_folders, remove_empty, remove_leftovers
from ..stereo_reproject.sequence.record_store import RecordStore
from ..stereo_reproject.settings.animation import AnimationSettings


@dataclass
class Animation:
    """An animation that a job renders: how its frames are made, the folders into which the job itself writes, the
    numbers of its frames in their order, those that are there already included, and where the finished ones are
    recorded. It is made before its job begins.
    """

    settings: AnimationSettings
    written: Sequence[Path]
    frames: Sequence[int]
    records: RecordStore
    _missing: list[Path] = field(init=False)
    """Folders that were not there before the job, inner ones first."""
    _recorded: dict[int, int] = field(init=False)
    """Times at which frames were recorded before the job."""

    def __post_init__(self) -> None:
        self._missing = missing_folders(self.written)
        self._recorded = self.records.times()

    def newly_recorded(self) -> int:
        """Return the number of frames that were finished since the job began, by their records."""
        times = self.records.times().items()
        return sum(frame in self.frames and self._recorded.get(frame) != when for frame, when in times)

    def clean_up(self) -> None:
        """Remove what the job, which is over, has left that is of no use to a later one."""
        for folder in self.written:
            remove_abandoned(folder)
            remove_leftovers(folder)
        remove_empty(self._missing)
