"""Whether two versions of this program make the same pictures: five scenes, rendered by both with the same seeds.

    python -m tests.bench.same_pictures BEFORE [AFTER] --scenes DIR [--output DIR] [--size WxH] [--samples N]

BEFORE and AFTER are commits (AFTER is the checkout as it stands, unless given). The scenes are a denoised one, one that
EEVEE renders, one toed in, one with two view layers, and three frames of an animation; holes are traced packed and
numpy warps, for what depends on the time that something takes would differ anyway. All channels of all EXR files are
compared; all pixels of all PNG files, of which holes.png shows each traced pixel by its reason; and of each report what
was decided: the grid, the effects, the estimate. --output gets what was rendered. Exit status 1 where a channel differs
by more than 1e-6, or anything else at all.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from stereo_reproject.sequence.journal_folder import EARLIER_JOURNAL, JOURNAL

ROOT = Path(__file__).resolve().parents[2]
LAYERED_SCENE = "veach-mis"
"""The scene that is given a second view layer."""

MAX_DIFFERENCE = 1e-6
"""Of a channel's value, relative to it where it is above 1: sums in another order."""

DECIDED = ("fractions", "grid", "estimate", "effects", "accuracy", "refine", "samples", "layers", "frames", "warp")
"""Keys of a report whose values must be equal, but for what is in them of `TIMED`."""

TIMED = ("seconds", "predicted", "reason", "peak_mb", "memory", "rate", "would")
"""Parts of keys, of values that depend on how long something took."""

PICTURES = ("exr", "png")
"""Extensions of the files whose pixels are compared."""

CHART = "animation.png"
"""File of an animation that shows seconds: those differ."""

MISSING = "nothing"
"""What a report has in place of a key that is gone, as a difference says it."""

TWO_LAYERS = """
import sys, bpy
bpy.ops.wm.open_mainfile(filepath=sys.argv[1], load_ui=False)
scene = bpy.context.scene
scene.view_layers.new("second").use_pass_normal = True
bpy.ops.wm.save_as_mainfile(filepath=sys.argv[2], compress=False)
"""


@dataclass(frozen=True)
class Case:
    """One command of both versions: its name, the scene (in the folder of scenes, or a file), and options."""

    name: str
    scene: str | Path
    options: tuple[str, ...]
    command: str = "render"


def cases(layers: Path) -> tuple[Case, ...]:
    """The five, `layers` being a scene with two view layers."""
    walks = ("--interocular", "0.065", "--convergence", "5", "--frames", "10-12", "--no-denoise", "--holes")
    return (
        Case("denoised", "living-room", ("--interocular", "0.065", "--convergence", "2.9", "--denoise")),
        Case("eevee", "glass-vase", ("--interocular", "0.013", "--convergence", "0.54", "--source-engine", "eevee")),
        Case("toed-in", "classroom", ("--interocular", "0.065", "--convergence", "6.5", "--mode", "toe-in")),
        Case("layers", layers, ("--interocular", "0.55", "--convergence", "33")),
        Case("animation", "walking-man", walks, "animate"),
    )


def main() -> int:
    arguments = _parse()
    arguments.output.mkdir(parents=True, exist_ok=True)
    alike = True
    with tempfile.TemporaryDirectory() as folder, contextlib.ExitStack() as trees:
        layers = Path(folder) / "two-layers.blend"
        single = arguments.scenes.resolve() / LAYERED_SCENE / f"{LAYERED_SCENE}.blend"
        _run(ROOT, "-c", TWO_LAYERS, str(single), str(layers))
        before = trees.enter_context(_checkout(arguments.before, Path(folder) / "before"))
        after = trees.enter_context(_checkout(arguments.after, Path(folder) / "after")) if arguments.after else ROOT
        for case in cases(layers):
            outputs = [arguments.output / f"{case.name}-{name}" for name in ("before", "after")]
            for tree, output in zip((before, after), outputs, strict=True):
                _render(tree, case, output, arguments)
            differences = list(differences_of(*outputs))
            alike = alike and not differences
            counts = (f"{len(list(outputs[0].rglob(f'*.{kind}'))):>3} {kind.upper()}" for kind in PICTURES)
            verdict = "DIFFERENT" if differences else "the same"
            print(f"{case.name:<12}{' '.join(counts)}  {verdict}", flush=True)
            for line in differences:
                print(f"  {line}", flush=True)
    return 0 if alike else 1


def _parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="python -m tests.bench.same_pictures", description=(__doc__ or "").split("\n")[0]
    )
    parser.add_argument("before", metavar="BEFORE")
    parser.add_argument("after", metavar="AFTER", nargs="?")
    parser.add_argument("--scenes", type=Path, required=True, metavar="DIR")
    parser.add_argument("--output", type=Path, default=Path("build/same-pictures"), metavar="DIR")
    parser.add_argument("--size", default="320x180", metavar="WxH")
    parser.add_argument("--samples", default="16", metavar="N")
    return parser.parse_args()


