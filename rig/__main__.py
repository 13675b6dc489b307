"""`python -m rig` is the command `rig`."""

from rig.start import main

main()
