"""The two ways in which a run ends early, each with the exit status that a command line gives it."""


class StereoReprojectError(Exception):
    """The run failed; the message says what, where and what to do, on one line."""

    exit_status = 1


class BadInputError(StereoReprojectError):
    """What was asked for cannot be done as asked: the message is for whoever asked."""

    exit_status = 2
