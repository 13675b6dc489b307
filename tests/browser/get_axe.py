"""Fetches axe-core, with which test_access.py judges the page. Needs npm and a registry.

    .venv/bin/python tests/browser/get_axe.py

It is a tool of the tests under a licence of its own (MPL 2.0), and so no part of this project.
"""

from __future__ import annotations

import hashlib
import subprocess
import sys
import tarfile
import tempfile
from pathlib import Path

VERSION = "4.14.1"
SHA256 = "29348999450cdf2849a8e70b7912fc2da85a849da39c0d0d5394f51d4a9ed95c"
AXE = Path(__file__).resolve().parents[2] / "build" / "axe-core" / "axe.min.js"


def main() -> int:
    """Leaves what is there already alone."""
    if AXE.exists():
        return 0
    with tempfile.TemporaryDirectory() as folder:
        command = ["npm", "pack", "--silent", f"axe-core@{VERSION}", "--pack-destination", folder]
        try:
            subprocess.run(command, check=True, timeout=120, stdout=subprocess.DEVNULL)
        except (OSError, subprocess.SubprocessError) as error:
            print(f"axe-core {VERSION} could not be fetched: {error}", file=sys.stderr)
            return 1
        with tarfile.open(next(Path(folder).glob("*.tgz"))) as archive:
            member = archive.extractfile("package/axe.min.js")
            text = member.read() if member else b""
    found = hashlib.sha256(text).hexdigest()
    if found != SHA256:
        print(f"axe-core {VERSION} is not what it was: SHA-256 {found}", file=sys.stderr)
        return 1
    AXE.parent.mkdir(parents=True, exist_ok=True)
    AXE.write_bytes(text)
    return 0


if __name__ == "__main__":
    sys.exit(main())
