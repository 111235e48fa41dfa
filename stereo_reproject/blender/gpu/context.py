"""A GPU for Blender without a window, where that is to be had without harm."""

from __future__ import annotations

import contextlib
import ctypes
import os
import sys
import tempfile
from collections.abc import Iterator

import bpy
import gpu

EGL_OPENGL_API, EGL_NONE, EGL_PLATFORM_SURFACELESS = 0x30A2, 0x3038, 0x31DD
CONFIG_ATTRIBUTES = (0x3033, 0x0001, 0x3040, 0x0008, EGL_NONE)
"""EGL_SURFACE_TYPE: EGL_PBUFFER_BIT, EGL_RENDERABLE_TYPE: EGL_OPENGL_BIT."""

CONTEXT_ATTRIBUTES = (0x3098, 4, 0x30FB, 3, 0x30FD, 0x0001, EGL_NONE)
"""EGL_CONTEXT_MAJOR_VERSION and MINOR_VERSION, those that Blender asks for, EGL_CONTEXT_OPENGL_PROFILE_MASK: core."""


def started() -> bool:
    """Start the GPU if need be, and return whether the gpu module can be used in this thread, which must be the main
    one.

    With a window that is so on any backend but Metal; without one it takes Blender 5.2 on Linux with OpenGL. It returns
    False where a broken driver would end the process, and where nobody has tried it. Raises SystemError where Blender
    has no GPU.
    """
    if not bpy.app.background:
        # Metal counts in textures only if they are made for it, which the gpu module does not do.
        return gpu.platform.backend_type_get() != "METAL"
    if not hasattr(gpu, "init") or sys.platform != "linux" or _prefers_another_backend() or not _makes_contexts():
        return False
    gpu.init()
    return True


def _prefers_another_backend() -> bool:
    """Return whether the preferences name another backend than OpenGL."""
    return getattr(bpy.context.preferences.system, "gpu_backend", "OPENGL") != "OPENGL"


def _makes_contexts() -> bool:
    """Return whether OpenGL works without a window: where it does not, Blender 5.2's gpu.init() would end the process.

    The display that is opened for the trial stays open: the process has but one, and others may be drawing with it.
    """
    try:
        egl = ctypes.CDLL("libEGL.so.1")
        named, surfaceless = egl.eglGetDisplay, egl.eglGetPlatformDisplay
    except (OSError, AttributeError):
        return False
    for function in (named, surfaceless, egl.eglCreateContext):
        function.restype = ctypes.c_void_p
    # As Blender does it: the display there is, and without one none.
    return _makes_context(egl, named(None)) or _makes_context(egl, surfaceless(EGL_PLATFORM_SURFACELESS, None, None))


def _makes_context(egl: ctypes.CDLL, address: int | None) -> bool:
    """Return whether a context of OpenGL can be made on an EGL display, given by its address (None: no display). The
    context is destroyed again.
    """
    display, config, found = ctypes.c_void_p(address), ctypes.c_void_p(), ctypes.c_int()
    if not display or not egl.eglInitialize(display, None, None) or not egl.eglBindAPI(EGL_OPENGL_API):
        return False
    egl.eglChooseConfig(display, _numbers(CONFIG_ATTRIBUTES), ctypes.byref(config), 1, ctypes.byref(found))
    context = ctypes.c_void_p(
        egl.eglCreateContext(display, config, None, _numbers(CONTEXT_ATTRIBUTES)) if found.value else None
    )
    if context:
        egl.eglDestroyContext(display, context)
    return bool(context)


def _numbers(values: tuple[int, ...]) -> ctypes.Array[ctypes.c_int]:
    """Return the values as an array of C integers."""
    return (ctypes.c_int * len(values))(*values)


@contextlib.contextmanager
def in_silence() -> Iterator[None]:
    """Keep stdout and stderr silent, for the time of a `with` block: Python's, and those of Blender and of drivers,
    which would print what does not work. Both are restored afterwards, also after an error.
    """
    kept = {}
    with tempfile.TemporaryFile() as said, contextlib.ExitStack() as restored:
        for stream, descriptor in ((sys.stdout, 1), (sys.stderr, 2)):
            # There may be none, as in a window of Windows.
            with contextlib.suppress(OSError, AttributeError, ValueError):
                stream.flush()
            with contextlib.suppress(OSError):
                kept[descriptor] = os.dup(descriptor)
                restored.callback(os.close, kept[descriptor])
                os.dup2(said.fileno(), descriptor)
                restored.callback(os.dup2, kept[descriptor], descriptor)
        yield
