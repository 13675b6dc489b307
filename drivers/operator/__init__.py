"""The person at the screw, as a device: console, scripted; and the emulated screw."""
