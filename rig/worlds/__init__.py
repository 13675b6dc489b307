"""Simulated rigs behind the emulators; shares nothing with identification."""
