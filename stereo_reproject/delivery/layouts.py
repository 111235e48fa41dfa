"""Layouts of two eyes in one picture or movie, and the two ways by which a player recognises one: the file's name and
the movie's own mark.

Which eye is where is Blender's convention. Its side-by-side has the left eye left, its top-bottom the left eye on top,
its interlaced pictures begin at the bottom left with the left eye: so the top row of a picture of even height is the
right eye's, and the first column the left eye's.

Sources. st3d: Google, "Spherical Video V2 RFC", Stereoscopic 3D Video Box; it knows nothing interlaced and no anaglyph.
StereoMode: RFC 9559 (Matroska), 5.1.4.1.28.3 and 18.10; it knows no yellow-blue anaglyph. Tags: the published rules of
SKYBOX VR (LR, SBS, HSBS, TB, OU, HOU, 3dh, 3dv), Bino (-lr, -rl, -lrh, -tb, -tbh and more, at the end of the name),
Rad TV (lr, rl, sbs, tb, bt, ou) and Kodi (sbs, hsbs, tab, htab). RL is known to some of them; HTB goes with HSBS, for
players that look for TB in a name. Panoramas: SKYBOX VR and Rad TV know 180 and 360, SKYBOX VR and commedia 180x180;
VR180 is not among them, for SKYBOX VR takes it for a fisheye.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from .projection import MoviePanorama


@dataclass(frozen=True)
class Layout:
    """One way to put the two eyes into a picture or movie, such as side by side.

    name: by which users choose it. tag: the part of a file name by which players recognise it, "" where they know none.
    st3d: its value in the st3d box of an MP4, None where it has none. stereo_mode: its value of Matroska's StereoMode,
    None where it has none. odd_mode: that value for frames with an odd number of rows, None where it is the same.
    across, down: the number of pictures of full size side by side and above one another; both are 1 where the eyes are
    squeezed, interlaced, or mixed.
    """

    name: str
    tag: str = ""
    st3d: int | None = None
    stereo_mode: int | None = None
    odd_mode: int | None = None
    across: int = 1
    down: int = 1

    def at_height(self, rows: int) -> Layout:
        """Return this layout for frames with `rows` rows. If that number is odd, an interlaced layout has `odd_mode` as
        its `stereo_mode`."""
        return replace(self, stereo_mode=self.odd_mode) if self.odd_mode and rows % 2 else self


LAYOUTS: dict[str, Layout] = {
    layout.name: layout
    for layout in (
        Layout("individual"),
        Layout("multi-view"),
        Layout("side-by-side", "_LR", st3d=2, stereo_mode=1, across=2),
        Layout("side-by-side-half", "_HSBS", st3d=2, stereo_mode=1),
        Layout("cross-eyed", "_RL", st3d=4, stereo_mode=11, across=2),
        Layout("top-bottom", "_TB", st3d=1, stereo_mode=3, down=2),
        Layout("top-bottom-half", "_HTB", st3d=1, stereo_mode=3),
        Layout("anaglyph-red-cyan", stereo_mode=10),
        Layout("anaglyph-green-magenta", stereo_mode=12),
        Layout("anaglyph-yellow-blue"),
        Layout("anaglyph-dubois", stereo_mode=10),
        Layout("interlace-rows", stereo_mode=6, odd_mode=7),
        Layout("interlace-columns", stereo_mode=9),
        Layout("interlace-checkerboard", stereo_mode=4, odd_mode=5),
    )
}

_SIDE_BY_SIDE = frozenset({"side-by-side", "side-by-side-half"})
_TOP_BOTTOM = frozenset({"top-bottom", "top-bottom-half"})
_NOWHERE: frozenset[str] = frozenset()
# In small letters and without separators. Bare SBS and TAB are written for both sizes.
KNOWN_TAGS: dict[str, frozenset[str]] = {
    **dict.fromkeys(("sbs", "sidebyside", "3dh"), _SIDE_BY_SIDE),
    **dict.fromkeys(("lr", "leftright"), frozenset({"side-by-side"})),
    **dict.fromkeys(("hsbs", "halfsbs", "sbshalf", "halfsidebyside", "lrh", "lrq"), frozenset({"side-by-side-half"})),
    **dict.fromkeys(("rl", "rightleft"), frozenset({"cross-eyed"})),
    **dict.fromkeys(("tab", "3dv", "overunder", "topbottom"), _TOP_BOTTOM),
    **dict.fromkeys(("tb", "ou", "ab"), frozenset({"top-bottom"})),
    **dict.fromkeys(
        ("htb", "htab", "hou", "halfou", "halftb", "halfoverunder", "tbh", "abq"), frozenset({"top-bottom-half"})
    ),
    **dict.fromkeys(("rlh", "rlq", "bt", "ba", "bth", "baq"), _NOWHERE),
}

KNOWN_DEGREES: dict[str, int] = {"180": 180, "180x180": 180, "360": 360, "180x360": 360}
"""Tags of panoramas, in small letters, and how many degrees they say."""

_WORD = re.compile(r"[^\W_]+")
MAX_TAG_WORDS = 4
"""Greatest number of words of a tag that is written apart: "half side by side"."""


def name_suffix(layout: Layout, panorama: MoviePanorama | None = None) -> str:
    """Return the ending of a movie's name by which players know the layout and the part of the sphere that is shown,
    such as "_180_LR"; "" where they know neither."""
    return f"{_degrees_tag(panorama)}{layout.tag}"


def tagged_name(path: Path, layout: Layout, panorama: MoviePanorama | None = None) -> Path:
    """Return the path with the tags of `name_suffix` put before its extension. A tag that the name has as a word
    already is not put there again."""
    words = _words(path.stem)
    degrees = "" if _says_degrees(path, panorama) else _degrees_tag(panorama)
    layout_tag = "" if layout.tag[1:].casefold() in words else layout.tag
    return path.with_name(f"{path.stem}{degrees}{layout_tag}{path.suffix}")


def contradicting_tag(path: Path, layout: Layout) -> str | None:
    """Return the first tag in a file's name by which players would take the file for another layout, as it is written
    there; None without any."""
    return next((written for tag, written in _tags(path.stem) if layout.name not in KNOWN_TAGS[tag]), None)


def contradicting_degrees(path: Path, panorama: MoviePanorama | None) -> str | None:
    """Return the first word in a file's name by which players would take the movie for a panorama that it is not, as it
    is written there; None without any. panorama is None for a planar movie."""
    degrees = panorama.degrees if panorama is not None else None
    words = (word.group() for word in _WORD.finditer(path.stem))
    return next((word for word in words if KNOWN_DEGREES.get(word.casefold(), degrees) != degrees), None)


def says(path: Path, layout: Layout, panorama: MoviePanorama | None = None) -> bool:
    """Return True if a file's name has the tags by which players know it for this layout, and for a movie of this part
    of the sphere, as far as there are tags for them."""
    says_layout = not layout.tag or any(layout.name in KNOWN_TAGS[tag] for tag, _ in _tags(path.stem))
    return says_layout and (not _degrees_tag(panorama) or _says_degrees(path, panorama))


def _degrees_tag(panorama: MoviePanorama | None) -> str:
    """Return the tag of a panorama, such as "_180"; "" where players know none."""
    return f"_{panorama.degrees}" if panorama is not None and panorama.degrees else ""


def _says_degrees(path: Path, panorama: MoviePanorama | None) -> bool:
    """Return True if a file's name has a word by which players know it for a movie of this part of the sphere."""
    said = {KNOWN_DEGREES.get(word) for word in _words(path.stem)} - {None}
    return panorama is not None and panorama.degrees in said


def _tags(stem: str) -> Iterator[tuple[str, str]]:
    """Yield the tags in a name that players know: each as its key in KNOWN_TAGS, and as it is written in the name. stem
    is the file name without its extension."""
    words = list(_WORD.finditer(stem))
    at = 0
    while at < len(words):
        for count in range(min(MAX_TAG_WORDS, len(words) - at), 0, -1):
            tag = "".join(word.group() for word in words[at : at + count]).casefold()
            if tag in KNOWN_TAGS:
                yield tag, stem[words[at].start() : words[at + count - 1].end()]
                at += count - 1
                break
        at += 1


def _words(stem: str) -> list[str]:
    """Return the words of a name in small letters; anything but letters and digits parts them."""
    return [word.group().casefold() for word in _WORD.finditer(stem)]
