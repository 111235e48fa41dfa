"""Tasks that need pixels, side by side: each is sent its own, and what they ask at once is traced together."""

import numpy as np

from stereo_reproject.trace.requests import TraceCall, TraceRequest, run_alone, run_together


class Counter:
    """A tracer whose answer to a request is the number of its pixels; it keeps what was asked of it."""

    def __init__(self):
        self.asked = []

    def trace(self, method, requests):
        self.asked.append((method, [request.view for request in requests]))
        return [{"Count": np.full((1, 1), request.pixels.sum(), np.float32)} for request in requests]


def task(view, *pixels, method="packed"):
    """Return steps that ask for so many pixels, one call after the other, and end with what came."""

    def steps():
        came = []
        for count in pixels:
            mask = np.arange(9).reshape(3, 3) < count
            passes = yield TraceCall(method, TraceRequest(view, mask))
            came.append(int(passes["Count"][0, 0]))
        return view, came

    return steps()


def test_calls_of_the_same_step_are_traced_together():
    tracer = Counter()
    results = run_together([task("a", 1, 2), task("b", 3), task("c", 4, 5, 6), task("d")], tracer)
    assert results == [("a", [1, 2]), ("b", [3]), ("c", [4, 5, 6]), ("d", [])]
    assert tracer.asked == [("packed", ["a", "b", "c"]), ("packed", ["a", "c"]), ("packed", ["c"])]


def test_each_fill_method_has_its_render():
    tracer = Counter()
    results = run_together([task("a", 1), task("b", 2, method="full"), task("c", 3)], tracer)
    assert results == [("a", [1]), ("b", [2]), ("c", [3])]
    assert tracer.asked == [("packed", ["a", "c"]), ("full", ["b"])]


def test_a_task_alone():
    assert run_alone(task("a", 7, 8), Counter()) == ("a", [7, 8])
    assert run_together([], Counter()) == []
