"""Which runs an analysis is made of: scenes at several sizes, a camera path, and one thing varied at a time."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from stereo_reproject.blender.scene.file_digest import file_digest
from stereo_reproject.settings.frame import StereoSettings
from tests.bench.warp import scenes as made_up
from tests.bench.warp.settings import CARRIERS, MODES

MULTIVIEW = "multiview"
METHODS = ("card", "packed")
NUMPY = CARRIERS[0]

STAGE, SCENES, PATH = "stage", "scenes", "path"
PIXELS, SAMPLES, TRIANGLES, HOLES = "pixels", "samples", "triangles", "holes"
SERIES = (PIXELS, SAMPLES, TRIANGLES, HOLES)

DEMO = Path("demo/cornell-box/cornell-box.blend")

EYES = {
    "living-room": (0.065, 2.9),
    "living-room-2": (0.065, 3.8),
    "classroom": (0.065, 6.5),
    "bathroom": (0.065, 2.5),
    "veach-mis": (0.55, 33.0),
    "cornell-box": (0.2, 6.9),
    "meadow": (0.065, 5.9),
    "glass-vase": (0.013, 0.54),
    "broken-window": (0.03, 1.14),
    "bmw27": (0.28, 14.0),
    "fur-ball": (0.08, 3.4),
    "volumetric-caustic": (0.2, 6.0),
    "walking-man": (0.065, 5.0),
}
"""Interocular and convergence distance by the scene's name. Another scene's own are taken as they are."""


@dataclass(frozen=True)
class Scene:
    """A .blend and its eyes' distances, None for its own. amiss says why there is no such file, if there is none."""

    name: str
    blend: Path
    interocular: float | None = None
    convergence: float | None = None
    triangles: int | None = None
    amiss: str = ""

    def content(self) -> list[object]:
        """What tells it from another scene, wherever the file lies."""
        return [file_digest(self.blend), self.interocular, self.convergence]


MADE_UP = Scene("made up", Path(made_up.__file__))
"""What the warp stage is measured on, as the code makes it."""


@dataclass(frozen=True)
class Picture:
    """What the warp stage alone is measured on; the threshold is in arc minutes."""

    scene: str = "room"
    mode: str = "off-axis"
    grid_threshold: float = StereoSettings.grid_threshold

    def options(self) -> list[str]:
        return [f"--scene={self.scene}", f"--mode={self.mode}", f"--grid-threshold={self.grid_threshold:g}"]


ROOM = Picture()
NATIVE_AND_ADAPTIVE = tuple(
    Picture("smooth", mode, threshold) for mode in MODES for threshold in (0.0, StereoSettings.grid_threshold)
)
"""The smooth scene with all of its cells subdivided, and with those that ask for it."""
TOED_IN = Picture(mode="toe-in")


@dataclass(frozen=True)
class Run:
    """One run of the command line; with method "multiview", of Blender's own way; with one of `bench.CARRIERS`, of the
    warp stage alone, on picture. turn counts repeats. compare has a pair measured against multiview in its process."""

    scene: Scene
    method: str
    size: tuple[int, int]
    samples: int
    accuracy: str = "balanced"
    frame: int | None = None
    turn: int = 0
    picture: Picture = ROOM
    denoise: bool = False
    """The paper has no denoiser, and what one costs hides what its analysis compares."""
    compare: bool = False

    @property
    def peer(self) -> Run:
        """What Blender's own way takes for the same."""
        return replace(self, method=MULTIVIEW)

    def options(self) -> list[str]:
        """Those of `render`, without scene and output folder; of `tests.bench.warp`, where a carrier is measured."""
        if self.method in CARRIERS:
            return [f"--size={self.size[0]}x{self.size[1]}", f"--warp={self.method}", *self.picture.options()]
        optional = {
            "--interocular": self.scene.interocular,
            "--convergence": self.scene.convergence,
            "--frame": self.frame,
        }
        return [
            f"--size={self.size[0]}x{self.size[1]}",
            f"--samples={self.samples}",
            f"--seed={self.turn + 1}",
            "--denoise" if self.denoise else "--no-denoise",
            *(f"{name}={value}" for name, value in optional.items() if value is not None),
            *([] if self.method == MULTIVIEW else self._options_of_pair()),
        ]

    def _options_of_pair(self) -> list[str]:
        """Those that multiview has no use for."""
        return [f"--accuracy={self.accuracy}", f"--fill={self.method}", *(["--compare"] if self.compare else [])]

    @property
    def title(self) -> str:
        frame = "" if self.frame is None else f", frame {self.frame}"
        width, height = self.size
        turn = f", again ({self.turn + 1})" if self.turn else ""
        if self.method in CARRIERS:
            picture = f"{self.picture.scene}, {self.picture.mode}, threshold {self.picture.grid_threshold:g}"
            return f"warp stage, {picture}, {width}x{height}, {self.method}{turn}"
        how = f"{self.method}, denoised" if self.denoise else self.method
        return f"{self.scene.name}, {width}x{height}, {self.samples} samples{frame}, {how}{turn}"


