"""The table of each packed camera is read exactly: every pixel of the picture finds its own entry, and no other."""

import numpy as np
import pytest

from stereo_reproject.blender.engines.renderer import BlenderRenderer
from stereo_reproject.blender.scene.working import working_scene
from stereo_reproject.images.passes import COLOUR_PASS
from stereo_reproject.settings.frame import SceneOverrides
from stereo_reproject.trace.requests import TraceRequest
from tests.blender.toolbox import add_camera, empty_scene, set_background
from tests.render.test_fill import PACKED


@pytest.mark.parametrize("packed_by", PACKED)
@pytest.mark.parametrize("count", [5, 77, 343, 1331, 4797, 6577])
def test_no_entry_is_mistaken_for_the_padding_below_it(tmp_path, count, packed_by):
    """Entries of column 0 above padding, which is negative: the least of it mixed in would make them padding too."""
    scene = empty_scene(4, count)
    set_background(scene, 1.0)
    add_camera(scene)
    pixels = np.zeros((count, 4), bool)
    pixels[:, 0] = True
    with working_scene(scene, SceneOverrides()) as working:
        renderer = BlenderRenderer(working, tmp_path, packed_by=packed_by)
        traced = renderer.trace("packed", [TraceRequest("right", pixels)])[0][COLOUR_PASS]
    assert (traced[:, :3] > 0.0).all()
