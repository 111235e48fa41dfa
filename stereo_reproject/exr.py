"""OpenEXR in and out: what Blender writes after a render, and the files that a stereo pair is delivered in."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .errors import BadInputError
from .passes import COLOUR_PASS, DEPTH_PASS, Passes

CHANNEL_LETTERS = ("RGBA", "XYZW", "UVA", "rgba")
"""The letters of Blender's channels, each set in the order in which it stands in an array."""

VIEWS = ("left", "right")

LAYERS_ATTRIBUTE = "stereoReprojectLayers"
"""Of an eye's file: the names of its view layers, the first of which its channels do not carry."""


def _openexr() -> Any:
    """OpenEXR is imported when a file is touched: `import stereo_reproject` needs numpy only."""
    import OpenEXR

    return OpenEXR


def read_render(path: Path, *, layer: str, view: str) -> tuple[Passes, dict[str, str]]:
    """The passes of one view layer and view in a multilayer EXR that Blender wrote, and the file's text attributes.

    Blender 4.5 writes one part with channels Layer.Pass.view.C, 5.2 a part per pass and view with Layer.Pass.C.
    Raises BadInputError when the file is not whole, which is how a full disk shows.
    """
    try:
        parts = _read_parts(path)
    except (OSError, RuntimeError) as error:
        raise BadInputError(f"the render result is not whole: {error}; is the disk full?") from error
    attributes: dict[str, str] = {}
    found: dict[str, dict[str, NDArray]] = {}
    for part in parts:
        attributes.update({k: v for k, v in part.header.items() if isinstance(v, str)})
        if part.header.get("view", view) != view:
            continue
        for name, channel in part.channels.items():
            pass_name, letter = _split_channel(name, layer, view)
            if pass_name is not None:
                found.setdefault(pass_name, {})[letter] = channel.pixels
    for name in (COLOUR_PASS, DEPTH_PASS):
        if name not in found:
            raise BadInputError(f"the render result has no {name} pass for view {view}; is the disk full?")
    return {name: _stack(channels) for name, channels in found.items()}, attributes


def _read_parts(path: Path) -> list[Any]:
    """The parts of a file, with their pixels. Raises RuntimeError when the file was cut off.

    OpenEXR itself only leaves the parts without channels that it cannot read.
    """
    parts = _openexr().File(str(path), separate_channels=True).parts
    if not parts or not all(part.channels for part in parts):
        raise RuntimeError(f"{path.name} is cut off")
    return parts


def _split_channel(name: str, layer: str, view: str) -> tuple[str | None, str]:
    if not name.startswith(layer + "."):
        return None, ""
    pass_name, _, letter = name[len(layer) + 1 :].rpartition(".")
    bare, _, suffix = pass_name.rpartition(".")
    if suffix not in VIEWS:
        return pass_name, letter
    return (bare, letter) if suffix == view else (None, letter)


def _stack(channels: Mapping[str, NDArray]) -> NDArray[np.float32]:
    known = (order for order in CHANNEL_LETTERS if set(channels) <= set(order))
    letters = sorted(channels, key=next(known, "".join(sorted(channels))).index)
    return np.stack([np.asarray(channels[c], np.float32) for c in letters], axis=-1)


def write_table(path: Path, values: NDArray[np.float32]) -> None:
    """(H, W, 4) float32 as plain uncompressed RGBA, for a shader to look numbers up in."""
    channels = {letter: np.ascontiguousarray(values[..., k]) for k, letter in enumerate("RGBA")}
    _write(path, channels, {"compression": _openexr().NO_COMPRESSION})


def write_eye(path: Path, layers: Mapping[str, Passes], *, view: str) -> None:
    """One eye, every pass: colour as R, G, B, A and the others as Pass.C, 32 bit float, scene-linear.

    layers are the passes by view layer; the channels of all but the first begin with the layer's name.
    """
    layers = _by_layer(layers)
    header = {"compression": _openexr().ZIP_COMPRESSION, "view": view, LAYERS_ATTRIBUTE: json.dumps(list(layers))}
    _write(path, _layer_channels(layers), header)


def read_eye(path: Path) -> dict[str, Passes]:
    """The passes, by view layer, of a file that `write_eye` wrote. Raises BadInputError when it is not whole."""
    try:
        (part,) = _read_parts(path)
        first, *others = json.loads(part.header[LAYERS_ATTRIBUTE])
    except (OSError, RuntimeError, ValueError, KeyError) as error:
        raise BadInputError(f"{path.name} is not whole: {error}") from error
    found: dict[str, dict[str, dict[str, NDArray]]] = {first: {}, **{name: {} for name in others}}
    for name, channel in part.channels.items():
        layer = next((one for one in others if name.startswith(f"{one}.")), first)
        pass_name, _, letter = (name if layer == first else name[len(layer) + 1 :]).rpartition(".")
        found[layer].setdefault(pass_name or COLOUR_PASS, {})[letter] = channel.pixels
    return {layer: {name: _stack(channels) for name, channels in passes.items()} for layer, passes in found.items()}


def write_stereo(path: Path, eyes: Mapping[str, Mapping[str, Passes]]) -> None:
    """Both eyes in one multi-view EXR: the first is the default view, whose R, G, B and A carry no view name.

    Naming after OpenEXR, "Storing multi-view images": the view is the last part but one of a channel's name, in the
    default view too where the channel belongs to a layer.
    """
    views = list(eyes)
    channels = {}
    for view in views:
        channels.update(_layer_channels(_by_layer(eyes[view]), view, default=view == views[0]))
    _write(path, channels, {"compression": _openexr().ZIP_COMPRESSION, "multiView": views})


def _by_layer(layers: Mapping[str, Any]) -> Mapping[str, Passes]:
    """Passes by view layer; those of a single one may come as they are."""
    return layers if all(isinstance(passes, Mapping) for passes in layers.values()) else {"": dict(layers)}


def _layer_channels(layers: Mapping[str, Passes], view: str = "", *, default: bool = False) -> dict[str, NDArray]:
    main = next(iter(layers))
    result = _channels(layers[main], view, default=default)
    for layer, passes in layers.items():
        if layer != main:
            named = {f"{layer}.{name}": image for name, image in passes.items()}
            result.update(_channels(named, view, default=default))
    return result


def _channels(passes: Passes, view: str = "", *, default: bool = False) -> dict[str, NDArray]:
    result = {}
    for name, image in passes.items():
        for k, letter in enumerate(pass_letters(name.rpartition(".")[2], image.shape[2])):
            parts = [] if name == COLOUR_PASS else [name]
            parts += [view] if view and not (default and name == COLOUR_PASS) else []
            result[".".join([*parts, letter])] = np.ascontiguousarray(image[..., k], np.float32)
    return result


def pass_letters(name: str, channels: int) -> str:
    """A letter for each channel of a pass, as Blender names them."""
    if channels == 1:
        return "Z" if name == DEPTH_PASS else "V"
    vector = name.startswith(("Normal", "Position", "Vector", "Denoising Normal"))
    order = "XYZW" if vector else "UVA" if name == "UV" else "rgba" if name.startswith("Crypto") else "RGBA"
    return order[:channels]


def _write(path: Path, channels: Mapping[str, NDArray], header: Mapping[str, Any]) -> None:
    openexr = _openexr()
    try:
        with openexr.File({"type": openexr.scanlineimage, **header}, dict(channels)) as file:
            file.write(str(path))
        # A full disk may take the last of it away without a word.
        _read_parts(path)
    except (OSError, RuntimeError) as error:
        raise BadInputError(f"cannot write {path.name}: {error}; is the disk full?") from error
