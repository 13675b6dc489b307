"""An arm of six linear springs and nothing else: the reference pose and stiffnesses named F1.

kx 95.96, ky 57.42, kz 30.38 N/mm follow from the six springs (Nm/rad) in this pose.
"""

from __future__ import annotations

import math

from rig.worlds.laws import Spring
from rig.worlds.world import Design, Element, joint_element

REFERENCE_Q_RAD = tuple(math.radians(q) for q in (13.43, -99.84, -108.10, -62.06, 90.0, -76.57))
STIFFNESS_NM_PER_RAD = (37201.0, 56946.0, 18110.0, 7108.0, 7533.0, 8000.0)
# The last fiftieth of every deflection takes about a second: after each turn the arm settles.
DELAYED, DELAY_S = 0.02, 1.0


def _elements() -> tuple[Element, ...]:
    return tuple(
        joint_element(joint, Spring(stiffness, delayed=DELAYED, delay_s=DELAY_S))
        for joint, stiffness in enumerate(STIFFNESS_NM_PER_RAD)
    )


def design() -> Design:
    """Six linear springs in the reference pose."""
    return Design("linear", "six linear joint springs", REFERENCE_Q_RAD, _elements)
