"""Trying out an HDF5 image whose bytes nobody vouches for, in a process of its own.

On damaged data the HDF5 library can loop for ever or crash; neither may happen to the
program that only wanted to read a map. Images with an intact seal never come here.
"""

from __future__ import annotations

import subprocess
import sys

from reachmap.maps.hdf5 import StructureError, identity_from_image, tree_from_image
from reachmap.maps.layouts import layout_of

TIME_LIMIT_S = 15.0
SECONDS_PER_BYTE = 0.5e-6


def reason_against(image: bytes) -> str:
    """Say why an image must not be read here, "" if it may; another process tries."""
    limit_s = TIME_LIMIT_S + SECONDS_PER_BYTE * len(image)
    try:
        done = subprocess.run(
            [sys.executable, "-m", __name__],
            input=image,
            capture_output=True,
            timeout=limit_s,
            check=False,
        )
    except (OSError, subprocess.TimeoutExpired):
        return "HDF5 cannot read it"
    if done.returncode == 0:
        return ""
    return done.stdout.decode(errors="replace").strip() or "HDF5 cannot read it"


def inspect(image: bytes) -> str:
    """Read an image here and now; say what is wrong with it, "" if nothing is."""
    try:
        identity = identity_from_image(image)
        # Of a file of another program, nothing more will be read.
        if layout_of(identity.get("format")) is not None:
            tree_from_image(image)
    except StructureError as error:
        return str(error)
    return ""


def main() -> int:
    """Inspect the image on standard input, write the reason against it, if any."""
    reason = inspect(sys.stdin.buffer.read())
    sys.stdout.write(reason)
    return 1 if reason else 0


if __name__ == "__main__":
    sys.exit(main())