@dataclass(frozen=True)
class Case:
    """A run, and for what it is made. A run may be made for several things, and is made once."""

    part: str
    run: Run


FEWEST_FRAMES = 3
"""Of the path, at any size."""


@dataclass(frozen=True)
class Plan:
    """How much is measured. interoculars are factors of the scene's own distance; subdivisions quarter each face.

    The path has all of `sizes` unless it has sizes of its own, and `frames` at the smallest of them, see `frames_at`.
    stage_size is that of whatever the warp stage is measured on at one size alone.
    """

    sizes: tuple[tuple[int, int], ...] = ((960, 540), (1920, 1080), (3840, 2160))
    samples: int = 64
    accuracy: str = "balanced"
    turns: int = 3
    path_sizes: tuple[tuple[int, int], ...] | None = None
    path_samples: int = 32
    frames: tuple[int, ...] = tuple(range(1, 25))
    study_size: tuple[int, int] = (960, 540)
    study_samples: int = 32
    study_sizes: tuple[tuple[int, int], ...] = ((240, 135), (480, 270), (960, 540), (1920, 1080), (3840, 2160))
    study_counts: tuple[int, ...] = (4, 8, 16, 32, 64, 128)
    subdivisions: tuple[int, ...] = (0, 3, 4, 5, 6, 7, 8)
    interoculars: tuple[float, ...] = (0.25, 0.5, 1.0, 2.0, 4.0, 8.0)
    stage_sizes: tuple[tuple[int, int], ...] = ((960, 540), (1920, 1080), (3840, 2160), (7680, 4320))
    stage_size: tuple[int, int] = (1920, 1080)
    parts: tuple[str, ...] = field(default=(STAGE, SCENES, PATH, *SERIES))

    def frames_at(self, size: tuple[int, int]) -> list[int]:
        """Those of the path at this size, evenly among its frames: fewer by as much as it has more pixels than the
        smallest, so that no size takes longer than another; `FEWEST_FRAMES` at least, if there are as many."""
        smallest = min(math.prod(one) for one in self.path_sizes or self.sizes)
        wanted = max(round(len(self.frames) * smallest / math.prod(size)), FEWEST_FRAMES)
        count = min(wanted, len(self.frames))
        last = len(self.frames) - 1
        return [self.frames[round(place * last / max(count - 1, 1))] for place in range(count)]


QUICK = Plan(
    sizes=((192, 108), (384, 216), (768, 432)),
    samples=4,
    turns=1,
    path_sizes=((128, 72), (256, 144), (512, 288)),
    path_samples=4,
    frames=tuple(range(1, 5)),
    study_size=(320, 180),
    study_samples=8,
    study_sizes=((160, 90), (240, 135), (320, 180), (480, 270), (640, 360)),
    study_counts=(2, 4, 8, 16),
    subdivisions=(0, 3, 5, 7),
    interoculars=(0.5, 1.0, 2.0, 4.0),
    stage_sizes=((480, 270), (960, 540)),
    stage_size=(960, 540),
)
"""For a machine of two cores, in a few minutes: that everything works, and how the parts compare."""


