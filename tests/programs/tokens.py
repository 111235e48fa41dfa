"""Tokens of runs, as a run draws them: 16 hexadecimal digits. Not a test itself."""

import hashlib


def token_of(name):
    """The token of a run that a test calls so."""
    return hashlib.sha256(name.encode()).hexdigest()[:16]
