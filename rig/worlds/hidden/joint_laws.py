"""Laws of joints by the word that names them: yield, friction, creep, curved elasticity, lost
motion, wrong springs.
"""

from __future__ import annotations

from rig.worlds.hidden.effect import Form
from rig.worlds.hidden.joint_creep import creep
from rig.worlds.hidden.joint_elastic import curved, wrong_springs
from rig.worlds.hidden.joint_friction import friction
from rig.worlds.hidden.joint_play import lost_motion
from rig.worlds.hidden.joint_yield import yields

FORMS: dict[str, tuple[Form, ...]] = {
    "joint_yield": (
        Form("sharp", True, yields("sharp")),
        Form("controller_clamp", True, yields("taken_back")),
        Form("rounded", False, yields("menegotto_pinto")),
        Form("ramberg_osgood", False, yields("ramberg_osgood")),
        Form("rate_dependent", False, yields("perzyna")),
        Form("two_backstresses", False, yields("chaboche")),
    ),
    "joint_hysteresis": (
        Form("maxwell_slip", True, friction("maxwell_slip")),
        Form("iwan", True, friction("iwan")),
        Form("dahl", True, friction("dahl")),
        Form("bouc_wen", False, friction("bouc_wen")),
        Form("stribeck_bristles", False, friction("stribeck_bristles")),
        Form("iwan_weibull", False, friction("iwan_weibull")),
        Form("prandtl_power", False, friction("power")),
    ),
    "joint_creep": (
        Form("standard_solid", True, creep("standard_solid")),
        Form("two_term_prony", True, creep("two_term_prony")),
        Form("three_term_prony", False, creep("three_term_prony")),
        Form("power_law", False, creep("power")),
        Form("logarithmic", False, creep("logarithmic")),
        Form("stress_dependent", False, creep("stress_dependent")),
        Form("burgers", False, creep("burgers")),
    ),
    "joint_nonlinear_stiffness": (
        Form("k1k2k3", True, curved("k1k2k3")),
        Form("cubic", True, curved("cubic")),
        Form("tanh", False, curved("tanh")),
        Form("hertz", False, curved("hertz")),
        Form("exponential", False, curved("exponential")),
    ),
    "joint_backlash": (
        Form("smooth", True, lost_motion("smooth")),
        Form("gap_with_friction", True, lost_motion("gap_with_friction")),
        Form("soft_flanks", False, lost_motion("soft_flanks")),
        Form("slow_approach", False, lost_motion("slow_approach")),
        Form("preloaded", False, lost_motion("preloaded")),
    ),
    "joint_stiffness_error": (
        Form("one_joint", True, wrong_springs("one_joint")),
        Form("two_joints", True, wrong_springs("two_joints")),
        Form("all_random", True, wrong_springs("all_random")),
    ),
}
