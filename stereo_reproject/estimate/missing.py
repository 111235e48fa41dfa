"""Why a frame has no estimate, in the words of its report, for the command line too, which is without NumPy."""

PROMISES_NOTHING = "this accuracy promises nothing, and has no probes"
NOTHING_DIFFERS = "nothing that is seen looks different from each eye, and calls for probes"
