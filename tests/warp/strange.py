"""Things that may lie where a small file of ours is looked for. Not a test itself."""

import os

HUGE = 1 << 32
"""Bytes, of which none is on the disk."""


def make_named_pipe(path):
    os.mkfifo(path)


def make_endless_link(path):
    path.symlink_to("/dev/zero")


def make_folder(path):
    path.mkdir()


def make_circle(path):
    path.symlink_to(path.name)


def make_huge_file(path):
    path.touch()
    os.truncate(path, HUGE)


STRANGE = [make_named_pipe, make_endless_link, make_folder, make_circle, make_huge_file]
