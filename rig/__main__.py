"""`python -m rig` is the command `rig`."""

import sys

try:
    from rig.cli import main

    main()
except KeyboardInterrupt:  # while modules are read, or as the last word is said
    sys.exit(130)
