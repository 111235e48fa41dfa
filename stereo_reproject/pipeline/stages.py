"""The stages of a run, which the progress lines, the report, the charts and the panels share."""

from __future__ import annotations

from collections.abc import Iterable
from enum import StrEnum


class Stage(StrEnum):
    """A stage of a run; the stages are in the order in which a run goes through them.

    The value is its name in report.json, in tradeoff.json and in the command line's progress; `words` is for Blender's
    window.
    """

    words: str
    """The stage as Blender's status bar and the panel name it."""

    def __new__(cls, name: str, words: str) -> Stage:
        stage = str.__new__(cls, name)
        stage._value_ = name
        stage.words = words
        return stage

    START = "start", "Starting"
    LOAD = "load", "Loading a copy of the file"
    PREPARE = "prepare", "Going to the frame"
    """Blender goes to a frame of an animation."""
    PLAN = "plan", "Looking at the scene"
    SKETCH = "sketch", "Rendering a sketch"
    LOOK = "look", "Rendering a first look"
    """The source with a single sample, for a window to show. Its seconds are those that showing pictures adds to a
    frame: what Cycles has synced for the look is not synced again for the source, and counts as the source's."""
    SOURCE = "source", "Rendering the first eye"
    DENOISE_SOURCE = "denoise_source", "Denoising the first eye"
    WARP = "warp", "Reprojecting"
    PILOT = "pilot", "First spot checks"
    FILL = "fill", "Rendering what the first eye does not show"
    PROBES = "probes", "Rendering spot checks"
    """The probes' part of the fill, which only the chart of a price list shows apart: it never begins."""
    REFINE = "refine", "Rendering uncertain areas"
    COMPOSITE = "composite", "Putting the second eye together"
    DENOISE_TARGET = "denoise_target", "Denoising the second eye"
    ACCOUNT = "account", "Measuring"
    """The cost is divided among effects, after the pair is finished."""
    WRITE = "write", "Writing"
    COMPARE = "compare", "Rendering both eyes whole to compare"
    MOVIE = "movie", "Putting the movie together"
    """The files of an animation's movie are put together."""


OUTSIDE_TOTAL = (Stage.LOAD, Stage.LOOK, Stage.ACCOUNT, Stage.WRITE, Stage.COMPARE)
"""Stages that are not in a pair's total seconds."""

RENDERING = (
    Stage.LOOK,
    Stage.SOURCE,
    Stage.DENOISE_SOURCE,
    Stage.PILOT,
    Stage.FILL,
    Stage.REFINE,
    Stage.DENOISE_TARGET,
)
"""Stages that render, or denoise what was rendered."""


def in_order(names: Iterable[str]) -> list[str]:
    """Return each of these names once: names of stages in the order of a run, then all others in the order given."""
    names = list(dict.fromkeys(names))
    return [stage.value for stage in Stage if stage in names] + [name for name in names if name not in _NAMES]


def words_of(name: str) -> str:
    """Return the words by which users read of the stage of that name; the name itself where it is no stage."""
    return Stage(name).words if name in _NAMES else name


def label_of(name: str) -> str:
    """Return a stage's name as tables show it: with spaces in place of underscores."""
    return name.replace("_", " ")


_NAMES = frozenset(stage.value for stage in Stage)
