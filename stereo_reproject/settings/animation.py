"""Settings of an animation, beside those of each of its pairs: checked once, and frozen."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from itertools import pairwise

from ..delivery.layouts import LAYOUTS
from ..errors import BadInputError
from ..words import Words
from .frame import MAX_FRAME

EXISTING = ("refuse", "resume", "overwrite", "keep")
"""Ways to handle frames that are there: refuse the run; keep those that are whole and of this scene; keep none; keep
all that are there at all, as Blender does without Overwrite."""

MAX_FRAMES = 1 << 20

MAX_REUSE = 1000
"""Most frames that one key frame serves."""

AUTO_REUSE = 8
"""Frames that one key frame serves where nobody says a number. By hand."""

KEY_FRAME = "a key frame"
"""Reason why one eye of a key frame is rendered whole, in reports."""


@dataclass(frozen=True)
class AnimationSettings:
    """The settings of an animation: which frames are rendered, and where and how they are stored. Raises BadInputError.

    frames are in rising order; None means those of the scene. existing is one of EXISTING. output is the folder for the
    frames; None means that of the scene's output path. layout is one of `delivery.layouts.LAYOUTS`, and file_format is
    one of Blender's names; None means the scene's own. movie is the path of a movie to be made of all frames; "" names
    it after the frames, None makes none. With holes there is also a picture of the traced pixels for each frame. Each
    compare_every-th frame, counted from the scene's first, is compared with multiview; None compares none. With views,
    each view of a frame of many views is a file too, besides their quilt. Of so many frames in a row as reuse says, an
    eye of the first alone is rendered, and the others are made from it where only the camera moves; None renders an eye
    of each frame. With mono, frames are of one view, through the scene's own camera, and reuse is needed.

    The rest is for a worker that is started again after a crash: skip are frames that are not tried, with the reason;
    finished are frames that this run has rendered already; goes_on is True if there was such an earlier worker.
    """

    frames: tuple[int, ...] | None = None
    existing: str = "refuse"
    output: str | None = None
    layout: str | None = None
    file_format: str | None = None
    movie: str | None = None
    holes: bool = False
    compare_every: int | None = None
    reuse: int | None = None
    mono: bool = False
    views: bool = False
    skip: Mapping[int, str] = field(default_factory=dict)
    finished: tuple[int, ...] = ()
    goes_on: bool = False

    def __post_init__(self) -> None:
        if self.frames is not None:
            _check_frames(self.frames)
        if self.existing not in EXISTING:
            raise BadInputError(
                Words(
                    "existing must be one of {choices}, not {existing}",
                    choices=", ".join(EXISTING),
                    existing=repr(self.existing),
                )
            )
        if self.layout is not None and self.layout not in LAYOUTS:
            raise BadInputError(
                Words(
                    "the layout must be one of {choices}, not {layout}",
                    choices=", ".join(LAYOUTS),
                    layout=repr(self.layout),
                )
            )
        every = self.compare_every
        if every is not None and (isinstance(every, bool) or not isinstance(every, int) or every < 1):
            raise BadInputError(Words("compare every={every}: must be a whole number from 1", every=every))
        reuse = self.reuse
        if reuse is not None and (isinstance(reuse, bool) or not isinstance(reuse, int) or not 2 <= reuse <= MAX_REUSE):
            raise BadInputError(
                Words("reuse must be a whole number from 2 to {most}, not {reuse}", most=MAX_REUSE, reuse=repr(reuse))
            )
        if self.mono and reuse is None:
            raise BadInputError("mono needs reuse: without, Blender itself renders such an animation")
        if self.mono and self.layout is not None:
            raise BadInputError("mono frames hold one view: leave the layout out")


def _check_frames(frames: tuple[int, ...]) -> None:
    """Raise BadInputError unless frames are whole numbers in rising order, from 0 to MAX_FRAME, at least one."""
    if not frames:
        raise BadInputError("no frames are named: name at least one")
    if not all(isinstance(frame, int) and not isinstance(frame, bool) for frame in frames):
        raise BadInputError("frames must be whole numbers")
    if any(after <= before for before, after in pairwise(frames)):
        raise BadInputError("frames must be in rising order, each once")
    if not 0 <= frames[0] <= frames[-1] <= MAX_FRAME:
        # Blender writes no others in an animation.
        raise BadInputError(Words("frames must be from 0 to {max_frame}", max_frame=MAX_FRAME))


def read_frames(text: str) -> tuple[int, ...]:
    """Return the frames that a text names, in rising order: 12, 1-24, 1-24:2 (each second), or several of these with
    commas between. Raises BadInputError."""
    frames: set[int] = set()
    named = 0
    for part in text.split(","):
        match = re.fullmatch(r"\s*(-?\d{1,9})(?:-(-?\d{1,9})(?::(\d{1,9}))?)?\s*", part)
        if match is None:
            raise BadInputError(
                Words("frames must be of the form 1-24, 1-24:2 or 1-10,15, not {text}", text=repr(text))
            )
        first, last, step = int(match[1]), int(match[2] or match[1]), int(match[3] or 1)
        if last < first or step < 1:
            raise BadInputError(
                Words("frames {frames} are none: name them in rising order, with a step from 1", frames=part.strip())
            )
        count = (last - first) // step + 1
        if count > MAX_FRAMES:
            raise BadInputError(
                Words("frames {frames} are more than {max_frames}", frames=part.strip(), max_frames=MAX_FRAMES)
            )
        # One frame may be named several times, but not without an end: such a text may come out of a damaged file.
        named += count
        if named > 2 * MAX_FRAMES:
            raise BadInputError(Words("frames {text}... name frames again and again", text=repr(text[:40])))
        frames.update(range(first, last + 1, step))
    result = tuple(sorted(frames))
    _check_frames(result)
    return result


def spelled(frames: Iterable[int]) -> str:
    """Return frames as a short text that people can read, such as "1-10, 12, 20-24:2"; `read_frames` reads it back."""
    parts: list[str] = []
    every = sorted(set(frames))
    begin = 0
    while begin < len(every):
        step = every[begin + 1] - every[begin] if begin + 1 < len(every) else 1
        end = begin + 1
        while end < len(every) and every[end] - every[end - 1] == step:
            end += 1
        if end - begin < 3 and step > 1:
            end = begin + 1
        ending = f":{step}" if step > 1 else ""
        first, last = every[begin], every[end - 1]
        parts.append(str(first) if end == begin + 1 else f"{first}-{last}{ending}")
        begin = end
    return ", ".join(parts)


def read_every(text: str) -> int:
    """Return the number in a text such as every=6, or 6 alone. Raises BadInputError."""
    match = re.fullmatch(r"(?:every=)?([1-9]\d{0,8})", text)
    if match is None:
        raise BadInputError(Words("--compare must be of the form every=6, not {text}", text=repr(text)))
    return int(match[1])


def read_reuse(text: str) -> int | None:
    """Return the number of frames in a text such as 8; `AUTO_REUSE` for auto, None for off. Raises BadInputError."""
    if text in ("auto", "off"):
        return AUTO_REUSE if text == "auto" else None
    if not re.fullmatch(r"\d{1,9}", text) or not 2 <= int(text) <= MAX_REUSE:
        raise BadInputError(
            Words(
                "--reuse must be auto, off, or a whole number from 2 to {most}, not {text}",
                most=MAX_REUSE,
                text=repr(text),
            )
        )
    return int(text)
