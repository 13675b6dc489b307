"""Rate-independent friction beside a joint's spring, from the first load on.

A joint that carries the arm's weight has slipped under it before the rig pushes: the first push
against it is then a reversal.

Gears rub the more the more they carry: part of a friction may grow with the net torque.

A friction element of strength r carries `S_r(tau) = tau - P_r(tau)` (stop operator; P play): the
spring feels so much less, and deflects less. A spectrum of strengths makes any loop that obeys
Masing's rules (Iwan 1967). Friction that does not obey them: an asperity model whose bristles
bend exponentially (Dahl 1968), one that lets go elastically (Bouc 1967, Wen 1976; beta = gamma);
of a specimen either in proportion to the load that presses its parts together (Amontons).
Loops that close towards large loads, as those of what has switched all it has (Preisach 1935), are
those of plays on a load that saturates (generalised play; Al Janaideh, Rakheja and Su, IEEE/ASME
Trans. Mechatronics 16, 2011).
Where the stated spring is that of small loads, which make nothing slip, every element adds what it
slips instead (plays: Prandtl 1928). The coefficients are the shares of the joint's compliance that
work through friction, 0 to 1, or what it has more than was stated.

Size: friction of 2 to 20 % of the torque gears see; about 1 arcmin lost at ratio >= 80.
Prior: shares positive in sum, sd out of SCALES, equally likely; of an arm two fifths of it on
spectra, as much on exponential laws, in both conventions, a fifth on single strengths; of a
specimen as much on each of these laws.
Source: hysteresis loss in catalogues of strain wave gears.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np

from identification.arrays import Array
from identification.gap.laws import friction_forms, friction_law
from identification.gap.laws.closer import RefinementTarget, places
from identification.gap.laws.effect import Effect
from identification.gap.laws.friction_forms import (
    ARM_RADII,
    RADII,
    REACHES,
    WORD,
    growing,
    saturating,
    shape,
    slackening,
    spectrum,
)
from identification.gap.laws.friction_law import (
    BY_LOAD,
    LAWS,
    SLIPPING,
    THAT_SLIPS,
    by_ratio,
)
from identification.gap.laws.law import Laws
from identification.gap.laws.specimens import with_other_springs
from identification.gap.model.bench import Bench
from identification.gap.model.path import Path, with_loads, worked_in
from identification.gap.model.variants import (
    LASTING,
    RESET_PER_SETUP,
    UNDER_WEIGHT,
    Variant,
    smooth_root,
)

SCALES = friction_forms.SCALES  # of all its shapes
# Friction beside a spring that is imposed a motion may be stiffer than it by any factor, until it
# slips: seals, brushes and sliders give way by micrometres.
STIFF = (0.0007, 0.002, 0.005)
WITH_STIFF = (*STIFF, *RADII)
NEVER = 1.5  # of the range: strengths that never slip here, and only stiffen
# Without unloading no loop is seen: what then bends all at once, at a large load, is a knee; what
# bends ever more from the first load on is a spectrum of strengths. Specimens yield.
_SMALL = 5
TOOLS_KG = (0.0, 0.5, 1.0, 2.0, 2.5, 3.0)  # beside TOOL_KG, with which it is looked for at first
_CLOSER = 6  # reaches of a closer look
NEARER = 0.4  # times the reaches of others: at the largest load, and shorter below
OTHER_SCALES, _MORE = (0.05, 0.15, 0.5, 1.2, 3.0), 6.0  # the spring may be off by more than that


def variants(bench: Bench) -> list[Variant]:
    """Per joint and memory: kept while the arm stands, from no load or from the weight that came
    on first; lost when the rig is turned to another direction, or in the rest between runs; there
    from the beginning, of loads like those measured (rigs are cycled before they are measured)."""
    if not bench.data.arm and not bench.load_history.returns:  # pulls show a curve, and no loop
        return []
    out = []
    for j in bench.moving_joints():
        span = bench.reach_of(bench.true_torque[:, j])
        if not span > 0:
            continue
        for memory, path in _memories(bench, j).items():
            out += _laws(bench, j, span, memory, path)
    return out + _with_other_springs(bench, out)


def _memories(bench: Bench, joint: int) -> dict[str, Path]:
    """What a joint's friction may remember."""
    torque = bench.true_torque[:, joint]
    out = {"": bench.path(torque)}
    if not bench.load_history.monotonic:
        out[WORKED_IN] = worked_in(out[""])
    if np.sum(bench.rebuilt) > np.sum(bench.moved):
        out[RESET_PER_SETUP] = bench.path(torque, bench.rebuilt)
    # friction that never was seen to turn, and of which nothing stays, is a curve
    if np.sum(bench.rest) > np.sum(bench.moved) and (
        bench.load_history.unloads or not bench.data.arm
    ):
        out[" rested"] = bench.path(torque, bench.moved | bench.rest)
    if bench.feels_weight(joint):
        out[UNDER_WEIGHT] = bench.path(torque, weight=bench.weight(joint))
    return out


