"""The arm of the published measurement (J. Manuf. Mater. Process. 2026, 10(2), 54).

In x it softens, in y it is straight up to a knee. Each constant below answers to a published
figure; levers (m) are those of the reference pose, tool length 0:

    joint            1        2        3        4        5
    along x       0.0000  -0.2133   0.3738   0.1134  -0.0271
    along y       0.7500  -0.0509   0.0893   0.0271   0.1134

- x: `u(F) = F / k0 * (1 + F / F_T)` with k0 = 133 N/mm at zero load. The estimate through the
  origin, deviations growing with u, over 20 ... 220 N is 95.94 N/mm for F_T = 256 N; then
  u(75 N) = 0.730, u(220 N) = 3.085 mm (published 0.73 and 3.09) and the slope at 220 N is
  49 N/mm. Joints 2 and 3 soften: their F1 stiffnesses times 1.517 give k0, and the softening
  torque |lever| * 190 N (their share of the compliance is 0.747) gives F_T.
- y: joint 1 makes up for what joints 2 and 3 take: 36.84 kNm/rad gives the published
  57.42 N/mm over 7.5 ... 75 N (secants fall from 57.46 to 57.38).
- Knee at 75.0 N: joint 1 yields at 0.75 m * 75.0 N = 56.25 Nm; hardening of 705 Nm/rad leaves a
  slope of 1.23 N/mm and u(82 N) = 7.01 mm (published 7.01). Unloaded, the deflection remains until
  the controller takes the joint back.
"""

from __future__ import annotations

from rig.worlds.laws import Law, Spring, Yield
from rig.worlds.linear import DELAY_S, DELAYED, REFERENCE_Q_RAD
from rig.worlds.world import Design, Element, joint_element

STIFFNESS_NM_PER_RAD = (36840.0, 86390.0, 27470.0, 7108.0, 7533.0, 8000.0)
SOFTENING_NM = {1: 40.53, 2: 71.01}  # of joints 2 and 3
YIELD_NM, HARDENING_NM_PER_RAD = 56.25, 705.0  # of joint 1


def _laws(joint: int) -> tuple[Law, ...]:
    softening = SOFTENING_NM.get(joint, float("inf"))
    spring = Spring(STIFFNESS_NM_PER_RAD[joint], softening, DELAYED, DELAY_S)
    return (spring, Yield(YIELD_NM, HARDENING_NM_PER_RAD)) if joint == 0 else (spring,)


def _elements() -> tuple[Element, ...]:
    return tuple(joint_element(joint, *_laws(joint)) for joint in range(6))


def design() -> Design:
    """Softening joints 2 and 3, yielding joint 1, in the reference pose."""
    title = "the published arm: softens in x, gives way in y at 75 N"
    return Design("paper", title, REFERENCE_Q_RAD, _elements)
