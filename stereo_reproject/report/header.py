"""The part of a report that is known before anything is rendered, which `inspect` and a price list have too."""

from __future__ import annotations

from dataclasses import dataclass

from .as_json import ABSENT, Absent

REPORT_SCHEMA = 1


@dataclass(frozen=True, kw_only=True)
class StereoReport:
    """The stereo settings of the scene's camera, with distances in scene units; source is the name of the source
    view."""

    source: str
    interocular_distance: float
    convergence_distance: float
    convergence_mode: str
    pivot: str


@dataclass(frozen=True, kw_only=True)
class PictureHeader:
    """The part of a report that is known before rendering, of a pair as of many views: the scene and the picture.

    scene is the .blend, scene_datablock the scene's name in it. size is (width, height) in pixels. accuracy is the name
    of a setting.
    """

    schema: int = REPORT_SCHEMA
    scene: str
    scene_datablock: str
    frame: int
    size: tuple[int, int]
    samples: int
    engine: str
    device: str
    blender: str
    accuracy: str


@dataclass(frozen=True, kw_only=True)
class ReportHeader(PictureHeader):
    """The part of a pair's report that is known before rendering. panorama, "vr180" or "vr360", is absent unless the
    camera was set up as one."""

    stereo: StereoReport
    panorama: str | Absent = ABSENT