@contextlib.contextmanager
def _checkout(commit: str, folder: Path) -> Iterator[Path]:
    subprocess.run(["git", "-C", ROOT, "worktree", "add", "--quiet", "--detach", folder, commit], check=True)
    try:
        yield folder
    finally:
        subprocess.run(["git", "-C", ROOT, "worktree", "remove", "--force", folder], check=True)


def _run(tree: Path, *arguments: str) -> None:
    done = subprocess.run([sys.executable, *arguments], cwd=tree, capture_output=True, text=True, check=False)
    if done.returncode:
        raise SystemExit(f"{' '.join(arguments)}: exit status {done.returncode}: {done.stderr.strip()[-400:]}")


def _render(tree: Path, case: Case, output: Path, arguments: argparse.Namespace) -> None:
    # What an earlier comparison left must not stand in for what is no longer written.
    shutil.rmtree(output, ignore_errors=True)
    named = isinstance(case.scene, str)
    scene = arguments.scenes.resolve() / case.scene / f"{case.scene}.blend" if named else case.scene
    common = [
        "--size",
        arguments.size,
        "--samples",
        arguments.samples,
        "--fill",
        "packed",
        "--warp",
        "numpy",
        "--seed",
        "1",
    ]
    ways = ["--overwrite", "--format", "OPEN_EXR"] if case.command == "animate" else []
    command = ["-m", "stereo_reproject", case.command, str(scene), "--output", str(output.resolve()), *case.options]
    _run(tree, *command, *common, *ways)


def differences_of(before: Path, after: Path) -> Iterator[str]:
    """What differs between two folders of results, a line each."""
    names, others = (
        {path.relative_to(folder) for kind in PICTURES for path in folder.rglob(f"*.{kind}")}
        for folder in (before, after)
    )
    names, others = ({name for name in found if name.name != CHART} for found in (names, others))
    for name in sorted(names ^ others):
        yield f"{name} is missing {'before' if name in others else 'after'}"
    for name in sorted(names & others):
        if name.suffix == ".png":
            if not np.array_equal(_pixels(before / name), _pixels(after / name)):
                yield f"{name}: pixels differ"
            continue
        worst = _worst(_channels(before / name), _channels(after / name))
        if worst > MAX_DIFFERENCE:
            yield f"{name}: a channel differs by {worst:.3g}"
    for path in sorted(before.rglob("*.json")):
        name = path.relative_to(before)
        if not {JOURNAL, EARLIER_JOURNAL}.isdisjoint(name.parts):
            # Full of times; animation.json has what was decided.
            continue
        if not (after / name).exists():
            yield f"{name} is missing after"
            continue
        yield from (f"{name}: {line}" for line in _decisions(_read(path), _read(after / name)))


def _pixels(path: Path) -> np.ndarray:
    from matplotlib.image import imread

    return imread(path)


def _channels(path: Path) -> dict[str, np.ndarray]:
    import OpenEXR

    with OpenEXR.File(str(path), separate_channels=True) as file:
        return {
            f"{part.name()}/{name}": channel.pixels for part in file.parts for name, channel in part.channels.items()
        }


def _worst(ours: Mapping[str, np.ndarray], theirs: Mapping[str, np.ndarray]) -> float:
    if ours.keys() != theirs.keys():
        return float("inf")
    worst = 0.0
    for name, pixels in ours.items():
        a, b = pixels.astype(np.float64), theirs[name].astype(np.float64)
        if a.shape != b.shape or not np.array_equal(np.isfinite(a), np.isfinite(b)):
            return float("inf")
        known = np.isfinite(a)
        apart = np.abs(a - b)[known] / np.maximum(np.abs(a[known]), 1.0)
        worst = max(worst, float(apart.max(initial=0.0)))
    return worst


def _read(path: Path) -> Any:
    return json.loads(path.read_text(encoding="utf-8"))


def _decisions(ours: Any, theirs: Any, key: str = "") -> Iterator[str]:
    """Decisions that differ: numbers by more than rounding, all else at all."""
    parts = key.split(".")
    if any(word in parts[-1] for word in TIMED):
        return
    if isinstance(ours, dict) and isinstance(theirs, dict):
        # New keys may come.
        for name in sorted(name for name in ours if key or name in DECIDED):
            inner = f"{key}.{name}".lstrip(".")
            yield from _decisions(ours[name], theirs.get(name, MISSING), inner)
    elif isinstance(ours, list) and isinstance(theirs, list) and len(ours) == len(theirs):
        for index, (a, b) in enumerate(zip(ours, theirs, strict=True)):
            yield from _decisions(a, b, f"{key}[{index}]")
    elif isinstance(ours, float) and isinstance(theirs, (int, float)):
        if not np.isclose(ours, theirs, rtol=MAX_DIFFERENCE, atol=MAX_DIFFERENCE):
            yield f"{key} was {ours!r}, is {theirs!r}"
    elif ours != theirs:
        yield f"{key} was {ours!r}, is {theirs!r}"


if __name__ == "__main__":
    sys.exit(main())
