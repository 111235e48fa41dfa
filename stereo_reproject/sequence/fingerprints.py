"""Fingerprints of a scene and of settings, by which a finished frame is compared with what is asked for now."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Any, Protocol


class FrameState(Enum):
    """State of a frame's files on disk, compared with what is asked for; the value is its name in messages."""

    WHOLE = "there already"
    MISSING = "missing"
    DAMAGED = "damaged"
    UNKNOWN = "not in the journal"
    OTHER_SETTINGS = "of other settings"
    OTHER_SCENE = "of another scene"


class _Fingerprinted(Protocol):
    @property
    def settings(self) -> str: ...

    @property
    def scene(self) -> Mapping[str, str]: ...


@dataclass(frozen=True)
class Fingerprints:
    """Digests that all frames of one animation have in common.

    settings is one digest of all settings; scene has a digest for each kind of datablock.
    """

    settings: str
    scene: Mapping[str, str]

    def state_of(self, other: _Fingerprinted) -> FrameState:
        """Compare with a record or with another run's fingerprints: WHOLE, OTHER_SETTINGS or OTHER_SCENE.

        Files are not looked at.
        """
        if dict(other.scene) != dict(self.scene):
            return FrameState.OTHER_SCENE
        return FrameState.WHOLE if other.settings == self.settings else FrameState.OTHER_SETTINGS

    def changed(self, other: _Fingerprinted) -> list[str]:
        """Return the kinds of datablocks in which the other's scene differs."""
        kinds = dict.fromkeys((*self.scene, *other.scene))
        return [kind for kind in kinds if self.scene.get(kind) != other.scene.get(kind)]


def digest(values: Any) -> str:
    """Return the SHA-256, in hexadecimal, of values that can be written as JSON; the order of keys does not count."""
    return hashlib.sha256(json.dumps(values, sort_keys=True).encode()).hexdigest()
