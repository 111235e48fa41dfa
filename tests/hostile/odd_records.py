"""Ways to damage a record of a frame: JSON that is none, and JSON that says what no record can."""

from __future__ import annotations

import copy
import json
from collections.abc import Callable, Iterator
from typing import Any

from stereo_reproject.sequence.journal_folder import JOURNAL

DEEP = 100_000
"""Levels of nesting, more than any parser's stack has."""

LONG = 100_000_000
"""Bytes, more than anybody should read for a record."""

Fields = dict[str, Any]


def damaged(whole: bytes) -> Iterator[tuple[str, bytes]]:
    """Contents that are no record, by what became of this one."""
    yield "empty", b""
    yield "white space", b" \n\t " * 10
    yield "NULs in its whole length, as after a power cut", bytes(len(whole))
    yield "NULs in its second half", whole[: len(whole) // 2].ljust(len(whole), b"\0")
    yield "NULs behind it", whole + bytes(4096)
    for share in (1, 2, 3):
        yield f"cut at {share} quarters", whole[: share * len(whole) // 4]
    yield "without its last brace", whole.rstrip()[:-1]
    yield "twice", whole + whole
    yield "a text behind it", whole + b"hello"
    yield "no UTF-8", whole.replace(b'"run"', b'"\xff\xfe"')
    yield "a surrogate in UTF-8", whole.replace(b'"settings": "', b'"settings": "\xed\xa0\x80')
    yield "UTF-16", whole.decode().encode("utf-16")
    yield "UTF-32", whole.decode().encode("utf-32")
    yield "a mark of UTF-8 before it", b"\xef\xbb\xbf" + whole
    yield "noise", bytes(range(256)) * 8
    yield "a picture", b"\x89PNG\r\n\x1a\n" + bytes(100)
    for content in ("null", "true", "5", "1e999", "NaN", '"text"', "[]", "{}", "[[]]", '[{"frame": 2}]'):
        yield f"JSON {content}", content.encode()
    yield "lists in lists", b"[" * DEEP
    yield "closed lists in lists", b"[" * DEEP + b"]" * DEEP
    yield "groups in groups", b'{"frame":' * DEEP
    yield "a number of a million digits", b'{"frame": ' + b"9" * 1_000_000 + b"}"
    yield "100 MB of white space before it", b" " * LONG + whole
    yield "100 MB of NULs", bytes(LONG)
    yield "a text of 100 MB", b'{"frame": 2, "run": "' + b"x" * LONG + b'"}'


ODD_VALUES: tuple[Any, ...] = (None, True, -1, 1e300, "text", [], {}, [None])


def odd_fields(whole: bytes, files: tuple[str, ...]) -> Iterator[tuple[str, bytes]]:
    """Records of which a field is odd, of a frame with these files."""
    record = json.loads(whole)
    for name in record:
        if name != "schema":
            yield f"without {name}", _changed(record, lambda fields, name=name: fields.pop(name))
    for name in ("frame", "files", "settings", "scene", "run", "figures"):
        for value in ODD_VALUES[::2] if name in ("settings", "run") else ODD_VALUES[1::2]:
            yield f"{name} is {value!r}", _changed(record, _setting(name, value))
    for value in (3, "2", 2.5, 10**400, -2):
        yield f"frame is {str(value)[:9]!r}", _changed(record, _setting("frame", value))
    for value in (0, 2, 99, "1", None, 1.5):
        yield f"schema is {value!r}", _changed(record, _setting("schema", value))
    yield (
        "of a future schema, with other fields",
        _changed(record, lambda fields: fields.update(schema=2, eyes=["left", "right"], files=["0002_L.png"])),
    )
    yield "with a field more", _changed(record, _setting("colour", "red"))
    yield from _odd_files(record, files[0])
    yield from _odd_figures(record)


def _odd_files(record: Fields, first: str) -> Iterator[tuple[str, bytes]]:
    known = record["files"][first]
    names = {
        "absolute": "/etc/passwd",
        "outside": "../outside/canary",
        "a device": "/dev/zero",
        "a random device": "/dev/urandom",
        "by way of a folder outside": "../../../../../../dev/zero",
        "the journal": f"{JOURNAL}/0001.json",
        "a FIFO": "fifo",
        "empty": "",
        "the folder": ".",
        "above": "..",
        "a NUL": "a\0b",
        "5000 letters": "n" * 5000,
        "a surrogate": "\ud800",
        "another frame's": "0001_L.png",
    }
    for what, name in names.items():
        yield f"a file more, named: {what}", _changed(record, lambda f, name=name: f["files"].update({name: known}))
        yield f"one file alone, named: {what}", _changed(record, _setting("files", {name: known}))
    for what, value in {"huge": 10**400, "negative": -1, "none": None, "a text": "text", "half": 1.5}.items():
        yield (
            f"bytes of a file are {what}",
            _changed(record, lambda f, value=value: f["files"][first].update(bytes=value)),
        )
    for what, value in {"none": None, "another": "0" * 64, "a list": [], "long": "a" * 100_000}.items():
        yield (
            f"sum of a file is {what}",
            _changed(record, lambda f, value=value: f["files"][first].update(sha256=value)),
        )


def _odd_figures(record: Fields) -> Iterator[tuple[str, bytes]]:
    numbers = {"a text": "long", "none": None, "NaN": float("nan"), "infinite": float("inf"), "negative": -5,
               "a list": [], "huge": 10**400, "a group": {}}  # fmt: skip
    for name in ("wall_seconds", "multiview_seconds"):
        for what, value in numbers.items():
            yield f"{name} is {what}", _changed(record, lambda f, n=name, v=value: f["figures"].update({n: v}))
    for name, value in (
        ("beside_seconds", "x"), ("beside_seconds", None), ("fractions", None), ("fractions", []), ("fractions", {}),
        ("fractions", {"rerendered": "x"}), ("fractions", {"rerendered": None}), ("seconds", None), ("seconds", "x"),
        ("seconds", {"source": "x"}), ("seconds", {"source": [1]}), ("compare", 5), ("compare", {}), ("compare", "x"),
        ("compare", {"multiview_seconds": None, "noise_ratio": "x"}), ("compare", {"multiview_seconds": 0}),
        ("warnings", 5), ("warnings", "text"), ("warnings", [5]), ("warnings", [None, {}]), ("warnings", None),
        ("warnings", ["two\nlines \x1b[31m"]), ("size", "x"), ("estimate", 5),
    ):  # fmt: skip
        yield f"{name} is {value!r}", _changed(record, lambda f, n=name, v=value: f["figures"].update({n: v}))


def _setting(name: str, value: Any) -> Callable[[Fields], None]:
    return lambda fields: fields.update({name: value})


def _changed(record: Fields, change: Callable[[Fields], Any]) -> bytes:
    fields = copy.deepcopy(record)
    change(fields)
    return json.dumps(fields).encode()
