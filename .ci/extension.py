"""Builds the extension: downloads the wheels that blender_manifest.toml names, has Blender's own `extension` command
build one zip per platform into dist/ (or --output), and has it validate each. Run by a Python that has bpy."""

import argparse
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import bpy

ROOT = Path(__file__).resolve().parents[1]
SCRIPTS = Path(bpy.utils.system_resource("SCRIPTS"))
# bpy has no `blender --command extension`; this file is what that calls.
EXTENSION_COMMAND = SCRIPTS / "addons_core" / "bl_pkg" / "cli" / "blender_ext.py"
VALID_TAGS = SCRIPTS / "modules" / "_bpy_internal" / "extensions" / "tags.py"
PAGES = {
    f"docs/{name}.md"
    for name in (
        *("accuracy", "animation", "artists", "many-views", "numerics", "performance", "production", "report"),
        *("results", "scripting", "troubleshooting"),
    )
}
SHIPPED = {
    *("__init__.py", "LICENSE", "blender_manifest.toml", "operators", "stereo_reproject", "wheels"),
    *("docs/farm", "docs/images"),
    *PAGES,
}


def run(*command: str | Path) -> None:
    subprocess.run([sys.executable, *command], check=True)


def download(wheel: Path) -> None:
    distribution, version, python, abi, platform = wheel.stem.split("-")
    run("-m", "pip", "download", "--quiet", "--no-deps", "--only-binary=:all:", "--dest", wheel.parent,
        "--implementation", "cp", "--python-version", python.removeprefix("cp"), "--abi", abi, "--platform", platform,
        f"{distribution}=={version}")  # fmt: skip
    if not wheel.exists():
        sys.exit(f"blender_manifest.toml names {wheel.name}, and pip downloaded another file into {wheel.parent}")


def is_shipped(name: str) -> bool:
    return any(name == shipped or name.startswith(f"{shipped}/") for shipped in SHIPPED)


def check_content(archive: Path) -> None:
    with zipfile.ZipFile(archive) as content:
        strays = [name for name in content.namelist() if not name.endswith("/") and not is_shipped(name)]
    if strays:
        sys.exit(f"{archive.name} holds {', '.join(strays)}: add to paths_exclude_pattern in blender_manifest.toml")


def main(output: Path) -> None:
    manifest = tomllib.loads((ROOT / "blender_manifest.toml").read_text(encoding="utf-8"))
    for wheel in (ROOT / name for name in manifest["wheels"]):
        if not wheel.exists():
            download(wheel)

    output.mkdir(parents=True, exist_ok=True)
    for old in output.glob(f"{manifest['id']}-*.zip"):
        old.unlink()
    tags = ("--valid-tags", VALID_TAGS)
    run(EXTENSION_COMMAND, "build", "--source-dir", ROOT, "--output-dir", output, "--split-platforms", *tags)
    for archive in sorted(output.glob(f"{manifest['id']}-*.zip")):
        run(EXTENSION_COMMAND, "validate", *tags, archive)
        check_content(archive)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--output", type=Path, default=ROOT / "dist", help="folder of the zips; the default is dist/")
    try:
        main(parser.parse_args().output)
    except subprocess.CalledProcessError as error:
        sys.exit(error.returncode)  # the command has said why
