"""blender_manifest.toml says what the design says, and says alone what only it may say. That Blender accepts it is
checked by `make extension`."""

import posixpath
import re
import tomllib
from importlib.metadata import files
from pathlib import Path, PurePosixPath

import pytest

ROOT = Path(__file__).resolve().parents[2]
WHEEL = re.compile(
    r"\./wheels/openexr-(?P<version>\d+\.\d+\.\d+)-(?P<python>cp3\d+)-(?P=python)-(?P<platform>\w+)\.whl"
)
# Python of Blender 4.5 LTS, of 5.x, and of what follows.
PYTHONS = {"cp311", "cp313", "cp314"}
SYSTEM_OF_WHEEL = {"manylinux": "linux", "macosx": "macos", "win": "windows"}
LINK = re.compile(r"\]\((?!https?://)([^)#]+)")
NOT_SHIPPED = {
    # The front page of the repository, not of the extension.
    ("accuracy.md", "../README.md"),
    ("results.md", "../README.md"),
}
"""Links, by page, that lead to nothing in the zip; the charts of accuracy.md do not ship either, for their size."""
MACHINE_OF_WHEEL = {"x86_64": "x64", "amd64": "x64", "arm64": "arm64"}


@pytest.fixture(scope="module")
def manifest() -> dict:
    return tomllib.loads((ROOT / "blender_manifest.toml").read_text(encoding="utf-8"))


def platform_of(wheel_platform: str) -> str:
    """Blender's name of a wheel's platform: manylinux_2_28_x86_64 → linux-x64."""
    machine = next(machine for machine in MACHINE_OF_WHEEL if wheel_platform.endswith(machine))
    return f"{SYSTEM_OF_WHEEL[wheel_platform.partition('_')[0]]}-{MACHINE_OF_WHEEL[machine]}"


def test_identity(manifest):
    assert manifest["id"] == "stereo_reproject"
    assert manifest["type"] == "add-on"
    assert manifest["blender_version_min"] == "4.5.0"
    assert re.fullmatch(r"\d+\.\d+\.\d+", manifest["version"])


def test_the_wheels_licences_and_whose_they_are_are_named(manifest):
    own, *wheels = manifest["license"]
    assert own == "SPDX:GPL-3.0-or-later"
    assert wheels == ["SPDX:BSD-3-Clause", "SPDX:BSD-2-Clause", "SPDX:MIT"]
    # The form that the extensions platform asks for.
    assert all(re.fullmatch(r"\d{4}(-\d{4})? \S.*", entry) for entry in manifest["copyright"])
    assert manifest["maintainer"] in manifest["copyright"][0]
    licences = [file for file in files("OpenEXR") if file.name == "LICENSE.md"]
    (holder,) = re.findall(r"Copyright \(c\) (.*?)\. All rights", "".join(file.read_text() for file in licences))
    assert any(entry.partition(" ")[2] == holder for entry in manifest["copyright"])


def test_the_listing_does_not_point_at_itself(manifest):
    assert "extensions.blender.org" not in manifest.get("website", "")


def test_files_are_the_only_permission(manifest):
    assert set(manifest["permissions"]) == {"files"}


def test_one_wheel_per_platform_and_python(manifest):
    wheels = [WHEEL.fullmatch(wheel) for wheel in manifest["wheels"]]
    assert all(wheels)
    pairs = [(platform_of(wheel["platform"]), wheel["python"]) for wheel in wheels]
    assert sorted(pairs) == sorted((platform, python) for platform in manifest["platforms"] for python in PYTHONS)


def test_wheels_are_of_one_version_that_pip_would_take(manifest):
    versions = {WHEEL.fullmatch(wheel)["version"] for wheel in manifest["wheels"]}
    assert len(versions) == 1
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    requirement = next(entry for entry in project["dependencies"] if entry.startswith("OpenEXR"))
    minimum = re.fullmatch(r"OpenEXR>=(\d+)\.(\d+)", requirement)
    assert tuple(map(int, versions.pop().split(".")[:2])) >= tuple(map(int, minimum.groups()))


def test_version_stands_in_the_manifest_alone(manifest):
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert "version" not in project
    assert "version" in project["dynamic"]
    files = [ROOT / "setup.py", ROOT / "__init__.py", ROOT / "Makefile"]
    files += [file for folder in ("stereo_reproject", "operators") for file in (ROOT / folder).rglob("*.py")]
    version = re.compile(
        rf"(?<![\d.]){re.escape(manifest['version'])}(?![\d.])|__version__\s*=\s*[\"']|^bl_info\b", re.M
    )
    assert [str(file.relative_to(ROOT)) for file in files if version.search(file.read_text(encoding="utf-8"))] == []


def is_shipped(name: str, manifest: dict) -> bool:
    """Whether a file, by its path from docs/, is in the zip."""
    path = PurePosixPath(posixpath.normpath(f"/docs/{name}"))
    patterns = manifest["build"]["paths_exclude_pattern"]
    assert not any(pattern.startswith("!") for pattern in patterns), "no exceptions are thought of here"
    return not any(path.match(pattern) for pattern in patterns)


def test_what_the_pages_of_the_manual_lead_to_comes_with_them(manifest):
    pages = [page for page in (ROOT / "docs").glob("*.md") if is_shipped(page.name, manifest)]
    assert {"artists.md", "troubleshooting.md"} <= {page.name for page in pages}
    dead = {
        (page.name, link)
        for page in pages
        for link in LINK.findall(page.read_text(encoding="utf-8"))
        if not is_shipped(link, manifest) or not (ROOT / "docs" / link).exists()
    }
    charts = {(page, link) for page, link in dead if page == "accuracy.md" and link.startswith("images/")}
    assert dead - charts == NOT_SHIPPED


def test_only_pictures_that_a_shipped_page_shows_come_along(manifest):
    pages = [page for page in (ROOT / "docs").glob("*.md") if is_shipped(page.name, manifest)]
    links = {link for page in pages for link in LINK.findall(page.read_text(encoding="utf-8"))}
    pictures = {f"images/{path.name}" for path in (ROOT / "docs" / "images").iterdir()}
    assert {picture for picture in pictures if is_shipped(picture, manifest)} - links == set()
