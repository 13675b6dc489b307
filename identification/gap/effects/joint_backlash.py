"""Lost motion where a joint's net torque passes zero.

Net torque = load and, in an upright arm, its own weight. The joint lies at one side of its play w
or at the other: `w/2 tanh((tau - tau_0) / zone)`; with friction it stays where it was pushed until
the torque has turned: a play of radius `zone` on the torque, cut at the ends of the play.
Size: gears of ratio >= 80 about 1 arcmin (3e-4 rad).
"""

from __future__ import annotations

import numpy as np

from identification.gap.bench import Bench
from identification.gap.data import Array
from identification.gap.history import play, rests
from identification.gap.variants import Variant, variant

WORD = "joint_backlash"
ZONES = (0.004, 0.012, 0.03, 0.07)  # of the joint's range of torque
SCALES = (1e-5, 5e-5, 2e-4, 1e-3)  # rad
_SHARES = (0.003, 0.02, 0.1, 0.3)  # of the deflection, on a bench without an arm


def variants(bench: Bench) -> list[Variant]:
    """Per joint: zone, with and without friction, crossing where weight and load balance."""
    rest = rests(bench.rows)
    out = []
    weight = np.stack([s.gravity for s in bench.data.setups])[bench.rows.setup]
    scales = SCALES if bench.data.arm else tuple(s * bench.reach for s in _SHARES)
    for j in bench.moving_joints():
        torque, g = bench.torque[:, j], weight[:, j]
        span = float(np.ptp(np.append(torque, 0.0)))
        if not span > 0:
            continue
        # a joint that its weight preloads beyond the load never crosses zero
        net = torque + g
        crossings = {"weight": net} if _crosses(net, torque) else {}
        if np.abs(g).max() < 0.5 * span:
            crossings["load"] = torque
        for name, x in crossings.items():
            for zone in ZONES:
                info = {"joint": j, "zone_Nm": zone * span}
                for kind, shape in _shapes(x, zone * span, rest).items():
                    column = bench.add_joint(j, bench.sense * shape)
                    label = f"joint {j + 1} {name} {kind} zone {zone:g}"
                    out.append(variant(WORD, label, [column], scales, **info))
    return out


def _crosses(net: Array, torque: Array) -> bool:
    """Whether the net torque comes to zero, or near it (weights are known to a few percent)."""
    margin = 0.05 * float(np.abs(net - torque).max()) + 0.02 * float(np.abs(torque).max())
    return bool(net.min() < margin and net.max() > -margin)


def _shapes(x: Array, zone: float, rest: Array) -> dict[str, Array]:
    state = play(x[:, None], np.array([zone]), rest)[:, 0]
    return {
        "free": np.tanh(x / zone) / 2,
        "friction": np.clip(state / zone, -1, 1) / 2,
        "friction 3": np.tanh(play(x[:, None], np.array([3 * zone]), rest)[:, 0] / zone) / 2,
    }
