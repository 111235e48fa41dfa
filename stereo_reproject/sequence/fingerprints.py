"""Fingerprints of a scene and of settings, by which a finished frame is compared with what is asked for now."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Any, Protocol


class FrameState(Enum):
    """The state of a frame's files on the drive, compared with what this run would render. The value is the state in
    words, for messages. WHOLE: its record and files are there, unchanged, of the same scene and settings."""

    WHOLE = "there already"
    MISSING = "missing"
    DAMAGED = "damaged"
    UNKNOWN = "not in the journal"
    OTHER_SETTINGS = "of other settings"
    OTHER_SCENE = "of another scene"


class _Fingerprinted(Protocol):
    """Anything that has the fingerprints of a scene and of settings: a `Record` or `Fingerprints`."""

    @property
    def settings(self) -> str:
        """The digest of all settings."""
        ...

    @property
    def scene(self) -> Mapping[str, str]:
        """The digest of each kind of datablock, by the kind's name."""
        ...


@dataclass(frozen=True)
class Fingerprints:
    """The digests of the settings and of the scene by which an animation is rendered. Two frames fit together if these
    are equal. settings is one digest of all settings; scene has a digest for each kind of datablock."""

    settings: str
    scene: Mapping[str, str]

    def state_of(self, other: _Fingerprinted) -> FrameState:
        """Return OTHER_SCENE or OTHER_SETTINGS where the digests of `other`, a record or another run's fingerprints,
        differ from these; WHOLE where all are equal. Files are not looked at."""
        if dict(other.scene) != dict(self.scene):
            return FrameState.OTHER_SCENE
        return FrameState.WHOLE if other.settings == self.settings else FrameState.OTHER_SETTINGS

    def changed(self, other: _Fingerprinted) -> list[str]:
        """Return the kinds of datablocks whose digests differ from those of `other`."""
        kinds = dict.fromkeys((*self.scene, *other.scene))
        return [kind for kind in kinds if self.scene.get(kind) != other.scene.get(kind)]


def digest(values: Any) -> str:
    """Return the SHA-256, in hexadecimal, of values that can be written as JSON. The order of keys in dicts makes no
    difference."""
    return hashlib.sha256(json.dumps(values, sort_keys=True).encode()).hexdigest()
