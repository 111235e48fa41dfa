"""OpenEXR in and out: what Blender writes after a render, and the files that a stereo pair is delivered in."""

from __future__ import annotations

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


def write_channels(path: Path, channels: Mapping[str, NDArray], attributes: Mapping[str, str]) -> None:
    """(H, W) float32 by channel name, in one uncompressed part, with these texts in its header."""
    _write(path, channels, {"compression": _openexr().NO_COMPRESSION, **attributes})


def read_channels(path: Path) -> dict[str, NDArray[np.float32]]:
    """Every channel (H, W) of a file of one part, by name. Raises BadInputError when it is not whole."""
    try:
        (part,) = _read_parts(path)
    except (OSError, RuntimeError, ValueError) as error:
        raise BadInputError(f"{path.name} is not whole: {error}") from error
    return {name: np.asarray(channel.pixels, np.float32) for name, channel in part.channels.items()}


def write_eye(path: Path, passes: Passes, *, view: str) -> None:
    """One eye, every pass: colour as R, G, B, A and the others as Pass.C, 32 bit float, scene-linear."""
    _write(path, _channels(passes), {"compression": _openexr().ZIP_COMPRESSION, "view": view})


def read_eye(path: Path) -> Passes:
    """The passes of a file that `write_eye` wrote. Raises BadInputError when it is not whole."""
    try:
        (part,) = _read_parts(path)
    except (OSError, RuntimeError, ValueError) as error:
        raise BadInputError(f"{path.name} is not whole: {error}") from error
    found: dict[str, dict[str, NDArray]] = {}
    for name, channel in part.channels.items():
        pass_name, _, letter = name.rpartition(".")
        found.setdefault(pass_name or COLOUR_PASS, {})[letter] = channel.pixels
    return {name: _stack(channels) for name, channels in found.items()}


def write_stereo(path: Path, eyes: Mapping[str, Passes]) -> None:
    """Both eyes in one multi-view EXR: the first is the default view, whose R, G, B and A carry no view name.

    Naming after OpenEXR, "Storing multi-view images": the view is the last part but one of a channel's name, in the
    default view too where the channel belongs to a layer.
    """
    views = list(eyes)
    channels = {}
    for view in views:
        channels.update(_channels(eyes[view], view, default=view == views[0]))
    _write(path, channels, {"compression": _openexr().ZIP_COMPRESSION, "multiView": views})


def _channels(passes: Passes, view: str = "", *, default: bool = False) -> dict[str, NDArray]:
    result = {}
    for name, image in passes.items():
        for k, letter in enumerate(pass_letters(name, image.shape[2])):
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