WORKED_IN = " worked in"


def _with_other_springs(bench: Bench, found: list[Variant]) -> list[Variant]:
    """A specimen's friction brings its own mean stiffness: what was simulated may be its first
    slope, or the mean one."""
    if bench.data.arm:
        return []
    out = []
    for v in found:
        out += with_other_springs(bench, int(v.info["joint"]), [v], OTHER_SCALES, _MORE)
    return out


def hangs(v: Variant) -> bool:
    """Whether weights have made it slip before the rig pushes."""
    return bool(v.info["memory"] == UNDER_WEIGHT.strip())


def refined(bench: Bench, found: Variant) -> list[Variant]:
    """Spectra at other masses of the tool, of a joint on which weights hang: nobody states that
    mass, and the wrist's joints feel little else."""
    joint = int(found.info["joint"])
    if not hangs(found) or not np.any(bench.weight_per_kg(joint)):
        return []
    torque, out = bench.true_torque[:, joint], []
    for kg in TOOLS_KG:
        name = f"joint {joint + 1}{UNDER_WEIGHT} tool {kg:g} kg"
        hung = bench.path(torque, weight=bench.weight(joint, kg))
        for v in _spectra(bench, joint, name, bench.reach_of(torque), hung):
            info = {**v.info, "memory": UNDER_WEIGHT.strip(), "tool_kg": kg}
            out.append(replace(v, prior=v.prior / len(TOOLS_KG), info=info))
    return out


def closer(bench: Bench, found: Variant) -> list[Variant]:
    """The same law with the same memory: exponential ones whose reaches lie closer together; of
    a specimen's spectrum, the strengths between the strengths as well."""
    joint, memory = int(found.info["joint"]), str(found.info["memory"])
    span = bench.reach_of(bench.true_torque[:, joint])
    name, path = _as_found(bench, found)
    if found.info["law"] in LAWS:
        low, high = found.info["radius"]
        reach = np.geomspace(0.9 * float(low), 1.1 * float(high), _CLOSER)
        reach /= NEARER if found.info["law"] in BY_LOAD else 1.0
        finer = _exponential(bench, joint, name, reach / span, path)
    elif not bench.data.arm and bench.load_history.unloads:
        finer = _spectra(bench, joint, name, span, path, _between(RADII))
        if bench.imposed:
            finer += _spectra(bench, joint, f"{name} stiff", span, path, _between(WITH_STIFF))
    else:
        return []
    out = [v.known_by(" fine", memory=memory, closely=True) for v in finer]
    return out + _with_other_springs(bench, out)


def _as_found(bench: Bench, found: Variant) -> tuple[str, Path]:
    """Joint and memory of a friction that was found: what labels begin with, and the path."""
    joint, memory = int(found.info["joint"]), str(found.info["memory"])
    path = next(p for m, p in _memories(bench, joint).items() if m.strip() == memory)
    return f"joint {joint + 1}{' ' * bool(memory)}{memory}", path


def outlasting(bench: Bench, found: Variant) -> list[Variant]:
    """Spectra of the joint of a friction that was found, kept on the arm's way to another pose as
    well: what rubs may not turn on it, and a knee may last as long."""
    if np.sum(bench.moved) < 2:
        return []
    joint = int(found.info["joint"])
    torque = bench.true_torque[:, joint]
    lasting = bench.path(torque, np.zeros(bench.rows.n, dtype=bool))
    name = f"joint {joint + 1}{LASTING}"
    finer = _spectra(bench, joint, name, bench.reach_of(torque), lasting)
    return _remembering(finer, LASTING)


def _remembering(found: list[Variant], memory: str) -> list[Variant]:
    return [replace(v, info={**v.info, "memory": memory.strip()}) for v in found]


def further(bench: Bench, found: Variant) -> list[Variant]:
    """Friction of the joint and memory of one that was found, of an arm: part of which grows with
    what the gear carries, and of a load that saturates."""
    if not bench.data.arm:
        return []
    joint, memory = int(found.info["joint"]), str(found.info["memory"])
    name, path = _as_found(bench, found)
    out = [] if bench.load_history.monotonic else growing(bench, joint, name, path)
    if bench.load_history.unloads and not hangs(found):  # about no load, so of no weight
        out += saturating(bench, joint, name, path)
    return _remembering(out, memory)


def _laws(bench: Bench, joint: int, span: float, memory: str, path: Path) -> list[Variant]:
    """All laws of one joint and memory."""
    name = f"joint {joint + 1}{memory}"
    spectra = _spectra(bench, joint, name, span, path)
    found = spectra + [v for s in spectra for v in _pairs(bench, name, span, s, len(spectra))]
    if bench.imposed and not bench.data.arm:
        (stiff,) = _spectra(bench, joint, f"{name} stiff", span, path, WITH_STIFF)
        found += [stiff, *_pairs(bench, name, span, stiff, 1)[: len(STIFF)]]
    if not bench.load_history.monotonic:  # a curve that saturates would be taken for friction
        reaches = np.array(REACHES if bench.load_history.unloads else REACHES[:2])
        found += _exponential(bench, joint, name, reaches, path)
    if memory == "":
        found += slackening(bench, joint, name, path)
    return _remembering(found, memory)


