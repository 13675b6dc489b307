"""`python -m rig.panel` is the process that serves the page; `rig measure --panel` starts it."""

from __future__ import annotations

import sys

from rig.panel.child import main

if __name__ == "__main__":
    sys.exit(main())
