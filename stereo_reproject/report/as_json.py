"""Dataclasses as JSON, with keys that may be absent."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from enum import Enum
from typing import Any


class Absent(Enum):
    """Type of `ABSENT`."""

    ABSENT = "absent"


ABSENT = Absent.ABSENT
"""Value of a field whose key is not in the report. A field that is None is there, as null."""


def as_json(part: Any) -> dict[str, Any]:
    """Return a report, or a part of one, as JSON has it: a key for each field that is not `ABSENT`, in their order.

    Tuples become lists. A field whose name would be a word of Python's ends with an underscore, and its key does not.
    """
    values = {field.name.rstrip("_"): getattr(part, field.name) for field in fields(part)}
    return {key: _plain(value) for key, value in values.items() if value is not ABSENT}


def _plain(value: Any) -> Any:
    if is_dataclass(value):
        return as_json(value)
    if isinstance(value, Mapping):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, (tuple, list)):
        return [_plain(item) for item in value]
    return value
