"""The GPU of the warp, watched and forgotten."""

import pytest


@pytest.fixture
def dispatched(monkeypatch):
    """The runs of shaders, as they come in."""
    import gpu

    runs, dispatch = [], gpu.compute.dispatch

    def counted(*arguments):
        runs.append(arguments)
        return dispatch(*arguments)

    monkeypatch.setattr(gpu.compute, "dispatch", counted)
    return runs


@pytest.fixture
def untried():
    """As if no one had asked for the GPU yet."""

    from stereo_reproject.blender.gpu import textures as gpu_textures
    from stereo_reproject.blender.gpu import warp as gpu_warp

    def forget():
        gpu_warp._tried.cache_clear()
        gpu_warp._given_up.clear()
        gpu_textures.shader.cache_clear()

    forget()
    yield
    forget()
