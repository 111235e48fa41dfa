"""Starts a Blender with a window, has a driver of this folder use the extension in it, and returns what that saw.

BLENDER_WINDOW names the command that starts such a Blender, to which options are added: `blender`, `xvfb-run blender`,
or whatever makes a window where there is none. GUI_SCENE names another .blend than the Cornell box.
"""

import json
import os
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
SCENE = Path(os.environ.get("GUI_SCENE", ROOT / "demo" / "cornell-box" / "cornell-box.blend"))

SEEN = ROOT / "build" / "gui"
"""What the drivers leave, in a folder for each. Below the checkout: a Blender in a container of its own may see nothing
else."""

SECONDS = 540.0
"""Far more than any driver takes, some 60 seconds."""

PLATFORMS = {"linux": "linux_x64", "win32": "windows_x64", "darwin": "macos_arm64"}

COMMAND = os.environ.get("BLENDER_WINDOW", "")

needs_a_window = pytest.mark.skipif(not COMMAND, reason="no BLENDER_WINDOW, which names a Blender with a window")


def drive(driver: str, *more: str, scene: Path = SCENE) -> dict:
    """Return the facts that a driver, a file of this folder, found with a copy of the scene open. It is given `more` as
    arguments. Its folder in build/gui has the facts and its screenshots.
    """
    folder = SEEN / Path(driver).stem
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    subprocess.run([sys.executable, ROOT / ".ci" / "extension.py", "--output", folder], check=True, timeout=SECONDS)
    (archive,) = folder.glob(f"*-{PLATFORMS[sys.platform]}.zip")
    copy = shutil.copy(scene, folder)
    options = ["--factory-startup", "--enable-event-simulate", copy, "--python", ROOT / "tests" / "gui" / driver]
    command = [*shlex.split(COMMAND), *options, "--", archive, folder, *more]
    finished = subprocess.run(
        list(map(str, command)), cwd=ROOT, capture_output=True, text=True, timeout=SECONDS, check=False
    )
    said = folder / "facts.json"
    assert said.exists(), finished.stdout[-4000:] + finished.stderr[-4000:]
    found = json.loads(said.read_text(encoding="utf-8"))
    assert found.get("finished"), (found, finished.stdout[-4000:])
    assert "Traceback" not in finished.stdout + finished.stderr, finished.stdout[-4000:]
    return found
