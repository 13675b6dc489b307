"""What touches hardware: one folder a device, its emulator beside it."""
