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
PIXELS = (0x3033, 0x0001, 0x3040, 0x0008, EGL_NONE)
"""EGL_SURFACE_TYPE: EGL_PBUFFER_BIT, EGL_RENDERABLE_TYPE: EGL_OPENGL_BIT."""

VERSION = (0x3098, 4, 0x30FB, 3, 0x30FD, 0x0001, EGL_NONE)
"""EGL_CONTEXT_MAJOR_VERSION and MINOR_VERSION, those that Blender asks for, EGL_CONTEXT_OPENGL_PROFILE_MASK: core."""


def started() -> bool:
    """Whether the gpu module can be used in this thread, the main one; without a window that takes Blender 5.2.

    Raises SystemError where Blender says so.
    """
    if not bpy.app.background:
        return True
    if not hasattr(gpu, "init") or (sys.platform == "linux" and not _makes_contexts()):
        return False
    with _without_egl_errors():
        gpu.init()
    return True


def _makes_contexts() -> bool:
    """Whether there is an OpenGL without a window. Blender 5.2 does not ask: without, gpu.init() ends the process.

    What is opened here stays open: it is one for the whole process, and someone else may be drawing with it.
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
    display, config, found = ctypes.c_void_p(address), ctypes.c_void_p(), ctypes.c_int()
    if not display or not egl.eglInitialize(display, None, None) or not egl.eglBindAPI(EGL_OPENGL_API):
        return False
    egl.eglChooseConfig(display, _numbers(PIXELS), ctypes.byref(config), 1, ctypes.byref(found))
    context = ctypes.c_void_p(egl.eglCreateContext(display, config, None, _numbers(VERSION)) if found.value else None)
    if context:
        egl.eglDestroyContext(display, context)
    return bool(context)


def _numbers(values: tuple[int, ...]) -> ctypes.Array[ctypes.c_int]:
    return (ctypes.c_int * len(values))(*values)


@contextlib.contextmanager
def _without_egl_errors() -> Iterator[None]:
    """Keep back what Blender says on stderr of the versions that it tried before the one that works."""
    try:
        kept = os.dup(2)
    except OSError:  # There is no stderr, as in a window of Windows.
        yield
        return
    with tempfile.TemporaryFile() as said:
        os.dup2(said.fileno(), 2)
        try:
            yield
        finally:
            os.dup2(kept, 2)
            os.close(kept)
            said.seek(0)
            for line in said:
                if not line.startswith(b"EGL Error"):
                    os.write(2, line)
