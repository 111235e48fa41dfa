"""Words of a report for why a frame has no estimate; the command line reads them, and has no NumPy."""

PROMISES_NOTHING = "this accuracy promises nothing"
NOTHING_DIFFERS = "nothing that is seen looks different from each eye"
