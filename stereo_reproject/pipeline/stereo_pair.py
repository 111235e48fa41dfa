"""The stereo pair of a frame with all its view layers, each of which is a stereo frame of its own."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from ..images.exr import CRYPTOMATTE_ATTRIBUTE_PREFIX
from ..images.passes import Passes
from .frame import StereoFrame


@dataclass(frozen=True)
class StereoPair:
    """Finished stereo pair of a scene: its view layers by name, in the scene's order.

    The first is the main one, which Blender shows and saves as a picture where no compositor puts layers together.
    """

    frames: Mapping[str, StereoFrame]

    @property
    def main(self) -> str:
        """Name of the main view layer."""
        return next(iter(self.frames))

    @property
    def main_frame(self) -> StereoFrame:
        """Stereo frame of the main view layer."""
        return self.frames[self.main]

    @property
    def eyes(self) -> dict[str, dict[str, Passes]]:
        """Passes by view and then by view layer."""
        views = self.main_frame.eyes
        return {view: {layer: frame.eyes[view] for layer, frame in self.frames.items()} for view in views}

    @property
    def metadata(self) -> dict[str, str]:
        """Texts of Blender's renders that say which name each hash of the eyes' cryptomattes stands for."""
        return {key: text for frame in self.frames.values() for key, text in _cryptomattes(frame).items()}

    @property
    def seconds(self) -> dict[str, float]:
        """Seconds by stage and in total, over all layers."""
        total: dict[str, float] = {}
        for frame in self.frames.values():
            for stage, seconds in frame.seconds.items():
                total[stage] = total.get(stage, 0.0) + seconds
        return total

    @property
    def predicted_speedup(self) -> float:
        """Predicted seconds of Blender's multiview over the seconds that were taken.

        Multiview renders the source of each layer as we do, and then the other eye without another sync.
        """
        costs = [frame.source_cost for frame in self.frames.values()]
        multiview = sum(cost.seconds + cost.per_frame + 2.0 * cost.denoise_seconds for cost in costs)
        return multiview / self.seconds["total"]

    @property
    def invalid_pixels(self) -> dict[str, int]:
        """Number of invalid pixels by view, over all layers."""
        frames = self.frames.values()
        return {view: sum(frame.invalid_pixels[view] for frame in frames) for view in self.main_frame.invalid_pixels}


def _cryptomattes(frame: StereoFrame) -> dict[str, str]:
    """Return the texts about those cryptomattes that users get, without one that only this extension has asked for."""
    passes = next(iter(frame.eyes.values()))
    found: dict[str, str] = {}
    for key, name in frame.metadata.items():
        group = key.removesuffix("/name")
        if key.startswith(CRYPTOMATTE_ATTRIBUTE_PREFIX) and group != key and f"{name.rpartition('.')[2]}00" in passes:
            found.update({k: text for k, text in frame.metadata.items() if k.startswith(f"{group}/")})
    return found
