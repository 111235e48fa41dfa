"""The measurement of the warp stage: what it is asked for, what it says of the machine, and its result for a person."""

from __future__ import annotations

import importlib.metadata
import os
import platform
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from stereo_reproject.errors import BadInputError
from stereo_reproject.settings.frame import WARPS, SceneOverrides

BENCH_SCHEMA = 2

SCENES = ("room", "smooth")
"""The names of `scenes.SCENES`, which take numpy to look up."""

MODES = ("off-axis", "toe-in")
"""How the eyes converge. Off-axis is warped row by row, toe-in quad by quad."""

CARRIERS = WARPS[1:]
"""Who may carry pixels over: here nothing is left free."""

FEWEST_RUNS = 5
MOST_RUNS = 1000

ONE_THREAD = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}
"""What numpy's linear algebra reads when it is loaded."""


@dataclass(frozen=True)
class BenchSettings:
    """What is measured: size is (width, height) in pixels, warp who does the work. Raises BadInputError."""

    size: tuple[int, int] = (1920, 1080)
    scene: str = "room"
    mode: str = "off-axis"
    warp: str = "numpy"
    runs: int = FEWEST_RUNS

    def __post_init__(self) -> None:
        SceneOverrides(size=self.size)
        for name, value, choices in (
            ("the scene", self.scene, SCENES),
            ("the mode", self.mode, MODES),
            ("the warp", self.warp, CARRIERS),
        ):
            if value not in choices:
                raise BadInputError(f"{name} must be one of {', '.join(choices)}, not {value!r}")
        if not FEWEST_RUNS <= self.runs <= MOST_RUNS:
            raise BadInputError(f"runs must be from {FEWEST_RUNS} to {MOST_RUNS}, not {self.runs}")


def use_one_core() -> int | None:
    """Have this process, and what it starts, compute on one core from now on; which one, None where that cannot be.

    To be called before numpy is loaded.
    """
    os.environ.update(ONE_THREAD)
    if not hasattr(os, "sched_setaffinity"):
        return None
    # The first one is the busiest on most machines.
    core = max(os.sched_getaffinity(0))
    os.sched_setaffinity(0, {core})
    return core


def machine_facts() -> dict[str, Any]:
    """The machine, as a report names it: its processor, how many cores that has, and its system."""
    return {"cpu": cpu_name(), "cores": os.cpu_count(), "system": f"{platform.system()} {platform.machine()}"}


def cpu_name() -> str:
    """The processor's name, as its maker has it where the system tells."""
    with suppress(OSError):
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").splitlines():
            key, _, value = line.partition(":")
            if key.strip() == "model name" and value.strip():
                return " ".join(value.split())
    return platform.processor() or platform.machine() or "unknown"


def versions(*packages: str) -> dict[str, str | None]:
    """The versions of Python and of these packages, None for what is not installed. Blender's is under its own name."""
    found: dict[str, str | None] = {"python": platform.python_version()}
    for name in packages:
        found[name] = None
        with suppress(importlib.metadata.PackageNotFoundError):
            found[name] = importlib.metadata.version(name)
    if "bpy" in found:
        found["blender"] = found.pop("bpy")
    return found


def format_bench(report: Mapping[str, Any]) -> str:
    """The report of `measure.measure` as a person reads it, in lines of plain ASCII."""
    width, height = report["size"]
    all_seconds, grid, scene = report["all_seconds"], report["grid"], report["scene"]
    spread = f"median of {report['runs']}, from {min(all_seconds):.4f} to {max(all_seconds):.4f}"
    threshold = f"above {scene['grid_threshold']:g} arc minutes"
    return "\n".join(
        (
            f"warp stage    {scene['name']}, {scene['mode']}, {width}x{height}, {report['warp']} on {report['device']}",
            f"  seconds         {report['seconds']:10.4f}   {spread}",
            f"    carry         {report['carry_seconds']:10.4f}   grid, forward warp, lookup of the passes",
            f"      grid, warp  {_seconds(report['map_seconds'])}   where pixels come from, without steps or lookup",
            f"    reasons       {report['reasons_seconds']:10.4f}   which pixels are to be traced, and why",
            *_profile_lines(report["profile"]),
            f"  bare lookup     {report['lookup_seconds']:10.4f}   SciPy, bilinear, three channels",
            f"  lookup ratio    {report['lookup_ratio']:10.2f}   {report['lookup_ratio_is']}",
            f"  peak memory     {report['peak_bytes_per_pixel']:10.1f}   bytes per pixel, over the input",
            f"  grid            {report['subdivided']:10.1%}   of {grid['cells']} cells subdivided, {threshold}",
            f"  holes           {report['holes']:10.2%}   of the pixels",
            _agreement_line(report["agreement"]),
        )
    )


def _profile_lines(profile: Mapping[str, float] | None) -> list[str]:
    told = {
        "grid": "cells, and which are subdivided",
        "steps": "in depth, of the source",
        "map": "forward warp and depth test",
        "lookup": "of the passes, where they come from",
        "holes": "where nothing has landed, and why",
        "reasons": "silhouettes, and all else that is to be traced",
        "rest": "in none of these",
    }
    return [f"    . {step:<13} {profile[step]:10.4f}   {what}" for step, what in told.items()] if profile else []


def _seconds(value: float | None) -> str:
    return "       n/a" if value is None else f"{value:10.4f}"


def _agreement_line(agreement: Mapping[str, Any]) -> str:
    if agreement["holes"] is None:
        return f"agreement     not known: {agreement['why_none']}"
    holes, colour = f"{agreement['holes']:.4%}", f"{agreement['colour']:.2g}"
    return f"agreement     of numpy and GPU: holes differ in {holes} of the pixels, colours by {colour} at most"
