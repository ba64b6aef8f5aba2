"""A checksum over the bytes of an artefact, appended to the HDF5 data.

The HDF5 library trusts what it reads: on a file with a few flipped bits it can loop
for ever. So no artefact is handed to it before its bytes have been compared with this
seal. Readers of HDF5 ignore what follows the end of the file that the superblock
names. A program that opens the file for writing cuts the seal off; such a file is
tried out in another process, and checked by its ``integrity_sha256``.
"""

from __future__ import annotations

import hashlib
import re
import subprocess
import sys

from reachmap.maps.bytes.hdf5 import (
    StructureError,
    identity_from_image,
    tree_from_image,
)

SIGNATURE = b"\x89HDF\r\n\x1a\n"

_PREFIX = b"\nreachmap-seal sha256 "
_PATTERN = re.compile(re.escape(_PREFIX) + rb"([0-9a-f]{64})\n\Z")
SEAL_BYTES = len(_PREFIX) + 65


def seal(image: bytes) -> bytes:
    """Make the line that is written behind an HDF5 image."""
    return _PREFIX + hashlib.sha256(image).hexdigest().encode() + b"\n"


def unseal(data: bytes) -> tuple[bytes, bool | None]:
    """Split a file into its HDF5 image and the verdict of its seal.

    Returns
    -------
    image : bytes
    intact : bool or None
        Whether the seal fits the image; None where there is no seal.
    """
    found = _PATTERN.search(data, max(0, len(data) - SEAL_BYTES))
    if found is None:
        return data, None
    image = data[: found.start()]
    return image, hashlib.sha256(image).hexdigest().encode() == found.group(1)


def named_size(image: bytes) -> int | None:
    """Size of an HDF5 image according to its superblock [bytes], None if odd.

    A shorter image was cut off, which is cheaper to see here than by reading it.
    """
    if len(image) < 48:
        return None
    # Place of the end-of-file address, by version of the superblock.
    start = {0: 40, 1: 44, 2: 28, 3: 28}.get(image[8])
    return int.from_bytes(image[start : start + 8], "little") if start else None


def is_open_for_writing(image: bytes) -> bool:
    """Whether the superblock says that a program has the file open for writing.

    A program that crashed leaves the flag behind.
    """
    if len(image) < 24:
        return False
    # Place of the consistency flags, by version of the superblock; bit 0 is writing.
    return bool(image[11 if image[8] >= 2 else 20] & 1)


# Generous for starting Python on a busy machine, and for reading at 2 MB/s.
TIME_LIMIT_S = 15.0
SECONDS_PER_BYTE = 0.5e-6


def reason_against(image: bytes) -> str:
    """Reason not to read an image in this process, found by another one; "" if none."""
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
    """Read an image in this process and report what is wrong with it, or ""."""
    try:
        identity = identity_from_image(image)
        # Of a file of another program, nothing more will be read.
        if str(identity.get("format")).startswith("reachmap."):
            tree_from_image(image)
    except StructureError as error:
        return str(error)
    return ""


def main() -> int:
    """Inspect the image on standard input; write what is wrong with it, if anything."""
    reason = inspect(sys.stdin.buffer.read())
    sys.stdout.write(reason)
    return 1 if reason else 0


if __name__ == "__main__":
    sys.exit(main())