def cases(plan: Plan, scenes: Sequence[Scene], study: Scene, path: Scene, subdivided: Sequence[Scene]) -> list[Case]:
    """All that is run, in its order: first what says most.

    study is the scene of which one thing is varied at a time, path the one with a moving camera, and subdivided are the
    study's variants with more triangles.
    """
    found = list(_of_stage(plan))
    for turn in range(plan.turns):
        found += (_again(case, turn) for case in _of_scenes(plan, scenes))
        found += (_again(case, turn) for case in _of_path(plan, path))
        found += (_again(case, turn) for case in _of_study(plan, study, subdivided))
    return [case for case in found if case.part in plan.parts]


def _of_stage(plan: Plan) -> Iterator[Case]:
    """Once each: that measurement has repeats of its own."""
    for size in plan.stage_sizes:
        yield from (Case(STAGE, Run(MADE_UP, carrier, size, 0)) for carrier in CARRIERS)
    for picture in (TOED_IN, *NATIVE_AND_ADAPTIVE):
        yield Case(STAGE, Run(MADE_UP, NUMPY, plan.stage_size, 0, picture=picture))


def _again(case: Case, turn: int) -> Case:
    return replace(case, run=replace(case.run, turn=turn))


def _of_scenes(plan: Plan, scenes: Sequence[Scene]) -> Iterator[Case]:
    for size in plan.sizes:
        for scene in scenes:
            yield from _compared(SCENES, Run(scene, MULTIVIEW, size, plan.samples, plan.accuracy))


def _of_path(plan: Plan, path: Scene) -> Iterator[Case]:
    for size in plan.path_sizes or plan.sizes:
        for frame in plan.frames_at(size):
            yield from _compared(PATH, Run(path, MULTIVIEW, size, plan.path_samples, plan.accuracy, frame))


def _compared(part: str, peer: Run) -> Iterator[Case]:
    """Every method, and multiview between them: what the machine does besides changes from minute to minute."""
    first, *others = METHODS
    for method in (first, MULTIVIEW, *others):
        yield Case(part, replace(peer, method=method))


def _of_study(plan: Plan, study: Scene, subdivided: Sequence[Scene]) -> Iterator[Case]:
    for method in METHODS:
        base = Run(study, method, plan.study_size, plan.study_samples, plan.accuracy)
        yield from (Case(PIXELS, replace(base, size=size)) for size in plan.study_sizes)
        yield from (Case(SAMPLES, replace(base, samples=count)) for count in plan.study_counts)
        yield from (Case(TRIANGLES, replace(base, scene=scene)) for scene in subdivided)
        yield from (Case(HOLES, replace(base, scene=scene)) for scene in _apart(study, plan.interoculars))


def _apart(study: Scene, factors: Sequence[float]) -> Iterator[Scene]:
    """The study with its eyes further apart, or nearer together."""
    if study.interocular is not None:
        for factor in factors:
            yield replace(study, interocular=round(study.interocular * factor, 9))


def scenes_in(folder: Path, names: Sequence[str] = ()) -> list[Scene]:
    """The scenes of a folder that holds NAME/NAME.blend or NAME.blend, all or those named, in the order of `EYES`.

    Raises ValueError, which says what is missing, on one line.
    """
    if not folder.is_dir():
        raise ValueError(f"there is no folder {folder}; name one with .blend files (SCENES=folder), or take --quick")
    inside, beside = (sorted(path for path in folder.glob(at) if path.is_file()) for at in ("*/*.blend", "*.blend"))
    found = {path.stem: path for path in beside} | {path.stem: path for path in inside if path.stem == path.parent.name}
    missing = [name for name in names if name not in found]
    if missing or not found:
        what = f"no scene {missing[0]}" if missing else "no .blend file, nor NAME/NAME.blend"
        raise ValueError(f"{folder} has {what}; known are: {', '.join(found) or 'none'}")
    order = {name: place for place, name in enumerate(EYES)}
    chosen = names or sorted(found, key=lambda name: (order.get(name, len(order)), name))
    return [scene_of(found[name]) for name in chosen]


def scene_of(blend: Path) -> Scene:
    return Scene(blend.stem, blend, *EYES.get(blend.stem, (None, None)))


def described(run: Run) -> str:
    """The run's options and all else that it depends on, but for the machine and the programs."""
    return json.dumps([run.method, *run.options(), run.scene.content()])
