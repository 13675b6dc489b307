"""What was recorded, and what of it speaks of the rig: samples become rows in holds, levels and
runs; breaks, glitches, slack and faults are told and set aside."""
