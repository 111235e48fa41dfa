"""Settings of one pair: checked once, and frozen, so that nothing changes under way."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from ..errors import BadInputError
from ..words import Words
from .checks import check_choice, check_float, check_int

ACCURACIES = ("draft", "preview", "balanced", "high", "exact")
CUSTOM = "custom"
"""The accuracy of a run that was given a tolerance."""
FILL_METHODS = ("auto", "packed", "card", "full")
PACKED_CAMERAS = ("auto", "osl", "portal")
EYES = ("left", "right")
SOURCE_ENGINES = ("cycles", "eevee")
PANORAMAS = {"vr180": (4096, 4096), "vr360": (8192, 4096)}
"""Panoramas for headsets, each with its size per eye in pixels, (width, height), where no other is asked for."""
CONVERGENCE_MODES = ("off-axis", "parallel", "toe-in")
INTERPOLATIONS = ("auto", "linear", "cubic")
WARPS = ("auto", "numpy", "gpu")

MAX_SIZE = 65536
MAX_SAMPLES = 1 << 24
MAX_SEED = (1 << 31) - 1
MAX_FRAME = 1048574


@dataclass(frozen=True)
class SceneOverrides:
    """Values that replace the scene's own for one run; None keeps the scene's value. Raises BadInputError.

    size is (width, height) in pixels and replaces the scene's resolution and its percentage. interocular_distance and
    convergence_distance are in scene units. source_engine renders the source in place of the scene's engine. denoise
    turns denoising of Cycles' pictures on or off in every view layer. panorama, "vr180" or "vr360", renders the scene
    for headsets from the place of its camera; size is then that of `PANORAMAS` unless another is given. mono is for the
    frames of an animation (`for_mono`): they are of one view, through the scene's own camera.
    """

    frame: int | None = None
    size: tuple[int, int] | None = None
    samples: int | None = None
    seed: int | None = None
    interocular_distance: float | None = None
    convergence_distance: float | None = None
    convergence_mode: str | None = None
    source_engine: str | None = None
    denoise: bool | None = None
    panorama: str | None = None
    mono: bool = False

    def __post_init__(self) -> None:
        if self.panorama is not None:
            check_choice("the panorama", self.panorama, tuple(PANORAMAS))
            if self.size is None:
                object.__setattr__(self, "size", PANORAMAS[self.panorama])
        check_int("frame", self.frame, -MAX_FRAME, MAX_FRAME)
        if self.size is not None:
            if not isinstance(self.size, tuple) or len(self.size) != 2:
                raise BadInputError(Words("the size must be a width and a height, not {size}", size=repr(self.size)))
            width, height = self.size
            check_int("the width", width, 4, MAX_SIZE)
            check_int("the height", height, 4, MAX_SIZE)
        check_int("samples", self.samples, 1, MAX_SAMPLES)
        check_int("the seed", self.seed, 0, MAX_SEED)
        if self.interocular_distance is not None:
            check_float("the interocular distance", self.interocular_distance, 0.0)
        if self.convergence_distance is not None:
            check_float("the convergence distance", self.convergence_distance, 0.0, above=True)
        if self.convergence_mode is not None:
            check_choice("the convergence mode", self.convergence_mode, CONVERGENCE_MODES)
        if self.source_engine is not None:
            check_choice("the source engine", self.source_engine, SOURCE_ENGINES)
        if self.denoise is not None and not isinstance(self.denoise, bool):
            raise BadInputError(
                Words("denoise must be true, false or left out, not {denoise}", denoise=repr(self.denoise))
            )


@dataclass(frozen=True)
class StereoSettings:
    """The settings of a pair; those of the scene are in `scene`. Raises BadInputError.

    source is the eye that is rendered whole. tolerance is the greatest honest ratio that is promised, in place of that
    of `accuracy`, which then becomes "custom". fill is the method by which holes are traced, and packed_by the camera
    that shoots the rays of packed pixels: "auto" takes an OSL camera where Cycles has one and it can trace the scene,
    else a Ray Portal. grid_threshold is the binocular parallax within a grid cell, in arc minutes, from which it is
    subdivided. compare has multiview rendered too, for comparison.

    interpolation "auto" is cubic for the colour of a denoised picture; for light in a noisy one it is cubic where the
    picture stands above its noise and linear where noise rules; it is linear for all else.
    warp is what warps pixels: "gpu" falls back to numpy where no GPU works, and "auto" takes the faster one where that
    is measured.
    """

    source: str = "left"
    accuracy: str = "balanced"
    fill: str = "auto"
    grid_threshold: float = 0.25
    interpolation: str = "auto"
    compare: bool = False
    scene: SceneOverrides = field(default_factory=SceneOverrides)
    tolerance: float | None = None
    warp: str = "auto"
    packed_by: str = "auto"

    @property
    def packed_camera(self) -> str:
        """The packed camera that is asked for: `packed_by`, or "auto" where the fill method packs nothing."""
        return self.packed_by if self.fill in ("auto", "packed") else "auto"

    def __post_init__(self) -> None:
        check_choice("the source eye", self.source, EYES)
        if self.tolerance is None:
            check_choice("accuracy", self.accuracy, ACCURACIES)
        else:
            check_float("the tolerance", self.tolerance, 1.0, above=True)
            if self.accuracy not in (CUSTOM, StereoSettings.accuracy):
                raise BadInputError("accuracy and tolerance are two ways to say the same; give one of them")
            object.__setattr__(self, "accuracy", CUSTOM)
        check_choice("fill", self.fill, FILL_METHODS)
        check_choice("packed by", self.packed_by, PACKED_CAMERAS)
        check_choice("interpolation", self.interpolation, INTERPOLATIONS)
        check_choice("warp", self.warp, WARPS)
        check_float("the grid threshold", self.grid_threshold, 0.0)

    @property
    def target(self) -> str:
        """The name of the eye that is made from the source; of one view alone, it is the source."""
        if self.scene.mono:
            return self.source
        return "right" if self.source == "left" else "left"


def for_mono(settings: StereoSettings) -> StereoSettings:
    """Return these settings for frames of one view, through the scene's own camera. Raises BadInputError where they ask
    for anything of two eyes."""
    scene = settings.scene
    asked = {
        "interocular distance": scene.interocular_distance,
        "convergence distance": scene.convergence_distance,
        "convergence mode": scene.convergence_mode,
        "panorama for headsets": scene.panorama,
        "source eye": None if settings.source == StereoSettings.source else settings.source,
    }
    named = next((name for name, value in asked.items() if value is not None), None)
    if named is not None:
        raise BadInputError(Words("a mono animation has one view and no {what}: leave it out", what=Words(named)))
    return replace(settings, scene=replace(scene, mono=True))
