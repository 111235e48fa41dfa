"""A render engine that renders nothing: it hands Blender the finished eyes of the delivery under way."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field

import bpy
import numpy as np

from ...errors import StereoReprojectError, in_one_line
from ...images.passes import COLOUR_PASS, Passes, pass_letters, to_blender

ENGINE = "STEREO_REPROJECT_DELIVERY"

CHANNELS = {"VALUE": 1, "VECTOR": 3, "COLOR": 4}
"""Channels of a pass that is not delivered, by its type."""

Eyes = Mapping[str, Mapping[str, Passes]]
"""Passes by view name and then by view layer, the same layers for both views; the first is the main one."""

EyesAt = Callable[[int], Eyes]
"""The eyes of a frame."""


@dataclass
class DeliveryUnderWay:
    """A delivery that is under way: where its eyes come from, and what Blender has taken of them. The engine finds it
    in `_under_way`, since Blender makes the engine's object itself.

    eyes_at returns the eyes of a frame; metadata are texts for the header of a file; taken has the (view, layer) pairs
    that Blender has; failed is the first error.
    """

    eyes_at: EyesAt
    wired: Mapping[str, Mapping[str, str]]
    """Passes that the compositor uses, with their types, by view layer."""
    metadata: Mapping[str, str]
    taken: set[tuple[str, str]] = field(default_factory=set)
    failed: StereoReprojectError | None = None

    def eyes(self, frame: int) -> Eyes:
        """Return the eyes of a frame. An error is raised and also kept in `failed`, since Blender swallows it and goes
        on with the next frame.
        """
        try:
            return self.eyes_at(frame)
        except Exception as error:
            self.failed = self.failed or in_one_line(error)
            raise


# Not an attribute of the engine: with one that is annotated as a class of ours, Blender 4.5 does not come to its end.
_under_way: list[DeliveryUnderWay] = []


class STEREO_REPROJECT_engine_delivery(bpy.types.RenderEngine):  # noqa: N801 - Blender's naming rule
    """Render engine that renders nothing: it fills a render result with finished passes, those of the delivery under
    way. The scene is not looked at.
    """

    bl_idname = ENGINE
    bl_label = "Stereo Reproject Delivery"

    def update_render_passes(self, scene: bpy.types.Scene, renderlayer: bpy.types.ViewLayer) -> None:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Declare the passes that are delivered; Blender calls this before a render. Without it, the compositor's
        Render Layers nodes would have no sockets.

        Passes that nodes use and that are not delivered are declared too, and stay empty: a socket that vanishes would
        take its link away while the compositor runs.
        """
        delivery, layer = _under_way[-1], renderlayer.name
        wired = delivery.wired.get(layer, {})
        empty = {name: CHANNELS[kind] for name, kind in wired.items()}
        for name, channels in {**empty, **_channels(delivery.eyes(scene.frame_current), layer)}.items():
            letters = pass_letters(name, channels)
            kind = "VALUE" if channels == 1 else "VECTOR" if letters[0] in "XU" else "COLOR"
            # With another type than it had, a socket loses its link for good.
            self.register_pass(scene, renderlayer, name, channels, letters, wired.get(name, kind))

    # The stubs say that there may be no depsgraph; Blender always hands one over.
    def render(self, depsgraph: bpy.types.Depsgraph) -> None:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Hand the finished eyes of the present frame over as the result of a render; Blender calls this for each view
        layer. An error is raised and also kept in `DeliveryUnderWay.failed`, since Blender goes on with the next frame.
        """
        delivery = _under_way[-1]
        try:
            self._fill(depsgraph, delivery)
        except Exception as error:
            # Blender goes on with the next frame.
            delivery.failed = delivery.failed or in_one_line(error)
            raise

    def _fill(self, depsgraph: bpy.types.Depsgraph, delivery: DeliveryUnderWay) -> None:
        """Fill the results of both views with the passes of the view layer that the depsgraph is for, and note that it
        was taken.
        """
        layer = depsgraph.view_layer.name
        for view, layers in delivery.eyes(depsgraph.scene.frame_current).items():
            passes = layers[layer]
            height, width = passes[COLOUR_PASS].shape[:2]
            result = self.begin_result(0, 0, width, height, layer=layer, view=view)
            for name, image in passes.items():
                taken = result.layers[0].passes.find_by_name(name, view)
                if taken is not None:
                    taken.rect.foreach_set(np.ascontiguousarray(to_blender(name, image)[::-1], np.float32).ravel())
            self.end_result(result)
            delivery.taken.add((view, layer))
        for key, text in delivery.metadata.items():
            # The result of `begin_result` keeps no texts.
            self.get_result().stamp_data_add_field(key, text)


def _channels(eyes: Eyes, layer: str) -> dict[str, int]:
    """Return the names of a view layer's passes that either eye has, and how many channels each pass has."""
    layers = [of_view[layer] for of_view in eyes.values() if layer in of_view]
    return {name: image.shape[2] for passes in layers for name, image in passes.items()}


@contextmanager
def registered(delivery: DeliveryUnderWay) -> Iterator[None]:
    """Have the delivery engine registered with Blender, with this delivery under way, for the time of a `with` block;
    it is unregistered afterwards, also after an error.

    It is not left registered because Blender 4.5 would not come to its end with a Python engine.
    """
    _under_way.append(delivery)
    bpy.utils.register_class(STEREO_REPROJECT_engine_delivery)
    try:
        yield
    finally:
        _under_way.pop()
        bpy.utils.unregister_class(STEREO_REPROJECT_engine_delivery)
