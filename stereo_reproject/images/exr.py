"""OpenEXR files, read and written: those of Blender after a render, and those in which a stereo pair is delivered."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import BadInputError
from ..words import Words
from .passes import COLOUR_PASS, DEPTH_PASS, Passes, cryptomatte_of, from_blender, pass_letters, to_blender

CHANNEL_LETTERS = ("RGBA", "XYZW", "UVA", "rgba")
"""Letters of Blender's channels: sets of them, each in the order that its channels have in an array."""

VIEWS = ("left", "right")
"""Names of a stereo pair's views in Blender and in files."""

MAIN_LAYER_ATTRIBUTE = "mainLayer"
"""Name of the attribute, in an eye's file, that has the name of its main view layer: the one whose channels are not
prefixed with a layer."""

CRYPTOMATTE_ATTRIBUTE_PREFIX = "cryptomatte/"
"""Beginning of the names of the attributes that say which name a hash stands for (Psyop, "Cryptomatte specification"
1.2)."""

NO_TEXTS: Mapping[str, str] = MappingProxyType({})
"""Attributes of a file without any, as a default that cannot be changed."""


def _openexr() -> Any:
    """Return the Python module OpenEXR.

    It is imported only when a file is touched, so that `import stereo_reproject` needs NumPy alone.
    """
    import OpenEXR

    return OpenEXR


def read_render(path: Path, *, layer: str, view: str) -> tuple[Passes, dict[str, str]]:
    """Return the passes of one view layer and one view in a multilayer EXR that Blender wrote, and all texts in its
    header.

    The passes are in the code's form: the sky's depth is infinite. Blender 4.5 writes one part with channels
    Layer.Pass.view.C, 5.2 a part per pass and view with Layer.Pass.C. Raises BadInputError when the file is not whole,
    which is how a full disk shows.
    """
    try:
        parts = _read_parts(path)
    except (OSError, RuntimeError) as error:
        raise BadInputError(
            Words("the render result is not whole: {reason}; is the disk full?", reason=str(error))
        ) from error
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
            raise BadInputError(
                Words("the render result has no {name} pass for view {view}; is the disk full?", name=name, view=view)
            )
    return {name: from_blender(name, _stack(channels)) for name, channels in found.items()}, attributes


def read_colours(path: Path, *, main: str) -> dict[str, NDArray[np.float32]]:
    """Return the colours (H, W, 4), by view, of a file that Blender wrote with both views, or with the layers of one,
    which is called ""; an empty dictionary where it has neither views nor layers.

    They are the file's composite, or else its only layer, or else the layer called `main`. Raises BadInputError when
    the file is not whole or has no such picture.
    """
    try:
        parts = _read_parts(path)
    except (OSError, RuntimeError) as error:
        raise BadInputError(Words("{path} is not whole: {reason}", path=path, reason=str(error))) from error
    found: dict[str, dict[str, dict[str, NDArray]]] = {view: {} for view in (*VIEWS, "")}
    for part in parts:
        # Blender 4.5 has both views in one part, the first of them without its name.
        unnamed = part.header.get("view") or next(iter(part.header.get("multiView") or ()), None)
        for name, channel in part.channels.items():
            *names, letter = name.split(".")
            view = next((part_name for part_name in names if part_name in VIEWS), unnamed or "")
            prefix = ".".join(part_name for part_name in names if part_name not in VIEWS)
            if view in found and letter in "RGBA":
                found[view].setdefault(prefix, {})[letter] = channel.pixels
    alone = found.pop("")
    if not any(found.values()):
        if not any(alone):
            return {}
        found = {"": alone}
    wanted = (f"Composite.{COLOUR_PASS}", "", f"{main}.{COLOUR_PASS}")
    result = {}
    for view, pictures in found.items():
        prefix = next((prefix for prefix in wanted if prefix in pictures), None)
        if prefix is None:
            eye = Words(" of the {view} eye", view=Words(view)) if view else ""
            raise BadInputError(Words("{path} holds no picture{eye}", path=path, eye=eye))
        stacked = _stack({"A": np.ones_like(pictures[prefix]["R"]), **pictures[prefix]})
        result[view] = from_blender(COLOUR_PASS, stacked)
    return result


def _read_parts(path: Path) -> list[Any]:
    """Return the parts of an OpenEXR file with their pixels. Raises RuntimeError when the file was cut off.

    OpenEXR itself raises nothing there: parts that it cannot read merely have no channels.
    """
    parts = _openexr().File(str(path), separate_channels=True).parts
    if not parts or not all(part.channels for part in parts):
        raise RuntimeError(f"{path.name} is cut off")
    return parts


def _split_channel(name: str, layer: str, view: str) -> tuple[str | None, str]:
    """Return pass and letter of a channel, by the name that Blender gave it in a multilayer file.

    The pass is None where the channel belongs to another layer than `layer` or another view than `view`.
    """
    if not name.startswith(layer + "."):
        return None, ""
    pass_name, _, letter = name[len(layer) + 1 :].rpartition(".")
    bare, _, suffix = pass_name.rpartition(".")
    if suffix == view:
        return bare, letter
    return (None if suffix in VIEWS else pass_name), letter


