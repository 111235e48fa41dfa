"""What running tests leaves behind."""

import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
STARTS_A_WORKER = ROOT / "tests" / "jobs" / "test_worker_process.py"
SECONDS = 60


def test_tests_that_start_blender_leave_nothing_in_the_folder_for_temporary_files(tmp_path):
    environment = {**os.environ, **dict.fromkeys(("TMPDIR", "TEMP", "TMP"), str(tmp_path))}
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-k", "encoding"]
    ended = subprocess.run(
        [*command, str(STARTS_A_WORKER)],
        cwd=ROOT, env=environment, capture_output=True, text=True, timeout=SECONDS, check=False,
    )  # fmt: skip
    assert ended.returncode == 0, ended.stdout
    assert not list(tmp_path.iterdir())
