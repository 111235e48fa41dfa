"""The pair of a frame with all its view layers: each of them a stereo frame of its own."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from ..images.exr import CRYPTOMATTE_KEY
from ..images.passes import Passes
from .frame import StereoFrame


@dataclass(frozen=True)
class StereoPair:
    """A finished frame of a scene: its view layers by name, in the scene's order.

    The first is the main one: what Blender shows, and saves as a picture, where no compositor puts layers together.
    """

    frames: Mapping[str, StereoFrame]

    @property
    def main(self) -> str:
        return next(iter(self.frames))

    @property
    def main_frame(self) -> StereoFrame:
        return self.frames[self.main]

    @property
    def eyes(self) -> dict[str, dict[str, Passes]]:
        """Passes by view and then by view layer."""
        views = self.main_frame.eyes
        return {view: {layer: frame.eyes[view] for layer, frame in self.frames.items()} for view in views}

    @property
    def metadata(self) -> dict[str, str]:
        """The texts that say what the eyes' cryptomattes hold, as Blender has them."""
        return {key: text for frame in self.frames.values() for key, text in _cryptomattes(frame).items()}

    @property
    def seconds(self) -> dict[str, float]:
        """By stage and in total, over all layers."""
        total: dict[str, float] = {}
        for frame in self.frames.values():
            for stage, seconds in frame.seconds.items():
                total[stage] = total.get(stage, 0.0) + seconds
        return total

    @property
    def predicted_speedup(self) -> float:
        """Over multiview, which renders the source of each layer as we do, and then the other eye, synced already."""
        costs = [frame.source_cost for frame in self.frames.values()]
        peer = sum(cost.seconds + cost.per_frame + 2.0 * cost.denoise_seconds for cost in costs)
        return peer / self.seconds["total"]

    @property
    def invalid_pixels(self) -> dict[str, int]:
        """By view, over all layers."""
        frames = self.frames.values()
        return {view: sum(frame.invalid_pixels[view] for frame in frames) for view in self.main_frame.invalid_pixels}


def _cryptomattes(frame: StereoFrame) -> dict[str, str]:
    """The texts about those cryptomattes that the user gets: not about one that only we have asked for."""
    passes = next(iter(frame.eyes.values()))
    found: dict[str, str] = {}
    for key, name in frame.metadata.items():
        group = key.removesuffix("/name")
        if key.startswith(CRYPTOMATTE_KEY) and group != key and f"{name.rpartition('.')[2]}00" in passes:
            found.update({k: text for k, text in frame.metadata.items() if k.startswith(f"{group}/")})
    return found
