"""The part of a report that is known before anything is rendered, which `inspect` and a price list have too."""

from __future__ import annotations

from dataclasses import dataclass

REPORT_SCHEMA = 1


@dataclass(frozen=True, kw_only=True)
class StereoReport:
    """The stereo settings of the scene's camera, in scene units, and the name of the source view."""

    source: str
    interocular_distance: float
    convergence_distance: float
    convergence_mode: str
    pivot: str


@dataclass(frozen=True, kw_only=True)
class ReportHeader:
    """The picture that is rendered, and the settings. size is (width, height) in pixels, accuracy a setting's name."""

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
    stereo: StereoReport
