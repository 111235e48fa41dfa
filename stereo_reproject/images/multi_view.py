"""One multi-view OpenEXR of all views, made of the files of the views, of which one at a time is held."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from .exr import MAIN_LAYER_ATTRIBUTE, read_channels, read_header, read_metadata
from .exr_stream import StreamedPart, streamed_exr
from .passes import COLOUR_PASS


def write_multi_view(path: Path, files: Mapping[str, Path]) -> None:
    """Write one file of all views, by view name; `files` are those that `write_eye` made of them, each with one view
    layer.

    Parts and channels are those of `write_stereo`: as Blender 5.2 names them, the first view's colour first. Raises
    BadInputError where a file is not whole, or writing fails.
    """
    headers = {view: read_header(file) for view, file in files.items()}
    first = next(iter(headers.values()))
    layer, window = str(first[MAIN_LAYER_ATTRIBUTE]), first["dataWindow"]
    width, height = (int(high - low) + 1 for low, high in zip(*window, strict=True))
    of_views = {view: _channels_by_pass(header["channels"], layer) for view, header in headers.items()}
    names = dict.fromkeys(name for passes in of_views.values() for name in passes)
    texts = read_metadata(next(iter(files.values())))
    parts: list[StreamedPart] = []
    numbers: dict[tuple[str, str], int] = {}
    # The colour comes first: it is what a program shows that knows no layers.
    for name in sorted(names, key=lambda name: name != COLOUR_PASS):
        for view, passes in of_views.items():
            if name in passes:
                numbers[view, name] = len(parts)
                channels = list(passes[name].values())
                # Readers look for the texts in the first part.
                parts.append(StreamedPart(channels, f"{layer}.{name}-{view}", view, {} if parts else texts))
    with streamed_exr(path, parts, (width, height), np.float32) as stream:
        for view, file in files.items():
            pixels = read_channels(file)
            for name, channels in of_views[view].items():
                stream.write({full: pixels[own] for own, full in channels.items()}, numbers[view, name])


def _channels_by_pass(channels: Mapping[str, object], layer: str) -> dict[str, dict[str, str]]:
    """Return for each pass of a view's file its channels: by the name in that file, the name in the one of all views.
    The colour of the layer has bare letters in both."""
    found: dict[str, dict[str, str]] = {}
    for channel in channels:
        name, _, letter = channel.rpartition(".")
        found.setdefault(name or COLOUR_PASS, {})[channel] = f"{layer}.{name}.{letter}" if name else letter
    return found
