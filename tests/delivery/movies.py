"""Little movies by FFmpeg, and what FFmpeg says of them: an encoder and a reader that are not ours."""

import re
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import imageio_ffmpeg
import pytest

from stereo_reproject.errors import StereoReprojectError

PICTURES = ("-f", "lavfi", "-i", "testsrc2=s=64x32:r=24:d=0.5")
SOUND = ("-f", "lavfi", "-i", "sine=d=0.5")


def ffmpeg(*arguments: object, level: str = "error") -> subprocess.CompletedProcess[str]:
    command = [imageio_ffmpeg.get_ffmpeg_exe(), "-hide_banner", "-v", level, "-y", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False, stdin=subprocess.DEVNULL, timeout=120)


def encode(path: Path, options: str, *, sound: str = "") -> Path:
    heard = (*SOUND, "-c:a", sound, "-shortest") if sound else ()
    inputs = (*PICTURES, *heard[:4]) if sound else PICTURES
    done = ffmpeg(*inputs, *options.split(), *heard[4:], path)
    assert done.returncode == 0, done.stderr
    return path


def described(path: Path) -> str:
    """What FFmpeg prints about a file."""
    return ffmpeg("-i", path, level="info").stderr


def frames(path: Path, *, start: float = 0) -> list[str]:
    """The checksum of every frame and packet of sound from `start` seconds on; nothing is amiss with the file."""
    done = ffmpeg("-ss", start, "-i", path, "-f", "framemd5", "-", level="warning")
    assert done.returncode == 0, done.stderr
    wrong = [line for line in done.stderr.splitlines() if "Unknown st3d mode value 4" not in line]
    assert wrong == []
    return [line for line in done.stdout.splitlines() if not line.startswith("#")]


def stereo(path: Path) -> str:
    found = re.search(r"Stereo 3D: ([^,]*).*?(\(inverted\))?$", described(path), re.MULTILINE)
    return " ".join(filter(None, found.groups())) if found else ""


def sphere(path: Path) -> str:
    """The part of the sphere that a movie shows, by FFmpeg; "" for a planar one."""
    found = re.search(r"Spherical Mapping: (.*?) *$", described(path), re.MULTILINE)
    return found.group(1) if found else ""


@contextmanager
def refused(path: Path, message: str) -> Iterator[None]:
    """One line that says why, and the file as it was, nothing beside it."""
    before, beside = path.read_bytes(), sorted(path.parent.iterdir())
    with pytest.raises(StereoReprojectError, match=message) as error:
        yield
    assert "\n" not in str(error.value)
    assert path.read_bytes() == before
    assert sorted(path.parent.iterdir()) == beside
