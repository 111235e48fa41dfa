"""Effects: all that a scene may have beyond surfaces that look the same from everywhere, and how each is handled."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntFlag
from typing import Any


class Effect(IntFlag):
    """Effects as bit flags: all that a scene may have beyond surfaces that look the same from everywhere.

    They are those of a scene, of a material, or of a pixel in the pass `passes.EFFECTS_PASS`.
    """

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
        """Name of the effect in reports, as "depth-of-field"."""
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


WHOLE_FRAME_EFFECTS = Effect.DEPTH_OF_FIELD | Effect.MOTION_BLUR | Effect.VOLUME
"""Effects that no material shows: any pixel may have them."""

IN_REFLECTED_LIGHT = Effect.GLOSSY | Effect.TRANSMISSION
"""Effects of which all that looks different from each eye is reflected or transmitted light."""

_PROBED = "probes measure how wrong its warped pixels are, the worst tiles are traced (draft: all is warped)"
"""Words of reports that the handling of many effects ends with."""

HANDLING: dict[Effect, str] = {
    Effect.GLOSSY: (
        "reflections are warped with the surface that shows them, those in flat mirrors by where their image stands; "
        f"{_PROBED}"
    ),
    Effect.TRANSMISSION: (
        "what is seen through it is traced where it may lie far behind and has contrast, else warped with its surface; "
        f"{_PROBED}"
    ),
    Effect.ALPHA: f"what is seen through it is warped with the surface that the depth pass has; {_PROBED}",
    Effect.SUBSURFACE: f"warped with its surface; {_PROBED}",
    Effect.DIRECTIONAL_EMISSION: f"its light is warped as the source eye sees it; {_PROBED}",
    Effect.VOLUME: f"an object's before the sky is traced, else it is warped with the surface behind it; {_PROBED}",
    Effect.HAIR: (
        f"silhouettes of strands before other things are traced, within fur only what was hidden is; {_PROBED}"
    ),
    Effect.DEPTH_OF_FIELD: (
        f"blurred edges are traced, with the scene's lens, what else is blurred is warped; {_PROBED}"
    ),
    Effect.MOTION_BLUR: f"what moves is warped by its depth at one moment, and traced with the shutter open; {_PROBED}",
    Effect.BUMP: "nothing: it looks the same to both eyes, and traced pixels filter it as a plain render does",
    Effect.CAMERA_DEPENDENT: f"warped as the source eye sees it; {_PROBED}",
    Effect.CATCHER: f"warped with its surface, as transparent as it is for the source eye; {_PROBED}",
    Effect.CAUSTICS: "nothing: on matte surfaces they look the same to both eyes; other surfaces are probed themselves",
    Effect.VIEW_LAYERS: "each is a pair of its own; the scene's compositor, if any, puts them together for both eyes",
    Effect.DENOISING: (
        "both eyes are denoised by the scene's own denoiser: warped pixels with the source, traced ones with the target"
    ),
}
"""Words of reports for how each effect is handled that a scene calls for, where Cycles renders it."""

NOT_CALLED_FOR = "not called for: nothing is done, and it costs nothing"
"""Words of reports for an effect that a scene does not call for."""

EEVEE_HANDLING = "warped as the source eye sees it: EEVEE's light cannot be probed by Cycles"
"""Words of reports for how an effect is handled that may be seen differently by each eye, where EEVEE renders."""


@dataclass(frozen=True)
class Finding:
    """The answer to whether a scene calls for one effect.

    by names, in words, the things in the scene that call for it, and is empty where nothing does. handling says in
    words, for reports, how the effect is handled.
    """

    effect: Effect
    by: tuple[str, ...]
    handling: str

    @property
    def called_for(self) -> bool:
        """True where anything in the scene calls for the effect."""
        return bool(self.by)

    def fields(self) -> dict[str, Any]:
        """Return the finding as an object of report.json."""
        return {
            "effect": self.effect.label,
            "called_for": self.called_for,
            "by": list(self.by),
            "handling": self.handling,
        }


@dataclass(frozen=True)
class EffectsPlan:
    """Findings of a scene: which effects it calls for, and which materials have them.

    findings has one for each effect, in `Effect`'s order; materials has the effects of each visible material, by its
    name. may_mirror: True where Cycles may show a flat mirror whose image `warp/mirrors` finds, because something
    visible that is neither hair nor transmissive may reflect enough for one, smoothly enough.
    """

    findings: tuple[Finding, ...]
    materials: Mapping[str, Effect]
    may_mirror: bool = False

    @property
    def called_for(self) -> Effect:
        """Flags of the effects that the scene calls for."""
        result = Effect(0)
        for finding in self.findings:
            if finding.called_for:
                result |= finding.effect
        return result

    @property
    def differs_in_reflected_light(self) -> bool:
        """True where what looks different from each eye is mostly reflected or transmitted light, so that it is worth
        being told apart; single materials may have other effects, but not the whole frame."""
        elsewhere = WHOLE_FRAME_EFFECTS | Effect.CATCHER
        return bool(self.called_for & IN_REFLECTED_LIGHT) and not self.called_for & elsewhere

    @property
    def view_dependent(self) -> tuple[str, ...]:
        """Things in the scene that may look different from each eye, in words, each once."""
        found = (finding for finding in self.findings if finding.effect & SEEN_DIFFERENTLY)
        return tuple(dict.fromkeys(by for finding in found for by in finding.by))
