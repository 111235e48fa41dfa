"""What a case changes of its own process or of a child's: rights, mounts and signals."""

from __future__ import annotations

import ctypes
import os
import subprocess
import sys
from pathlib import Path

CLONE_NEWNS = 0x00020000
CLONE_NEWUSER = 0x10000000
CLONE_NEWNET = 0x40000000
PR_CAPBSET_DROP = 24
LAST_CAPABILITY = 40

_libc = ctypes.CDLL(None, use_errno=True)


def without_powers() -> None:
    """Have what is executed next obey the rights of files even as root."""
    if os.geteuid() == 0:
        for capability in range(LAST_CAPABILITY + 1):
            _libc.prctl(PR_CAPBSET_DROP, capability, 0, 0, 0)


def unshare(flags: int) -> None:
    """Leave namespaces for new ones, in one where this user is root if need be."""
    user, group = os.getuid(), os.getgid()
    flags |= 0 if user == 0 else CLONE_NEWUSER
    if _libc.unshare(flags):
        raise OSError(ctypes.get_errno(), "no new namespace")
    if flags & CLONE_NEWUSER:
        Path("/proc/self/setgroups").write_text("deny")
        Path("/proc/self/uid_map").write_text(f"0 {user} 1")
        Path("/proc/self/gid_map").write_text(f"0 {group} 1")


def mount(folder: Path, options: str = "", kind: str = "tmpfs") -> Path:
    """A drive of its own at `folder`, which no other process but this one's children sees, and which goes with them."""
    unshare(CLONE_NEWNS)
    command = ["mount", "--make-rprivate", "/"]
    subprocess.run(command, check=True, capture_output=True)
    folder.mkdir(exist_ok=True)
    command = ["mount", "-t", kind, *(["-o", options] if options else []), "hostile", str(folder)]
    subprocess.run(command, check=True, capture_output=True)
    return folder


def remount(folder: Path, options: str) -> None:
    subprocess.run(["mount", "-o", f"remount,{options}", str(folder)], check=True, capture_output=True)


def as_user(number: int) -> tuple[str, ...]:
    """What starts Python as a user of this number, whom no list of users knows."""
    return ("unshare", "--user", f"--map-user={number}", sys.executable)
