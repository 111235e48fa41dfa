"""Sentences that can be translated: English text that remembers from which message and fields it was made."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any


class Words(str):
    """A text in English, made of a message such as "{time} saved" and its fields. It is that text wherever it is read;
    `in_language` makes it anew in another language. Fields may be such texts themselves.
    """

    message: str
    fields: Mapping[str, Any]

    def __new__(cls, message: str, **fields: Any) -> Words:
        """Return the text; the fields' names stand in braces in the message."""
        text = super().__new__(cls, message.format(**fields))
        text.message, text.fields = message, fields
        return text


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
