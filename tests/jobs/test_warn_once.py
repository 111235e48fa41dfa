"""Warnings are given once."""

from stereo_reproject.jobs.warn_once import WarnOnce


def test_a_warning_is_given_once_and_not_when_it_was_given_before():
    heard = []
    warn = WarnOnce(heard.append, ["known"])
    for text in ("new", "known", "new", "other"):
        warn(text)
    assert heard == ["new", "other"]
    assert warn.given == ["known", "new", "other"]
