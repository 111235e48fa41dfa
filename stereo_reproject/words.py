"""Sentences that can be translated: English text that remembers from which message and fields it was made."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any


class Words(str):
    """A text in English, made of a message such as "{time} saved" and its fields. It is that text wherever it is read;
    `in_language` makes it anew in another language. Fields may be such texts themselves.

    An error that was given such a text keeps it: `str` of either returns the same `Words`.
    """

    message: str
    fields: Mapping[str, Any]

    def __new__(cls, message: str, **fields: Any) -> Words:
        """Return the text; the fields' names stand in braces in the message."""
        text = super().__new__(cls, message.format(**fields))
        text.message, text.fields = message, fields
        return text

    def __str__(self) -> str:
        """Return the text itself, with its message and fields."""
        return self

    def __getnewargs_ex__(self) -> tuple[tuple[str], dict[str, Any]]:
        """Return the arguments by which a copy is made."""
        return (self.message,), dict(self.fields)


def in_language(text: str, translate: Callable[[str], str]) -> str:
    """Return a text in the language of `translate`, which returns the translation of a message, or the message itself
    where it has none. A plain text is looked up as it is.
    """
    if not isinstance(text, Words):
        return translate(text)
    fields = {
        name: in_language(field, translate) if isinstance(field, Words) else field
        for name, field in text.fields.items()
    }
    return translate(text.message).format(**fields)


def joined(separator: str, **parts: str) -> Words:
    """Return these texts as one, with the separator between them; empty ones are left out."""
    return Words(separator.join(f"{{{name}}}" for name, part in parts.items() if part), **parts)


def to_data(text: str) -> dict[str, Any] | None:
    """Return the message and fields of a text as JSON can hold them, for another process; None for a plain text."""
    if not isinstance(text, Words):
        return None
    fields = {name: to_data(field) or str(field) for name, field in text.fields.items()}
    return {"message": text.message, "fields": fields}


def from_data(text: str, data: Any) -> str:
    """Return a text that another process has sent as the `Words` that it was there. data is what `to_data` returned of
    it; where it is anything else, the text is returned as it is.
    """
    try:
        words = _made_of(data)
    except (AttributeError, IndexError, KeyError, TypeError, ValueError):
        return text
    return words if words == text else text


def _made_of(data: Any) -> Words:
    """Return the words that `data` was made of. Raises one of several errors for what is no such data."""
    fields = {name: _made_of(field) if isinstance(field, dict) else field for name, field in data["fields"].items()}
    return Words(data["message"], **fields)
