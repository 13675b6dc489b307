"""Simulated rigs behind the emulators and the blind check; shares nothing with identification.

A world is a module of this folder with `design() -> Design`; it is imported on use.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

from rig.errors import InputError, did_you_mean

if TYPE_CHECKING:
    from rig.worlds.world import World

WORLDS = {
    "linear": "rig.worlds.linear",
    "paper": "rig.worlds.paper",
}


def make_world(
    name: str,
    seed: int,
    force_gain_sd: float = 0.005,
    displacement_gain_sd: float = 0.003,
    before: int = 0,
) -> World:
    """The world `name`, its gains and scatter drawn from `seed`; the gains' relative standard
    deviations are those the instruments state. before: loadings of an earlier sitting. Raises
    InputError for a world nobody knows."""
    if name not in WORLDS:
        raise InputError(f'world: "{name}" is not known.{did_you_mean(name, WORLDS)}')
    from rig.worlds.world import World

    return World(
        import_module(WORLDS[name]).design(), seed, force_gain_sd, displacement_gain_sd, before
    )
