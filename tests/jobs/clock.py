"""A clock for tests. Not a test itself."""


class Clock:
    """Seconds that pass when they are told to."""

    def __init__(self, now=0.0):
        self.now = now

    def __call__(self):
        return self.now
