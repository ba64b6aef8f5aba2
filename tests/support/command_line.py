"""The command as a user runs it."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path


def reachmap(
    folder: Path, *arguments: str, timeout: float = 120.0
) -> subprocess.CompletedProcess[str]:
    """Run the command in a folder, as a user would."""
    return subprocess.run(
        [sys.executable, "-m", "reachmap", *arguments],
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=timeout,
        check=False,
    )