def _stack(channels: Mapping[str, NDArray]) -> NDArray[np.float32]:
    """Return a pass (H, W, C) made of its channels (H, W), which are given by letter, in the order of
    CHANNEL_LETTERS."""
    known = (order for order in CHANNEL_LETTERS if set(channels) <= set(order))
    letters = sorted(channels, key=next(known, "".join(sorted(channels))).index)
    return np.stack([np.asarray(channels[c], np.float32) for c in letters], axis=-1)


def write_table(path: Path, values: NDArray[np.float32]) -> None:
    """Write values (H, W, 4) as the R, G, B and A of an uncompressed float32 file, in which a shader looks numbers up.

    Raises BadInputError where that fails.
    """
    channels = {letter: np.ascontiguousarray(values[..., k]) for k, letter in enumerate("RGBA")}
    _write(path, channels, {"compression": _openexr().NO_COMPRESSION})


def write_channels(path: Path, channels: Mapping[str, NDArray], attributes: Mapping[str, str]) -> None:
    """Write channels (H, W), by name, into an uncompressed float32 file of one part, with these texts in its header.

    Raises BadInputError where that fails.
    """
    _write(path, channels, {"compression": _openexr().NO_COMPRESSION, **attributes})


def write_picture(path: Path, colour: NDArray[np.float32]) -> None:
    """Write a colour (H, W, 4), scene-linear, into an uncompressed file of half floats, to be shown and not to be kept:
    values beyond the range of a half are moved to its ends, and 0 stands for what is no number.

    Raises BadInputError where that fails.
    """
    write_halves(path, in_halves(colour), compressed=False)


def in_halves(colour: NDArray[np.float32]) -> NDArray[np.float16]:
    """Return a colour (H, W, C) as half floats: values beyond their range are moved to its ends, and 0 stands for what
    is no number."""
    ends = np.finfo(np.float16)
    return np.clip(np.nan_to_num(colour, posinf=np.inf, neginf=-np.inf), ends.min, ends.max).astype(np.float16)


def write_halves(
    path: Path, colour: NDArray[np.float16], *, compressed: bool = True, texts: Mapping[str, str] = NO_TEXTS
) -> None:
    """Write a colour (H, W, 4) in half floats into a file of one part, with these texts in its header. Raises
    BadInputError where that fails."""
    channels = {letter: np.ascontiguousarray(colour[..., k]) for k, letter in enumerate("RGBA")}
    compression = _openexr().ZIP_COMPRESSION if compressed else _openexr().NO_COMPRESSION
    _write(path, channels, {"compression": compression, **texts})


def read_channels(path: Path) -> dict[str, NDArray[np.float32]]:
    """Return all channels (H, W), by name, of a file of one part. Raises BadInputError when the file is not whole."""
    try:
        (part,) = _read_parts(path)
    except (OSError, RuntimeError, ValueError) as error:
        raise BadInputError(
            Words("{name} is not whole: {reason}; is the disk full?", name=path.name, reason=str(error))
        ) from error
    return {name: np.asarray(channel.pixels, np.float32) for name, channel in part.channels.items()}


def read_header(path: Path) -> dict[str, Any]:
    """Return the header of a file of one part, with its channels by name. Raises BadInputError when it is not whole."""
    try:
        header = _openexr().File(str(path), header_only=True).header()
    except (OSError, RuntimeError) as error:
        raise BadInputError(
            Words("{name} is not whole: {reason}; is the disk full?", name=path.name, reason=str(error))
        ) from error
    return {**header, "channels": {channel.name: channel for channel in header["channels"]}}


def write_eye(
    path: Path,
    layers: Mapping[str, Passes],
    *,
    view: str,
    metadata: Mapping[str, str] = NO_TEXTS,
    compressed: bool = True,
) -> None:
    """Write one eye into a file of one part: every pass of every view layer, in scene-linear float32.

    layers have passes by the layer's name; the first layer is the main one. Its colour becomes the channels R, G, B, A
    and its other passes Pass.C; those of the other layers become Layer.Pass.C, C being a letter. metadata are the texts
    of Blender's renders; those about cryptomattes that the layers have are kept. Raises BadInputError where writing
    fails.
    """
    main = next(iter(layers))
    channels: dict[str, NDArray] = {}
    for layer, passes in layers.items():
        for name, image in passes.items():
            prefix = _joined("" if layer == main else layer, "" if (layer, name) == (main, COLOUR_PASS) else name)
            channels.update(_channels(name, image, prefix))
    texts = _cryptomattes(metadata, layers, {layer: "" if layer == main else layer for layer in layers})
    compression = _openexr().ZIP_COMPRESSION if compressed else _openexr().NO_COMPRESSION
    header = {"compression": compression, "view": view, MAIN_LAYER_ATTRIBUTE: main, **texts}
    _write(path, channels, header)


