"""The extension as Blender loads it, for the tests of what an artist uses."""

import importlib.util
import sys
import tempfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = "stereo_reproject_extension"


@pytest.fixture(scope="module")
def package():
    """The extension's root as the package that Blender makes of it."""
    spec = importlib.util.spec_from_file_location(PACKAGE, ROOT / "__init__.py", submodule_search_locations=[str(ROOT)])
    module = importlib.util.module_from_spec(spec)
    sys.modules[PACKAGE] = module
    spec.loader.exec_module(module)
    yield module
    for name in [name for name in sys.modules if name.partition(".")[0] == PACKAGE]:
        del sys.modules[name]


@pytest.fixture
def extension(package):
    package.register()
    yield package
    package.unregister()


@pytest.fixture
def place(tmp_path, monkeypatch):
    """Where temporary files go; nothing but what the test itself writes may be left there."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    return tmp_path
