"""Requests to trace pixels: of any number of views, answered together."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass
from typing import Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from ..images.passes import Passes

Result = TypeVar("Result")


@dataclass(frozen=True)
class TraceRequest:
    """Pixels of one view that are to be traced.

    view is its name. pixels (H, W) are set where a pixel is wanted. twice (H, W), if given, is set where a pixel is
    wanted once more, with noise of its own.
    """

    view: str
    pixels: NDArray[np.bool_]
    twice: NDArray[np.bool_] | None = None

    @property
    def masks(self) -> list[NDArray[np.bool_]]:
        """Masks (H, W) whose set pixels the answer holds, one mask after the other: `pixels`, and `twice` if it is
        given."""
        return [self.pixels] if self.twice is None else [self.pixels, self.twice]


class Tracer(Protocol):
    """Tracer of single pixels of views: a renderer that answers trace requests."""

    def trace(self, method: str, requests: Sequence[TraceRequest]) -> list[Passes]:
        """Trace all requests by one fill method ('packed', 'card' or 'full'), and return the passes (N, C) of each, in
        order.

        Those are first the pixels that are set in a request's `pixels`, row by row, and then those set in its `twice`.
        """
        ...


@dataclass(frozen=True)
class TraceCall:
    """A request, and the fill method by which it is to be traced."""

    method: str
    request: TraceRequest


TraceSteps = Generator[TraceCall, Passes, Result]
"""Steps of a task that needs pixels: it yields one call after the other, is sent the passes (N, C) that answer it, and
returns its result."""


def run_alone(steps: TraceSteps[Result], tracer: Tracer) -> Result:
    """Run the steps of one task, each call of it in a render of its own, and return its result."""
    [result] = run_together([steps], tracer)
    return result


def run_together(tasks: Sequence[TraceSteps[Result]], tracer: Tracer) -> list[Result]:
    """Run the steps of several tasks side by side, and return their results in order.

    The first calls of all tasks are traced together, then the second calls, and so on; those of each fill method in as
    few renders as the tracer needs. A task that has ended is not waited for.
    """
    results: dict[int, Result] = {}
    answers: dict[int, Passes | None] = dict.fromkeys(range(len(tasks)))
    while answers:
        calls: dict[int, TraceCall] = {}
        for number, answer in answers.items():
            try:
                calls[number] = next(tasks[number]) if answer is None else tasks[number].send(answer)
            except StopIteration as ended:
                results[number] = ended.value
        answers = {}
        for method in dict.fromkeys(call.method for call in calls.values()):
            numbers = [number for number, call in calls.items() if call.method == method]
            traced = tracer.trace(method, [calls[number].request for number in numbers])
            answers.update(zip(numbers, traced, strict=True))
    return [results[number] for number in range(len(tasks))]
