"""The command `rig`: arguments only. Every command imports what it needs when it runs."""

from rig.cli.commands import app
from rig.cli.endings import main

__all__ = ["app", "main"]
