"""Libraries and files that a .blend refers to and that are not there: Blender renders on without a word."""

from __future__ import annotations

import contextlib
import os
from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path

import bpy

from .file_digest import numbered_like
from .fingerprint_files import BUILTIN, TILE
from .instancing import brought_along
from .working import is_kept

UNRENDERED_USERS = (
    bpy.types.Brush,
    bpy.types.Camera,
    bpy.types.MovieClip,
    bpy.types.Screen,
    bpy.types.WindowManager,
    bpy.types.WorkSpace,
)
"""Datablocks that show a picture in a window only: a camera has them for backgrounds, as an empty has a reference."""

NODES_WITH_FILES = ("ShaderNodeTexIES", "ShaderNodeScript")

Kind = tuple[str, str]
"""The word for one datablock of a kind, and for several."""

Block = bpy.types.Image | bpy.types.VectorFont | bpy.types.Sound | bpy.types.CacheFile | bpy.types.Volume


def missing_libraries() -> list[str]:
    """Return a line for each library of which something is missing, also for libraries that other libraries link.
    Blender keeps a placeholder for each datablock that it does not find; for an object that is an empty.
    """
    lacking: dict[bpy.types.Library, list[tuple[Kind, str]]] = {}
    for prop in bpy.data.bl_rna.properties:
        # From 5.2 on all datablocks are in a list of their own, too.
        if prop.type == "COLLECTION" and prop.identifier not in ("all_ids", "libraries"):
            kind = (prop.fixed_type.name.lower(), prop.identifier.replace("_", " "))
            for block in getattr(bpy.data, prop.identifier):
                if block.is_missing and block.library is not None:
                    lacking.setdefault(block.library, []).append((kind, block.name))
    return sorted(_library_line(library, blocks) for library, blocks in lacking.items())


def _library_line(library: bpy.types.Library, blocks: list[tuple[Kind, str]]) -> str:
    """Return the line about a library that lacks these datablocks, given by kind and name."""
    path = _absolute(library.filepath, None)
    counts = Counter(kind for kind, _ in blocks)
    seen_first = sorted(counts, key=lambda kind: (*(kind[1] != name for name in ("objects", "collections")), kind))
    left_out = " and ".join(_number_of(kind, counts[kind]) for kind in seen_first)
    by = "" if library.parent is None else f", linked by {_absolute(library.parent.filepath, None)},"
    example = next(name for kind, name in blocks if kind == seen_first[0])
    wrong = _what_is_wrong(library, path)
    remedy = "put it there, or relocate it in the Outliner's Blender File view"
    return f"library {path}{by} {wrong}, which leaves out {left_out}, such as {example!r}: {remedy}"


def _number_of(kind: Kind, number: int) -> str:
    """Return words such as "2 objects"."""
    one, several = kind
    # How many objects these held is known to none but the library.
    content = " of objects" if several == "collections" else ""
    return f"{number} {one if number == 1 else several}{content}"


def _what_is_wrong(library: bpy.types.Library, path: Path) -> str:
    """Return the verb part of the line about a library: why its datablocks are missing."""
    if not library.is_missing:
        return "lacks what is linked from it"
    if path.is_dir():
        return "is a folder"
    return "cannot be read" if path.exists() else "is missing"


def missing_files(scene: bpy.types.Scene) -> list[str]:
    """Return a line for each kind of file (images, fonts, caches and so on) that the scene uses and that is missing; an
    empty list if all are there.
    """
    found = {
        "image file": _rendered(image for image in _used(bpy.data.images) if _lacks_picture(image)),
        "font": [font.name for font in _used(bpy.data.fonts) if _lacks_file(font)],
        "sound": [sound.name for sound in _used(bpy.data.sounds) if _lacks_file(sound)],
        "cache file": [
            *(cache.name for cache in _used(bpy.data.cache_files) if _lacks_file(cache)),
            *_without_mesh_cache(scene),
        ],
        "volume": [volume.name for volume in _used(bpy.data.volumes) if _lacks_file(volume)],
        "file of a node": list(_nodes_without_file()),
    }
    return [_file_line(kind, names) for kind, names in found.items() if names]


