"""The version stands in blender_manifest.toml alone; everything else that pip needs is in pyproject.toml."""

import tomllib
from pathlib import Path

from setuptools import setup

manifest = tomllib.loads(Path(__file__).with_name("blender_manifest.toml").read_text(encoding="utf-8"))
setup(version=manifest["version"])
