"""Says which Debian packages Blender's Python module lacks: a missing library is otherwise a riddle to who meets it.

Run by the Python that has bpy. With --packages it needs no bpy, and prints the packages to install, if any.
"""

import ctypes
import re
import sys

# What bpy links to and does not bring along.
PACKAGE_OF_LIBRARY = {
    "libX11.so.6": "libx11-6",
    "libXext.so.6": "libxext6",
    "libXfixes.so.3": "libxfixes3",
    "libXi.so.6": "libxi6",
    "libXrender.so.1": "libxrender1",
    "libXxf86vm.so.1": "libxxf86vm1",
    "libSM.so.6": "libsm6",
    "libICE.so.6": "libice6",
    "libxkbcommon.so.0": "libxkbcommon0",
    "libGL.so.1": "libgl1",
    "libEGL.so.1": "libegl1",
    "libgomp.so.1": "libgomp1",
    "libatomic.so.1": "libatomic1",
}
# Not linked but loaded when EEVEE renders.
EEVEE_LIBRARY = "libEGL.so.1"


def is_missing(library):
    try:
        ctypes.CDLL(library)
    except OSError:
        return True
    return False


def import_error():
    """What stands in the way of `import bpy`, or None."""
    try:
        import bpy  # noqa: F401 (the import is the check)
    except ImportError as error:
        return error
    return None


def problem(error):
    """One line on an ImportError of bpy: what is missing, and what to do."""
    found = re.match(r"(?P<library>lib\S+): cannot open shared object file", str(error))
    if found is None:
        return f"Blender's module cannot be imported: {error}"
    first = found["library"]
    if first not in PACKAGE_OF_LIBRARY:
        return f"Blender's module needs {first}: install the package of this system that brings it"
    libraries = [library for library in PACKAGE_OF_LIBRARY if library == first or is_missing(library)]
    packages = [PACKAGE_OF_LIBRARY[library] for library in libraries]
    return f"Blender's module needs {', '.join(libraries)}: run  sudo apt-get install {' '.join(packages)}"


def main():
    if sys.argv[1:] == ["--packages"]:
        print(" ".join(package for library, package in PACKAGE_OF_LIBRARY.items() if is_missing(library)))
        return None
    error = import_error()
    if error is not None:
        return problem(error)
    if sys.platform == "linux" and is_missing(EEVEE_LIBRARY):
        package = PACKAGE_OF_LIBRARY[EEVEE_LIBRARY]
        print(f"Note: EEVEE scenes need {EEVEE_LIBRARY}: run  sudo apt-get install {package}")
    return None


if __name__ == "__main__":
    sys.exit(main())
