"""Dataclasses as JSON, with keys that may be absent."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from enum import Enum
from typing import Any


class Absent(Enum):
    """The type of `ABSENT`, which marks a field of a report whose key is left out of the JSON."""

    ABSENT = "absent"


ABSENT = Absent.ABSENT
"""Value of a field whose key is not in the report. A field that is None is there, as null."""


def as_json(part: Any) -> dict[str, Any]:
    """Return a dataclass of the report as the dict that is written as JSON: a key for each field whose value is not
    `ABSENT`, in the order of the fields.

    Dataclasses inside it become dicts too, and tuples become lists. A field whose name would be a Python keyword ends
    with an underscore, which the key leaves out.
    """
    values = {field.name.rstrip("_"): getattr(part, field.name) for field in fields(part)}
    return {key: _plain(value) for key, value in values.items() if value is not ABSENT}


def _plain(value: Any) -> Any:
    """Return the value of a field in JSON's types: dataclasses as dicts, tuples as lists, all else as it is."""
    if is_dataclass(value):
        return as_json(value)
    if isinstance(value, Mapping):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, (tuple, list)):
        return [_plain(item) for item in value]
    return value
