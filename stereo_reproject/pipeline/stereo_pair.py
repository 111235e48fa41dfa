"""The stereo pair of a frame with all its view layers, each of which is a stereo frame of its own."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from ..images.exr import CRYPTOMATTE_ATTRIBUTE_PREFIX
from ..images.passes import Passes
from .stereo_frame import StereoFrame


@dataclass(frozen=True)
class StereoPair:
    """Finished stereo pair of a scene, or its one view: a stereo frame for each of its view layers, by name, in the
    scene's order.

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
        """Passes of each eye, by view, then by view layer, then by pass name."""
        views = self.main_frame.eyes
        return {view: {layer: frame.eyes[view] for layer, frame in self.frames.items()} for view in views}

    @property
    def metadata(self) -> dict[str, str]:
        """Texts of Blender's renders, of all layers, that say which name each hash of the eyes' cryptomattes stands
        for."""
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
        """Speed-up over Blender's multiview, or over a plain render of one view: its predicted seconds over the seconds
        that this pair took; above 1 is faster.

        Multiview renders the source of each layer as we do, and then the other eye without another sync. A plain
        animation of one view can keep what is synced (persistent data).
        """
        costs, views = [frame.source_cost for frame in self.frames.values()], len(self.main_frame.eyes)
        syncs = sum(cost.seconds - cost.per_frame for cost in costs) if views > 1 else 0.0
        plain = syncs + views * sum(cost.per_frame + cost.denoise_seconds for cost in costs)
        return plain / self.seconds["total"]

    @property
    def invalid_pixels(self) -> dict[str, int]:
        """Number of invalid pixels, which had NaN or infinities, by view, over all layers."""
        frames = self.frames.values()
        return {view: sum(frame.invalid_pixels[view] for frame in frames) for view in self.main_frame.invalid_pixels}


def _cryptomattes(frame: StereoFrame) -> dict[str, str]:
    """Return those texts of a frame's metadata that are about cryptomattes in its passes, which users get.

    Texts about one that only this extension has asked for are left out.
    """
    passes = next(iter(frame.eyes.values()))
    found: dict[str, str] = {}
    for key, name in frame.metadata.items():
        group = key.removesuffix("/name")
        if key.startswith(CRYPTOMATTE_ATTRIBUTE_PREFIX) and group != key and f"{name.rpartition('.')[2]}00" in passes:
            found.update({k: text for k, text in frame.metadata.items() if k.startswith(f"{group}/")})
    return found
