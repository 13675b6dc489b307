"""What hands take at a rig, s: whoever plans a procedure counts with the same."""

from __future__ import annotations

SCREW_S = 10.0  # to turn the screw to the next level
SETTLE_S = 4.0  # until the arm has settled there, where no procedure says how long it is looked at
UNLOAD_S = 15.0
MOUNT_S = 300.0  # to set up a pose or a direction
