"""OpenEXR in and out: what Blender writes after a render, and the files that a stereo pair is delivered in."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import BadInputError
from .passes import COLOUR_PASS, DEPTH_PASS, Passes, as_blender_has_it, cryptomatte_of, from_blender, pass_letters

CHANNEL_LETTERS = ("RGBA", "XYZW", "UVA", "rgba")
"""The letters of Blender's channels, each set in the order in which it stands in an array."""

VIEWS = ("left", "right")

MAIN_LAYER = "mainLayer"
"""Attribute of an eye's file: the view layer whose channels have no layer before their names."""

CRYPTOMATTE_KEY = "cryptomatte/"
"""How the names of the attributes begin that say which hash is whose (Psyop, "Cryptomatte specification" 1.2)."""

NOTHING: Mapping[str, str] = MappingProxyType({})


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
    return {name: from_blender(name, _stack(channels)) for name, channels in found.items()}, attributes


def read_colours(path: Path, *, main: str) -> dict[str, NDArray[np.float32]]:
    """What a file of Blender's that holds both views shows, (H, W, 4) by view: its composite, or else its only layer,
    or that called `main`; nothing where it does not hold views. Raises BadInputError when the file is not whole or has
    no such picture."""
    try:
        parts = _read_parts(path)
    except (OSError, RuntimeError) as error:
        raise BadInputError(f"{path} is not whole: {error}") from error
    found: dict[str, dict[str, dict[str, NDArray]]] = {view: {} for view in VIEWS}
    for part in parts:
        # Blender 4.5 has both views in one part, the first of them without its name.
        unnamed = part.header.get("view") or next(iter(part.header.get("multiView") or ()), None)
        for name, channel in part.channels.items():
            *names, letter = name.split(".")
            view = next((part_name for part_name in names if part_name in VIEWS), unnamed)
            prefix = ".".join(part_name for part_name in names if part_name not in VIEWS)
            if view in VIEWS and letter in "RGBA":
                found[view].setdefault(prefix, {})[letter] = channel.pixels
    if not any(found.values()):
        return {}
    wanted = (f"Composite.{COLOUR_PASS}", "", f"{main}.{COLOUR_PASS}")
    result = {}
    for view, pictures in found.items():
        prefix = next((prefix for prefix in wanted if prefix in pictures), None)
        if prefix is None:
            raise BadInputError(f"{path} holds no picture of the {view} eye")
        stacked = _stack({"A": np.ones_like(pictures[prefix]["R"]), **pictures[prefix]})
        result[view] = from_blender(COLOUR_PASS, stacked)
    return result


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
        raise BadInputError(f"{path.name} is not whole: {error}; is the disk full?") from error
    return {name: np.asarray(channel.pixels, np.float32) for name, channel in part.channels.items()}


def write_eye(
    path: Path,
    layers: Mapping[str, Passes],
    *,
    view: str,
    metadata: Mapping[str, str] = NOTHING,
    compressed: bool = True,
) -> None:
    """One eye in one part, every view layer and pass, 32 bit float, scene-linear; the first layer is the main one.

    Its colour is R, G, B, A and its other passes are Pass.C; those of the other layers are Layer.Pass.C. metadata are
    the texts of Blender's renders, of which those that say what the cryptomattes hold are kept.
    """
    main = next(iter(layers))
    channels: dict[str, NDArray] = {}
    for layer, passes in layers.items():
        for name, image in passes.items():
            prefix = _joined("" if layer == main else layer, "" if (layer, name) == (main, COLOUR_PASS) else name)
            channels.update(_channels(name, image, prefix))
    texts = _cryptomattes(metadata, layers, {layer: "" if layer == main else layer for layer in layers})
    compression = _openexr().ZIP_COMPRESSION if compressed else _openexr().NO_COMPRESSION
    header = {"compression": compression, "view": view, MAIN_LAYER: main, **texts}
    _write(path, channels, header)


def read_eye(path: Path) -> dict[str, Passes]:
    """The passes of a file that `write_eye` wrote, by view layer, the main one first. Raises BadInputError when it is
    not whole."""
    try:
        (part,) = _read_parts(path)
    except (OSError, RuntimeError, ValueError) as error:
        raise BadInputError(f"{path.name} is not whole: {error}") from error
    main = part.header.get(MAIN_LAYER, "")
    found: dict[str, dict[str, dict[str, NDArray]]] = {main: {}}
    for channel_name, channel in part.channels.items():
        prefix, _, letter = channel_name.rpartition(".")
        # A layer's name may have dots, a pass's may not.
        layer, _, name = prefix.rpartition(".")
        found.setdefault(layer or main, {}).setdefault(name or COLOUR_PASS, {})[letter] = channel.pixels
    return {
        layer: {name: from_blender(name, _stack(letters)) for name, letters in passes.items()}
        for layer, passes in found.items()
    }


