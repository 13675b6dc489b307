"""The emulated rig: a child process with a simulated world behind all emulators of a station."""
