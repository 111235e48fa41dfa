"""The report of a pair as dataclasses, the output of `inspect`, their words, and the canvas of all charts."""
