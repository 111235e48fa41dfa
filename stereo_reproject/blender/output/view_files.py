"""Views that lie in files, read one by one."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...images.exr import read_channels


class ViewFiles(Sequence):
    """The colour of views, (H, W, 4) each, read from their files in a folder when it is asked for."""

    def __init__(self, folder: Path, names: Sequence[str]) -> None:
        self._paths = [folder / f"{name}.exr" for name in names]

    def __len__(self) -> int:
        return len(self._paths)

    def __getitem__(self, index: int) -> NDArray[np.float32]:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Return the colour of one view; slices are not asked for."""
        channels = read_channels(self._paths[index])
        return np.stack([channels[letter] for letter in "RGBA"], axis=-1).astype(np.float32)
