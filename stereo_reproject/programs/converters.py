"""Reading of options by argparse, with a complaint in one line that names the option."""

from __future__ import annotations

import argparse
import re
from collections.abc import Callable
from typing import Any, NoReturn

from ..errors import BadInputError
from ..settings.frame import PANORAMAS


class OneLineParser(argparse.ArgumentParser):
    """A parser of arguments that raises BadInputError, with a message of one line, where argparse itself would print
    its usage and exit."""

    def error(self, message: str) -> NoReturn:
        """Raise BadInputError with argparse's message; called by argparse when the arguments are wrong."""
        option = re.fullmatch(r"argument (--[\w-]+): expected one argument", message)
        if option is not None:
            # argparse takes a value that begins with a dash and is no number for an option.
            message += f" (one that begins with - is given as {option[1]}=-...)"
        raise BadInputError(f"{message}; `{self.prog} --help` lists what can be given")


def whole_number(text: str) -> int:
    """Return the whole number that a text holds. Raises ValueError, whose message completes "must be ..."."""
    if not re.fullmatch(r"[+-]?[0-9]{1,18}", text):
        raise ValueError("a whole number")
    return int(text)


def number(text: str) -> float:
    """Return the number that a text holds. Raises ValueError, whose message completes "must be ..."."""
    try:
        return float(text)
    except ValueError:
        raise ValueError("a number") from None


def size(text: str) -> tuple[int, int]:
    """Return (width, height) from a text such as 1920x1080. Raises ValueError, whose message completes "must be
    ..."."""
    if not re.fullmatch(r"[0-9]{1,18}[xX][0-9]{1,18}", text):
        raise ValueError("of the form WIDTHxHEIGHT, such as 1920x1080")
    width, height = re.split("[xX]", text)
    return int(width), int(height)


def panorama_size(name: str) -> Callable[[str], tuple[int, int]]:
    """Return a reader of the size of one eye of a panorama of this name, such as 4096x4096, or of its width alone."""
    width, height = PANORAMAS[name]
    parts = width // height

    def read(text: str) -> tuple[int, int]:
        if re.fullmatch(r"[0-9]{1,18}", text):
            if int(text) % parts == 0:
                return int(text), int(text) // parts
        elif re.fullmatch(r"[0-9]+[xX][0-9]+", text):
            return size(text)
        number = "a number" if parts == 1 else "an even number"
        raise ValueError(f"{number} or WIDTHxHEIGHT, such as {width} or {width}x{height} (the scene comes before it)")

    return read


def read_by(read: Callable[[str], Any]) -> Callable[[str], Any]:
    """Return a converter for argparse that calls `read` on an option's text. A BadInputError of `read` is shown to the
    user with the option's name."""

    def convert(text: str) -> Any:
        try:
            return read(text)
        except BadInputError as error:
            raise argparse.ArgumentTypeError(str(error)) from None

    return convert


def value_of(settings: Callable[..., object], field: str, read: Callable[[str], Any]) -> Callable[[str], Any]:
    """Return a converter for argparse that calls `read` on an option's text and has the class `settings` check the
    result as its field `field`. So an unusable value is reported with the option's name."""

    def convert(text: str) -> Any:
        try:
            value = read(text)
            settings(**{field: value})
        except ValueError as wanted:
            raise argparse.ArgumentTypeError(f"must be {wanted}, not {text!r}") from None
        except BadInputError as error:
            raise argparse.ArgumentTypeError(str(error)) from None
        return value

    return convert
