"""Frames made of stored renders, by the pipeline's own way: a frame then costs no render.

Of a scene the source is rendered once and the target RENDERS times with other seeds, with all passes that traced pixels
have. A `StoredRenderer` hands the source out, and traces pixels by looking them up in two of the target's renders; the
other two are left to judge the frame by. It denoises as the scene does, and each picture once.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stereo_reproject.images.denoising import Denoise, Denoising
from stereo_reproject.images.passes import COLOUR_PASS, Passes
from stereo_reproject.settings.frame import StereoSettings
from stereo_reproject.trace.fill import SourceCost
from stereo_reproject.trace.requests import TraceRequest
from tests.bench.coverage import REFERENCE_SEED

COST = SourceCost(seconds=60.0, sync_seconds=1.0)
"""Cost of the source by which the fill is chosen: by its own time, so small a picture would often be rendered whole."""

SOURCE_SEED = 1

RENDERS = 4
"""Of the target: two to trace from and two to judge by."""

SOURCE = "source "
TARGET = "target "
"""What the names of arrays in a file begin with; a target's number follows."""


@dataclass(frozen=True)
class StoredRenders:
    """Passes (H, W, C) of the source, and of each render of the target, as the renderer gives them: not denoised."""

    source: Passes
    targets: Sequence[Passes]

    def save(self, path: Path) -> None:
        # Written whole under another name first: a run that was interrupted leaves no half file.
        path.parent.mkdir(parents=True, exist_ok=True)
        part = path.with_suffix(".part.npz")
        named = {f"{TARGET}{n} {name}": image for n, of in enumerate(self.targets) for name, image in of.items()}
        np.savez(part, **{f"{SOURCE}{name}": image for name, image in self.source.items()}, **named)
        part.replace(path)

    @classmethod
    def load(cls, path: Path) -> StoredRenders:
        with np.load(path) as stored:

            def beginning(start: str) -> Passes:
                return {name.removeprefix(start): stored[name] for name in stored.files if name.startswith(start)}

            return cls(beginning(SOURCE), [beginning(f"{TARGET}{number} ") for number in range(RENDERS)])

    @classmethod
    def of_scene(cls, working: Any, folder: Path, kept: Path | None = None) -> StoredRenders:
        """The renders of a working scene, read from the file `kept` if it is there, else made and kept there."""
        from stereo_reproject.blender.engines.renderer import BlenderRenderer

        if kept is not None and kept.exists():
            return cls.load(kept)
        settings = StereoSettings()
        working.cycles.seed = SOURCE_SEED
        source = BlenderRenderer(working, folder).render_source(settings.source)[0]
        targets = [_whole(working, folder, settings.target, REFERENCE_SEED + number) for number in range(RENDERS)]
        renders = cls(source, targets)
        if kept is not None:
            renders.save(kept)
        return renders


def _whole(working: Any, folder: Path, view: str, seed: int) -> Passes:
    """The passes (H, W, C) of a whole render of a view, as they are traced."""
    from stereo_reproject.blender.engines.renderer import BlenderRenderer

    working.cycles.seed = seed
    renderer = BlenderRenderer(working, folder)
    renderer.expect_probes(probed=True)
    camera = renderer.cameras[view]
    pixels = np.ones((camera.height, camera.width), bool)
    [passes] = renderer.trace("full", [TraceRequest(view, pixels)])
    return {name: image.reshape(*pixels.shape, -1) for name, image in passes.items()}


class StoredRenderers:
    """Renderers of a working scene whose pictures are stored, one for each place of the probes."""

    def __init__(self, working: Any, folder: Path, renders: StoredRenders) -> None:
        self._working, self._folder, self._renders = working, folder, renders
        self._denoised: dict[bytes, list[NDArray[np.float32]]] = {}

    def at(self, place: int) -> Any:
        """A renderer that places the probes by this number, which also says which two renders its traces come from."""
        from stereo_reproject.blender.commands.price_list_renderers import RenderedSource, SharedSourceRenderer

        once, again, *_ = self._shifted(place)

        class StoredRenderer(SharedSourceRenderer):
            def trace(self, _method: str, requests: Sequence[TraceRequest]) -> list[Passes]:
                return [looked_up(request, once, again) for request in requests]

        self._working.cycles.seed = place
        source = RenderedSource(StereoSettings().source, self._renders.source, COST, COST.seconds)
        renderer = StoredRenderer(self._working, self._folder, source)
        if renderer.denoise is not None:
            renderer.denoise = self._remembering(renderer.denoise)
        return renderer

    def judges(self, place: int) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """The colours (H, W, 4) of the two renders that no trace at this place comes from, denoised if the scene is."""
        denoise = self.at(place).denoise
        _, _, *judges = self._shifted(place)
        if denoise is None:
            first, second = (passes[COLOUR_PASS] for passes in judges)
        else:
            first, second = (Denoising(denoise).denoised_colour(passes) for passes in judges)
        return first, second

    def _shifted(self, place: int) -> list[Passes]:
        targets = self._renders.targets
        return [targets[(place + number) % RENDERS] for number in range(RENDERS)]

    def _remembering(self, denoise: Denoise) -> Denoise:
        """The denoiser, which denoises no picture again that it has seen."""

        def remembered(pictures: Sequence[Passes]) -> list[NDArray[np.float32]]:
            key = hashlib.sha256()
            for image in (image for picture in pictures for image in picture.values()):
                key.update(np.ascontiguousarray(image).data)
            found = key.digest()
            if found not in self._denoised:
                self._denoised[found] = denoise(pictures)
            return [picture.copy() for picture in self._denoised[found]]

        return remembered


def looked_up(request: TraceRequest, once: Passes, again: Passes) -> Passes:
    """The passes (N, C) of a request, looked up in two renders (H, W, C): twins come from the second one."""
    twins = [] if request.twice is None else [(again, request.twice)]
    parts = [{name: image[mask] for name, image in of.items()} for of, mask in [(once, request.pixels), *twins]]
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