def read_metadata(path: Path) -> dict[str, str]:
    """The texts about cryptomattes of a file that `write_eye` wrote, as Blender has them: each names a view layer."""
    header = _openexr().File(str(path), header_only=True).header()
    main = header.get(MAIN_LAYER, "")
    texts = {key: text for key, text in header.items() if key.startswith(CRYPTOMATTE_KEY) and isinstance(text, str)}
    bare = {key for key, text in texts.items() if key.endswith("/name") and "." not in text}
    return {key: f"{main}.{text}" if key in bare else text for key, text in texts.items()}


def write_stereo(
    path: Path, eyes: Mapping[str, Mapping[str, Passes]], *, metadata: Mapping[str, str] = NOTHING
) -> None:
    """All views, by view name, with all their layers, in one file: a part for each layer, pass and view.

    Parts and channels are named as Blender 5.2 does it, Layer.Pass-view and Layer.Pass.C, with one exception: the
    first layer's colour is R, G, B, A, which is what a program shows that knows no layers. It is the first part, and
    Blender puts the part's name before such channels. metadata is as for `write_eye`.
    """
    openexr = _openexr()
    first = next(iter(eyes.values()))
    layers = list(dict.fromkeys(layer for view in eyes.values() for layer in view))
    texts = _cryptomattes(metadata, first, {layer: layer for layer in layers})
    parts = []
    for layer in layers:
        names = dict.fromkeys(name for view in eyes.values() for name in view.get(layer, {}))
        # Else a program that knows no layers would find something else first.
        for name in sorted(names, key=lambda name: name != COLOUR_PASS):
            full = _joined(layer, name)
            prefix = "" if (layer, name) == (layers[0], COLOUR_PASS) else full
            for view, passes in ((view, of_view[layer]) for view, of_view in eyes.items() if layer in of_view):
                if name in passes:
                    header = {"compression": openexr.ZIP_COMPRESSION, "name": f"{full}-{view}", "view": view}
                    # Readers look for them in the first part.
                    header |= {} if parts else texts
                    header["type"] = openexr.scanlineimage
                    parts.append(openexr.Part(header, _channels(name, passes[name], prefix)))
    _write_file(path, lambda: openexr.File(parts))


def _joined(*names: str) -> str:
    return ".".join(name for name in names if name)


def _channels(name: str, image: NDArray, prefix: str) -> dict[str, NDArray]:
    letters, image = pass_letters(name, image.shape[2]), as_blender_has_it(name, image)
    return {_joined(prefix, c): np.ascontiguousarray(image[..., k], np.float32) for k, c in enumerate(letters)}


def _cryptomattes(
    metadata: Mapping[str, str], layers: Mapping[str, Passes], prefixes: Mapping[str, str]
) -> dict[str, str]:
    """The texts about those cryptomattes that the layers have; named after the layers' `prefixes` instead."""
    known = {
        f"{layer}.{matte}": _joined(prefixes[layer], matte)
        for layer, passes in layers.items()
        for matte in filter(None, map(cryptomatte_of, passes))
    }
    result: dict[str, str] = {}
    for key, value in metadata.items():
        group = key.removesuffix("/name")
        if key.startswith(CRYPTOMATTE_KEY) and group != key and value in known:
            result |= {k: text for k, text in metadata.items() if k.startswith(f"{group}/")}
            result[key] = known[value]
    return result


def _write(path: Path, channels: Mapping[str, NDArray], header: Mapping[str, Any]) -> None:
    openexr = _openexr()
    _write_file(path, lambda: openexr.File({"type": openexr.scanlineimage, **header}, dict(channels)))


def _write_file(path: Path, make: Callable[[], Any]) -> None:
    try:
        with make() as file:
            file.write(str(path))
        # A full disk may take the last of it away without a word.
        _read_parts(path)
    except (OSError, RuntimeError) as error:
        raise BadInputError(f"cannot write {path.name}: {error}; is the disk full?") from error
