"""A view of the scene, and the views that belong together: a stereo pair is two of them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from .camera import Camera
from .motion import Moving, standing_still


@dataclass(frozen=True)
class View:
    """A camera with a name, such as "left", and its motion between frames.

    motion is None where no pass asks for it; the camera then counts as standing still.
    """

    name: str
    camera: Camera
    motion: Moving | None = None

    @property
    def moving(self) -> Moving:
        """The motion: `motion`, or that of a camera that stands still where it is None."""
        return self.motion or standing_still(self.camera)


@dataclass(frozen=True)
class Rig:
    """Views of one scene at one moment, in order. Raises ValueError where two of them have the same name."""

    views: tuple[View, ...]

    def __post_init__(self) -> None:
        if len(set(self.names)) < len(self.views):
            raise ValueError(f"two views have the same name: {', '.join(self.names)}")

    @classmethod
    def of_cameras(cls, cameras: Mapping[str, Camera], motion: Mapping[str, Moving] | None = None) -> Rig:
        """Return the rig of these cameras, which are given by view name. motion has all of these names, or is None."""
        views = (View(name, camera, motion.get(name) if motion else None) for name, camera in cameras.items())
        return cls(tuple(views))

    @property
    def names(self) -> tuple[str, ...]:
        """The views' names, in order."""
        return tuple(view.name for view in self.views)

    def __iter__(self) -> Iterator[View]:
        return iter(self.views)

    def __len__(self) -> int:
        return len(self.views)

    def __getitem__(self, name: str) -> View:
        """Return the view of this name. Raises KeyError where there is none."""
        for view in self.views:
            if view.name == name:
                return view
        raise KeyError(name)