def _file_line(kind: str, names: list[str]) -> str:
    """Return the line about missing files of this kind; names are those of the datablocks that use them."""
    more = f" and {len(names) - 1} more" if len(names) > 1 else ""
    return f"{kind} missing for {names[0]!r}{more}: find it with File > External Data > Find Missing Files"


def _used(blocks: Iterable[Block]) -> Iterator[Block]:
    """Return the user's datablocks that have users and were found."""
    return (block for block in blocks if block.users and not block.is_missing and not is_kept(block))


def _rendered(images: Iterable[bpy.types.Image]) -> list[str]:
    """Return the names of those of the images that are used by more than what windows show."""
    missing = list(images)
    if not missing:
        return []
    users = bpy.data.user_map(subset=missing)
    return [image.name for image in missing if any(map(_is_rendered, users[image]))]


def _is_rendered(user: bpy.types.ID) -> bool:
    """Return whether a datablock that uses an image may show it in a render."""
    empty = isinstance(user, bpy.types.Object) and user.type == "EMPTY"
    return not empty and not isinstance(user, UNRENDERED_USERS)


def _lacks_picture(image: bpy.types.Image) -> bool:
    """Return whether the image's file, or a tile of it, is missing."""
    if image.source not in ("FILE", "SEQUENCE", "MOVIE", "TILED") or image.packed_files:
        return False
    if image.source != "TILED":
        return _lacks_file(image)
    path = _absolute(image.filepath, image.library)
    tiles = (path.with_name(TILE.sub(str(tile.number), path.name)) for tile in image.tiles)
    return bool(image.filepath) and not all(map(_is_file, tiles))


def _lacks_file(block: Block) -> bool:
    """Return whether the file of a datablock is missing; of a sequence, whether all of its files are."""
    if not block.filepath or block.filepath == BUILTIN or getattr(block, "packed_file", None):
        return False
    path = _absolute(block.filepath, block.library)
    if _is_file(path):
        return False
    in_sequence = getattr(block, "is_sequence", False) or getattr(block, "source", "") == "SEQUENCE"
    return not (in_sequence and numbered_like(path))


def _without_mesh_cache(scene: bpy.types.Scene) -> Iterator[str]:
    """Yield the names of the scene's objects with a Mesh Cache modifier whose file is missing."""
    for item in brought_along(scene.objects):
        for modifier in item.modifiers:
            rendered = modifier.type == "MESH_CACHE" and modifier.show_render and modifier.filepath
            if rendered and not _is_file(_absolute(modifier.filepath, item.library)):
                yield item.name


def _nodes_without_file() -> Iterator[str]:
    """Yield the names of shader nodes whose external file is missing."""
    owners = [*bpy.data.materials, *bpy.data.worlds, *bpy.data.lights]
    trees = [owner.node_tree for owner in owners if owner.users and owner.node_tree is not None]
    for tree in [*trees, *(group for group in bpy.data.node_groups if group.users)]:
        for node in tree.nodes:
            in_file = node.bl_idname in NODES_WITH_FILES and node.mode == "EXTERNAL" and node.filepath
            if in_file and not _is_file(_absolute(node.filepath, tree.library)):
                yield node.name


def _is_file(path: Path) -> bool:
    """Return whether there is a file of this path; False also for a path that the drive refuses."""
    with contextlib.suppress(OSError):
        return path.is_file()
    return False


def _absolute(path: str, library: bpy.types.Library | None) -> Path:
    """Return a path, as a datablock of this library has it (None: of the open file), as an absolute one."""
    return Path(os.path.abspath(bpy.path.abspath(path, library=library)))  # noqa: PTH100 - links stay
