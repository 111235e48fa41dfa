from stereo_reproject.jobs.warn_once import WarnOnce


def test_a_warning_is_passed_on_once_and_kept():
    heard = []
    warn = WarnOnce(heard.append, already=["known", "known"])
    for text in ("new", "known", "new", "newer"):
        warn(text)
    assert heard == ["new", "newer"]
    assert warn.texts == ["known", "new", "newer"]