def read_eye(path: Path) -> dict[str, Passes]:
    """Return the passes of a file that `write_eye` wrote, by view layer and then by name; the main layer comes first.

    Raises BadInputError when the file is not whole.
    """
    try:
        (part,) = _read_parts(path)
    except (OSError, RuntimeError, ValueError) as error:
        raise BadInputError(Words("{name} is not whole: {reason}", name=path.name, reason=str(error))) from error
    main = part.header.get(MAIN_LAYER_ATTRIBUTE, "")
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
    """Return the texts about cryptomattes in a file that `write_eye` wrote, in the form that its `metadata` had.

    `write_eye` leaves the main layer's name out of them; here it is put back.
    """
    header = _openexr().File(str(path), header_only=True).header()
    main = header.get(MAIN_LAYER_ATTRIBUTE, "")
    texts = {
        key: text
        for key, text in header.items()
        if key.startswith(CRYPTOMATTE_ATTRIBUTE_PREFIX) and isinstance(text, str)
    }
    bare = {key for key, text in texts.items() if key.endswith("/name") and "." not in text}
    return {key: f"{main}.{text}" if key in bare else text for key, text in texts.items()}


def write_stereo(
    path: Path, eyes: Mapping[str, Mapping[str, Passes]], *, metadata: Mapping[str, str] = NO_TEXTS
) -> None:
    """Write all views with all their layers into one file: a part for each layer, pass and view.

    eyes has passes by view and then by layer. Parts and channels are named as in Blender 5.2, Layer.Pass-view and
    Layer.Pass.C, with one exception. The first layer's colour is R, G, B, A and the first part, so that programs that
    know no layers show it; Blender reads it by the part's name. metadata is as for `write_eye`. Raises BadInputError
    where writing fails.
    """
    openexr = _openexr()
    first = next(iter(eyes.values()))
    layers = list(dict.fromkeys(layer for view in eyes.values() for layer in view))
    texts = _cryptomattes(metadata, first, {layer: layer for layer in layers})
    parts = []
    for layer in layers:
        names = dict.fromkeys(name for view in eyes.values() for name in view.get(layer, {}))
        # The colour comes first: it is what a program shows that knows no layers.
        for name in sorted(names, key=lambda name: name != COLOUR_PASS):
            full = _joined(layer, name)
            prefix = "" if (layer, name) == (layers[0], COLOUR_PASS) else full
            for view, passes in ((view, of_view[layer]) for view, of_view in eyes.items() if layer in of_view):
                if name in passes:
                    header = {"compression": openexr.ZIP_COMPRESSION, "name": f"{full}-{view}", "view": view}
                    # Readers look for the texts in the first part.
                    header |= {} if parts else texts
                    header["type"] = openexr.scanlineimage
                    parts.append(openexr.Part(header, _channels(name, passes[name], prefix)))
    _write_file(path, lambda: openexr.File(parts))


def _joined(*names: str) -> str:
    """Return the names joined by dots; empty names are left out."""
    return ".".join(name for name in names if name)


def _channels(name: str, image: NDArray, prefix: str) -> dict[str, NDArray]:
    """Return the channels (H, W) of a pass (H, W, C), by the names that they have in a file: `prefix`, a dot and a
    letter."""
    letters, image = pass_letters(name, image.shape[2]), to_blender(name, image)
    return {_joined(prefix, c): np.ascontiguousarray(image[..., k], np.float32) for k, c in enumerate(letters)}


def _cryptomattes(
    metadata: Mapping[str, str], layers: Mapping[str, Passes], prefixes: Mapping[str, str]
) -> dict[str, str]:
    """Return those texts of `metadata` that are about cryptomattes which the layers have.

    In them a cryptomatte is called Layer.Cryptomatte; in the result the layer's name is replaced by the one that
    `prefixes` has for it, or left out where that is empty.
    """
    known = {
        f"{layer}.{matte}": _joined(prefixes[layer], matte)
        for layer, passes in layers.items()
        for matte in filter(None, map(cryptomatte_of, passes))
    }
    result: dict[str, str] = {}
    for key, value in metadata.items():
        group = key.removesuffix("/name")
        if key.startswith(CRYPTOMATTE_ATTRIBUTE_PREFIX) and group != key and value in known:
            result |= {k: text for k, text in metadata.items() if k.startswith(f"{group}/")}
            result[key] = known[value]
    return result


def _write(path: Path, channels: Mapping[str, NDArray], header: Mapping[str, Any]) -> None:
    """Write channels (H, W), by name, into a file of one part with this header. Raises BadInputError where that
    fails."""
    openexr = _openexr()
    _write_file(path, lambda: openexr.File({"type": openexr.scanlineimage, **header}, dict(channels)))


def _write_file(path: Path, make: Callable[[], Any]) -> None:
    """Write the OpenEXR file that `make` builds to `path`. Raises BadInputError where that fails."""
    try:
        # Python's own file: on a full disk OpenEXR's may lack its end without an error.
        with make() as file, path.open("wb") as stream:
            file.write(stream)
    except (OSError, RuntimeError) as error:
        raise BadInputError(
            Words("cannot write {name}: {reason}; is the disk full?", name=path.name, reason=str(error))
        ) from error