def _spectra(
    bench: Bench,
    joint: int,
    name: str,
    span: float,
    path: Path,
    strengths: tuple[float, ...] = RADII,
) -> list[Variant]:
    """The whole spectrum of strengths, which holds back what the spring would deflect; on an arm
    also where the stated spring is that of small loads, which make nothing slip: then every element
    adds its play (Prandtl 1928)."""
    torque, unit = bench.true_torque[:, joint], bench.sense * bench.compliance[joint]
    seen = strengths if bench.load_history.unloads else strengths[:_SMALL]
    radius = span * np.array(ARM_RADII if bench.data.arm else seen)
    radius = bench.radii(torque, radius) if bench.load_history.unloads else radius
    radius = np.append(radius, NEVER * span)
    slips = path.plays(radius)
    laws = [("Iwan", radius, slips - torque[:, None])]
    if bench.data.arm:
        laws.append(("Prandtl", radius[:-1], slips[:, :-1]))
    out = []
    for law, radii, states in laws:
        columns = [bench.add_joint(joint, unit * state) for state in states.T]
        label = f"{name} spectrum{THAT_SLIPS if law == 'Prandtl' else ''}"
        within = friction_law.no_knee(bench, torque, radii, path)
        out.append(spectrum(label, joint, columns, radii, law, within=within))
    return out


def _between(strengths: tuple[float, ...]) -> tuple[float, ...]:
    """With those between: loops of thousands of readings tell them apart."""
    return tuple(sorted((*strengths, *((a * b) ** 0.5 for a, b in pairwise(strengths)))))


def _pairs(bench: Bench, name: str, span: float, whole: Variant, conventions: int) -> list[Variant]:
    """Each strength of a spectrum with its neighbour, by the law of the spectrum. Friction acts
    from the first load on: one strength alone is a small one."""
    radius, columns, out = np.asarray(whole.info["radius"]), list(whole.columns), []
    law, joint = whole.info["law"], int(whole.info["joint"])
    largest = float(np.abs(bench.true_torque[:, joint]).max())
    most = int(np.sum(radius < (largest if law == "Prandtl" else NEVER * span))) - 1
    alone = most if bench.imposed else min(_SMALL + bench.load_history.unloads, most)
    for k in range(alone):
        out.append(
            shape(
                f"{name} r {radius[k] / span:.3g}{THAT_SLIPS if law == 'Prandtl' else ''}",
                joint,
                columns[k : k + 2],
                radius[k : k + 2],
                law,
                root=smooth_root(2, 0.7),
                within=whole.within[:, k : k + 2],
                prior=0.25 / alone / conventions,
            )
        )
    return out


def _exponential(bench: Bench, joint: int, name: str, reaches: Array, path: Path) -> list[Variant]:
    """Dahl's and Bouc and Wen's laws, with neighbouring reaches (k,) of the range of torque."""
    torque, c = bench.true_torque[:, joint], bench.compliance[joint]
    span, out = bench.reach_of(torque), []
    prior = 0.25 / (len(reaches) - 1) / (2 if bench.data.arm else 1)  # two conventions
    for law in friction_law.exponential_laws(bench):
        by_load, elastic = law in BY_LOAD, law.startswith("Bouc-Wen")
        reach = span * reaches * (NEARER if by_load else 1.0)
        way = with_loads(path, by_ratio(path.load, span)) if by_load else path
        held = way.bristles(reach, elastic) * (np.abs(torque)[:, None] if by_load else reach)
        held -= torque[:, None] if law in SLIPPING else 0.0
        columns = [bench.add_joint(joint, -bench.sense * c * h) for h in held.T]
        for k in range(len(reach) - 1):
            out.append(
                shape(
                    f"{name} {law} {reaches[k]:.3g}",
                    joint,
                    columns[k : k + 2],
                    reach[k : k + 2],
                    law,
                    root=smooth_root(2, 0.5),
                    prior=prior,
                )
            )
    return out


def _look_closer(word: RefinementTarget) -> list[Variant]:
    bench, out = word.engine.bench, []
    for s in places(word.alone, word.beside):
        out += closer(bench, s.variant)
        out += further(bench, s.variant)
        out += outlasting(bench, s.variant)
    for s in places(word.alone, word.beside, hangs):
        out += refined(bench, s.variant)
    return out


EFFECT = Effect(
    WORD,
    variants=variants,
    parameters=friction_law.parameters,
    laws=Laws(friction_law.describe, friction_law.columns),
    lengths=("share_through_friction",),
    finer=_look_closer,
    beside=True,
    not_negative=("friction", "share_through_friction"),
)
