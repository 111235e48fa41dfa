"""The projection of a panoramic movie: which part of the sphere each eye's picture shows, and the bytes that say so.

Sources. equi, svhd, prhd: Google, "Spherical Video V2 RFC"; the content of equi is Matroska's ProjectionPrivate too
(RFC 9559). vexu, hfov: Apple, "ISO Base Media File Format and Apple HEVC Stereo Video", and "QuickTime
and ISO Base Media File Formats and Spatial and Immersive Media".
"""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass

SOURCE = b"Stereo Reprojection\0"
"""Name of the tool that wrote the mark, as svhd has it."""

TURN_DEGREES = 360.0
FRACTION_DIGITS = 6
"""Decimal digits to which bounds are rounded, so that Blender's angles, of single precision, give a quarter exactly. At
16384 columns a pixel is 60 times as wide."""

FIXED_ONE = 0xFFFFFFFF
"""Whole of a 0.32 fixed-point number; a quarter is then 0x3FFFFFFF, as in VR180 movies."""

EYE_LEFT, EYE_RIGHT, EYES_SWAPPED = 1, 2, 8
"""Bits of stri."""

HERO_LEFT = 1
"""Value of hero: the eye that is shown where one alone is."""

PACKINGS = {1: (b"over", 0), 2: (b"side", 0), 4: (b"side", EYES_SWAPPED)}
"""Apple's packing and the bit for swapped eyes, by the value of st3d."""


@dataclass(frozen=True)
class MoviePanorama:
    """The part of the sphere that an equirectangular movie shows to each eye: the fractions cut away from the whole
    picture of 360° x 180° at its left, right, top and bottom. VR180 lacks a quarter left and right."""

    left: float = 0.0
    right: float = 0.0
    top: float = 0.0
    bottom: float = 0.0

    @property
    def horizontal_degrees(self) -> float:
        """Horizontal field of view in degrees."""
        return TURN_DEGREES * (1.0 - self.left - self.right)

    @property
    def degrees(self) -> int | None:
        """The number by which players know the movie: 360 for the whole sphere, 180 for its half in front; None for any
        other part."""
        return {WHOLE: 360, FRONT: 180}.get(self)

    @property
    def equi(self) -> bytes:
        """Content of Google's equi box: version and flags, then top, bottom, left and right."""
        bounds = (self.top, self.bottom, self.left, self.right)
        return struct.pack(">5I", 0, *(int(bound * FIXED_ONE) for bound in bounds))


WHOLE = MoviePanorama()
FRONT = MoviePanorama(left=0.25, right=0.25)


def panorama_of(longitudes: tuple[float, float], latitudes: tuple[float, float]) -> MoviePanorama | None:
    """Return the part of the sphere between these longitudes (left and right edge) and latitudes (bottom and top edge),
    in radians from straight ahead; None for what is no such part, such as a mirrored picture.

    A whole turn may begin anywhere: its middle is what players show first.
    """
    (west, east), (south, north) = longitudes, latitudes
    left, right = (round(0.5 + angle / math.tau, FRACTION_DIGITS) for angle in (west, -east))
    bottom, top = (round(0.5 + angle / math.pi, FRACTION_DIGITS) for angle in (south, -north))
    if abs(left + right) < 2.0 * 10.0**-FRACTION_DIGITS:
        left = right = 0.0
    if min(left, right, top, bottom) < 0.0 or left + right >= 1.0 or bottom + top >= 1.0:
        return None
    # Of -0.0 too.
    return MoviePanorama(abs(left), abs(right), abs(top), abs(bottom))


def mp4_boxes(panorama: MoviePanorama, mode: int | None, *, for_apple: bool) -> bytes:
    """Return the boxes of an MP4 or MOV's sample entry that say what part of the sphere is shown: sv3d, and with
    for_apple also vexu and hfov, where Apple has a word for that part. mode is the value of st3d; None where there is
    no such box. They follow st3d: FFmpeg opens no movie that has vexu before it.
    """
    pose = struct.pack(">Iiii", 0, 0, 0, 0)
    projection = box_bytes(b"proj", box_bytes(b"prhd", pose), box_bytes(b"equi", panorama.equi))
    google = box_bytes(b"sv3d", box_bytes(b"svhd", bytes(4), SOURCE), projection)
    return google + (_apple_boxes(panorama, mode) if for_apple else b"")


def box_bytes(kind: bytes, *content: bytes) -> bytes:
    """Return the bytes of an MP4 box."""
    return struct.pack(">I4s", 8 + sum(map(len, content)), kind) + b"".join(content)


def _apple_boxes(panorama: MoviePanorama, mode: int | None) -> bytes:
    """Return vexu and hfov; nothing for a part of the sphere that Apple has no word for. mode is as for `mp4_boxes`."""
    kind = {360: b"equi", 180: b"hequ"}.get(panorama.degrees or 0)
    if kind is None:
        return b""
    projection = box_bytes(b"proj", box_bytes(b"prji", bytes(4), kind))
    view = box_bytes(b"hfov", struct.pack(">I", round(1000.0 * panorama.horizontal_degrees)))
    if mode not in PACKINGS:
        return box_bytes(b"vexu", projection) + view
    packing, swapped = PACKINGS[mode]
    stereo = box_bytes(b"stri", bytes(4), bytes([EYE_LEFT | EYE_RIGHT | swapped]))
    eyes = box_bytes(b"eyes", stereo, box_bytes(b"hero", bytes(4), bytes([HERO_LEFT])))
    return box_bytes(b"vexu", eyes, projection, box_bytes(b"pack", box_bytes(b"pkin", bytes(4), packing))) + view
