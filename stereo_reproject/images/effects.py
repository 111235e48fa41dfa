"""What a scene can call for beyond surfaces that look the same from everywhere, and what is done about each."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntFlag
from typing import Any


class Effect(IntFlag):
    """Bit flags: of a scene, of a material, or of a pixel in the pass `passes.EFFECTS_PASS`."""

    GLOSSY = 1
    TRANSMISSION = 2
    ALPHA = 4
    SUBSURFACE = 8
    DIRECTIONAL_EMISSION = 16
    VOLUME = 32
    HAIR = 64
    DEPTH_OF_FIELD = 128
    MOTION_BLUR = 256
    BUMP = 512
    CAMERA_DEPENDENT = 1024
    CATCHER = 2048
    CAUSTICS = 4096
    VIEW_LAYERS = 8192
    DENOISING = 16384

    @property
    def label(self) -> str:
        """The name that reports use."""
        return str(self.name).lower().replace("_", "-")


SEEN_DIFFERENTLY = (
    Effect.GLOSSY
    | Effect.TRANSMISSION
    | Effect.ALPHA
    | Effect.SUBSURFACE
    | Effect.DIRECTIONAL_EMISSION
    | Effect.VOLUME
    | Effect.HAIR
    | Effect.DEPTH_OF_FIELD
    | Effect.MOTION_BLUR
    | Effect.CAMERA_DEPENDENT
    | Effect.CATCHER
)
"""Effects that may make a warped pixel wrong: where none of them is called for, no probe is traced."""


OF_THE_WHOLE_FRAME = Effect.DEPTH_OF_FIELD | Effect.MOTION_BLUR | Effect.VOLUME
"""Effects that no material shows: any pixel may have them."""

PROBED = "probes measure how wrong its warped pixels are, the worst tiles are traced (draft: all is warped)"

HANDLING: dict[Effect, str] = {
    Effect.GLOSSY: (
        "reflections are warped with the surface that shows them, in a denoised picture those in flat mirrors by where "
        f"their image stands; {PROBED}"
    ),
    Effect.TRANSMISSION: (
        "what is seen through it is traced where it may lie far behind and has contrast, else warped with its surface; "
        f"{PROBED}"
    ),
    Effect.ALPHA: f"what is seen through it is warped with the surface that the depth pass has; {PROBED}",
    Effect.SUBSURFACE: f"warped with its surface; {PROBED}",
    Effect.DIRECTIONAL_EMISSION: f"its light is warped as the source eye sees it; {PROBED}",
    Effect.VOLUME: f"an object's before the sky is traced, else it is warped with the surface behind it; {PROBED}",
    Effect.HAIR: f"silhouettes of strands before other things are traced, within fur only what was hidden is; {PROBED}",
    Effect.DEPTH_OF_FIELD: f"blurred edges are traced, with the scene's lens, what else is blurred is warped; {PROBED}",
    Effect.MOTION_BLUR: f"what moves is warped by its depth at one moment, and traced with the shutter open; {PROBED}",
    Effect.BUMP: "nothing: it looks the same to both eyes, and traced pixels filter it as a plain render does",
    Effect.CAMERA_DEPENDENT: f"warped as the source eye sees it; {PROBED}",
    Effect.CATCHER: f"warped with its surface, as transparent as it is for the source eye; {PROBED}",
    Effect.CAUSTICS: "nothing: on matte surfaces they look the same to both eyes; other surfaces are probed themselves",
    Effect.VIEW_LAYERS: "each is a pair of its own; the scene's compositor, if any, puts them together for both eyes",
    Effect.DENOISING: (
        "both eyes are denoised by the scene's own denoiser: warped pixels with the source, traced ones with the target"
    ),
}
"""What is done with each effect that a scene calls for, when Cycles renders it."""

NOT_CALLED_FOR = "not called for: nothing is done, and it costs nothing"
AS_SEEN = "warped as the source eye sees it: EEVEE's light cannot be probed by Cycles"


@dataclass(frozen=True)
class Finding:
    """Whether a scene calls for an effect: by what, in words (nothing: not called for), and how it is handled."""

    effect: Effect
    by: tuple[str, ...]
    handling: str

    @property
    def called_for(self) -> bool:
        return bool(self.by)

    def fields(self) -> dict[str, Any]:
        """As JSON has it."""
        return {
            "effect": self.effect.label,
            "called_for": self.called_for,
            "by": list(self.by),
            "handling": self.handling,
        }


@dataclass(frozen=True)
class EffectsPlan:
    """A finding for each effect, in `Effect`'s order, and what each visible material calls for, by its name."""

    findings: tuple[Finding, ...]
    materials: Mapping[str, Effect]

    @property
    def called_for(self) -> Effect:
        result = Effect(0)
        for finding in self.findings:
            if finding.called_for:
                result |= finding.effect
        return result

    @property
    def view_dependent(self) -> tuple[str, ...]:
        """What may look different from each eye, in words."""
        found = (finding for finding in self.findings if finding.effect & SEEN_DIFFERENTLY)
        return tuple(dict.fromkeys(by for finding in found for by in finding.by))
