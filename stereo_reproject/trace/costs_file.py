"""The file in which a user's measured costs of tracing are kept from one session to the next."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..files import is_missing, read_small, write_json
from .costs import MEASURED, TraceCosts, costs_of

COSTS_FILE = "trace-costs.json"
COSTS_SCHEMA = 1
MAX_COSTS_FILE_BYTES = 1 << 16
MAX_KEPT_COSTS = 100
"""Keys in the file; the one that was written longest ago goes first."""


@dataclass(frozen=True)
class CostsFile:
    """Costs of tracing by key in a JSON file, for instance by device and version of Blender.

    It only saves measuring anew: no method raises an error. A file that is missing, cannot be read or is not whole
    holds nothing, and the next measurement replaces it. A file of another schema, and anything that is no regular file,
    is left as it is. Of two processes that write at once, the later one's file is there, whole.
    """

    path: Path

    def read(self, key: str) -> TraceCosts:
        """Return the costs of this key; those that are assumed where there are none."""
        entries = self._entries() or {}
        return costs_of(entries.get(key), MEASURED) or TraceCosts()

    def renew(self, key: str, learn: Callable[[TraceCosts], TraceCosts]) -> None:
        """Replace the costs of this key by what `learn` returns for them; do nothing if it returns the same ones."""
        entries = self._entries()
        if entries is None:
            return
        known = costs_of(entries.pop(key, None), MEASURED) or TraceCosts()
        learned = learn(known)
        if learned == known:
            return
        entries[key] = learned.numbers
        kept = dict(list(entries.items())[-MAX_KEPT_COSTS:])
        with contextlib.suppress(OSError):
            self.path.parent.mkdir(parents=True, exist_ok=True)
            write_json(self.path, {"schema": COSTS_SCHEMA, "costs": kept})

    def _entries(self) -> dict[str, Any] | None:
        """Return what the file holds by key; None where it must be left as it is."""
        try:
            content = json.loads(read_small(self.path, MAX_COSTS_FILE_BYTES))
        except OSError:
            return {} if is_missing(self.path) else None
        except (ValueError, RecursionError):
            return {}
        if not isinstance(content, dict) or content.get("schema") != COSTS_SCHEMA:
            return None
        entries = content.get("costs")
        return entries if isinstance(entries, dict) else {}
