"""report.json's keys, their order and their values, of a made-up pair with everything and of one with the least."""

from __future__ import annotations

import math
import re
import types
import typing
from dataclasses import fields, is_dataclass, replace
from pathlib import Path

import pytest

from stereo_reproject.files import to_json
from stereo_reproject.images.effects import EffectsPlan
from stereo_reproject.report.as_json import ABSENT, as_json
from stereo_reproject.report.frame_report import (
    CompareReport,
    EstimateReport,
    FrameReport,
    MemoryReport,
    NoEstimateReport,
    ParallaxReport,
)
from stereo_reproject.report.header import ReportHeader, StereoReport
from stereo_reproject.report.making import LayerFacts, pair_report
from stereo_reproject.settings.frame import StereoSettings
from stereo_reproject.views.parallax import ScreenParallax

from .made_up import PLAN, stereo_pair

HERE = Path(__file__).parent
DOCUMENT = HERE.parents[1] / "docs/report.md"

HEADER = ReportHeader(
    scene="room",
    scene_datablock="Scene",
    frame=7,
    size=(960, 540),
    samples=64,
    engine="CYCLES",
    device="CPU",
    blender="5.2.3",
    accuracy="balanced",
    stereo=StereoReport(
        source="left",
        interocular_distance=0.065,
        convergence_distance=1.95,
        convergence_mode="OFFAXIS",
        pivot="LEFT",
    ),
)
COMPARE = CompareReport(
    multiview_seconds=20.0,
    speedup=2.0,
    noise_rmse=0.5,
    rmse=0.25,
    noise_ratio=None,
    bias=None,
    honest_ratio=None,
    worst_tiles=None,
    wrong_tiles=None,
    no_noise="EEVEE renders the same noise each time, and has none to compare with",
    flip=0.125,
    noise_flip=None,
    flip_ratio=None,
)
PARALLAX = ParallaxReport(nearest=ScreenParallax(2.0, -3.5, -0.25), farthest=ScreenParallax(math.inf, 12.0, 1.25))


def made_up(*, whole: bool) -> FrameReport:
    pair = stereo_pair(whole=whole)
    facts = [
        LayerFacts(
            header=replace(HEADER, panorama="vr180") if whole else HEADER,
            packed_by="portal",
            plan=PLAN if whole else EffectsPlan((), {}),
            parallax=PARALLAX if whole else None,
            warnings=("same", f"layer {k}") if whole else (),
            time_limit=2.5 if whole else ABSENT,
            samples_rendered=37 if whole else ABSENT,
        )
        for k in range(len(pair.frames))
    ]
    report = pair_report(pair, facts, StereoSettings(), MemoryReport(peak_mb=812.5, resident_mb=None))
    report = replace(report, seconds={**report.seconds, "load": 1.25, "write": 0.5})
    return replace(report, compare=COMPARE, warnings=(*report.warnings, "scene")) if whole else report


@pytest.mark.parametrize(("name", "whole"), [("whole_report.json", True), ("least_report.json", False)])
def test_report_json_is_the_same_to_the_byte(name, whole):
    assert to_json(as_json(made_up(whole=whole))) + "\n" == (HERE / name).read_text(encoding="utf-8")


def test_what_is_absent_has_no_key_and_what_is_none_is_null():
    limited = replace(made_up(whole=False), time_limit=2.5, samples_rendered=None)
    told = as_json(limited)
    assert (told["time_limit"], told["samples_rendered"]) == (2.5, None)
    assert not {"layers", "compare", "panorama"} & told.keys()
    assert "no_noise" not in as_json(replace(COMPARE, no_noise=ABSENT))


def test_an_estimate_has_the_same_keys_with_and_without_probes():
    assert {field.name for field in fields(EstimateReport)} == {field.name for field in fields(NoEstimateReport)}


def dataclasses_in(hint: object) -> list[type]:
    if isinstance(hint, type) and is_dataclass(hint):
        return [hint]
    inner = typing.get_args(hint)
    if isinstance(hint, types.UnionType) or typing.get_origin(hint) is tuple:
        return [found for part in inner for found in dataclasses_in(part)]
    return []


def keys_of(kind: type) -> set[str]:
    """The dotted keys of a dataclass's JSON; rows of lists count as parts."""
    result = set()
    hints = typing.get_type_hints(kind)
    for field in fields(kind):
        key = field.name.rstrip("_")
        parts = dataclasses_in(hints[field.name])
        result |= {f"{key}.{inner}" for part in parts for inner in keys_of(part)} or {key}
    return result


def documented_keys() -> set[str]:
    """The keys in the first column of the tables of keys in docs/report.md."""
    _, _, after = DOCUMENT.read_text(encoding="utf-8").partition("## The keys of report.json")
    section = after.partition("\n## ")[0]
    rows = [line for line in section.splitlines() if line.startswith("| `")]
    return {key for row in rows for key in re.findall(r"`([^`]+)`", row.split("|")[1])}


def test_the_document_and_the_report_have_the_same_keys():
    assert documented_keys() == keys_of(FrameReport)
