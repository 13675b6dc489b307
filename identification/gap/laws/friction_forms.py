"""Friction of further forms: that grows with what a gear carries, whose loops close towards large
loads, or that wears the holes of what gives way."""

from __future__ import annotations

from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np

from identification.arrays import Array
from identification.gap.laws import friction_law
from identification.gap.laws.friction_law import ON_TOP, SLIPPING
from identification.gap.model.bench import Bench
from identification.gap.model.path import Path, with_loads
from identification.gap.model.variants import Variant, block, smooth_root, variant

WORD = "joint_hysteresis"
# Strengths, of the joint's range of torque: near each other at small ones, which slip first. Of an
# arm no further apart than a tenth, between which loops are chords of smooth ones; a specimen's
# friction brings a spring of its own, and more strengths won nothing there at first sight.
_WEAK = (0.012, 0.03, 0.06, 0.1, 0.15, 0.2)
RADII = (*_WEAK, 0.27, 0.36, 0.5, 0.7, 1.0)
ARM_RADII = (*_WEAK, 0.26, 0.33, 0.41, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0)
REACHES = (0.08, 0.2, 0.5, 1.2)  # of exponential laws, of the joint's range of torque
SCALES = (0.015, 0.05, 0.15, 0.5, 1.2)


def shape(
    label: str, joint: int, columns: list[int], radius: Array, law: str, **more: Any
) -> Variant:
    """Friction by a law, of strengths or reaches radius (k,) Nm; more: as `variant` has it."""
    return variant(
        WORD,
        label,
        columns,
        SCALES,
        each=True,
        joint=joint,
        radius=radius,
        law=law,
        slips=law in ON_TOP,
        **more,
    )


def spectrum(
    label: str,
    joint: int,
    columns: list[int],
    radius: Array,
    law: str,
    *,
    root: Array | None = None,
    prior: float = 0.25,
    **more: Any,
) -> Variant:
    """The same of all strengths together. root: None: neighbours are alike."""
    root = spectrum_root(len(columns)) if root is None else root
    kind = {"form": "spectrum", "root": root, "prior": prior}
    return shape(label, joint, columns, radius, law, **kind, **more)


def spectrum_root(count: int) -> Array:
    """(count, count) as of a variant: neighbours are alike, and all have something in common."""
    return smooth_root(count, 0.6, 0.3)


def growing(bench: Bench, joint: int, name: str, path: Path) -> list[Variant]:
    """Exponential laws of neighbouring reaches, part of whose friction grows in proportion to what
    the gear carries, push and weights together: teeth and bearings rub the more the harder they are
    pressed (Bittencourt and Gunnarsson, J. Dyn. Syst. Meas. Control 134, 2012). Where the weights
    are balanced, as by a spring, it carries the push alone."""
    torque, unit = bench.true_torque[:, joint], -bench.sense * bench.compliance[joint]
    carried = friction_law.carried(bench, joint)
    if not bench.feels_weight(joint):
        del carried["grows_with_push_to"]  # the same
    reach, out = bench.reach_of(torque) * np.array(GROWS_OVER), list[Variant]()
    share = 0.25 / (4 * (len(reach) - 1)) / len(carried)
    for law in friction_law.exponential_laws(bench):
        held = reach * path.bristles(reach, law.startswith("Bouc-Wen"))
        slips = torque[:, None] if law in SLIPPING else 0.0
        even = [bench.add_joint(joint, unit * h) for h in (held - slips).T]
        for key, carries in carried.items():
            top = float(carries.max())
            grown = (held * carries[:, None] / top - slips).T
            each = zip(reach, even, (bench.add_joint(joint, unit * h) for h in grown), strict=True)
            for (r, *first), (s, *second) in pairwise(each):
                label, radius = f"{name} {law} {r:.3g} Nm {key[:-3]}", np.array([r, r, s, s])
                facts = {"prior": share, key: top}
                out.append(shape(label, joint, [*first, *second], radius, law, **facts))
    return out


# Of the joint's range of torque: bearings stick over far less than what bends with the gear.
GROWS_OVER = (0.01, 0.02, 0.04, 0.08, 0.2, 0.5, 1.2)


def saturating(bench: Bench, joint: int, name: str, path: Path) -> list[Variant]:
    """Spectra of a load that saturates: loops that close towards large loads."""
    torque, unit = bench.true_torque[:, joint], bench.sense * bench.compliance[joint]
    top, out = float(np.abs(torque).max()), []
    for share in SATURATES:
        most = share * top
        through = with_loads(path, friction_law.saturating(path.load, most))
        reached = friction_law.saturating(torque, most)
        radius = bench.reach_of(reached) * np.array(ARM_RADII)
        radius = radius[radius < float(np.abs(reached).max())]  # beyond, nothing moves
        columns = [bench.add_joint(joint, unit * state) for state in through.plays(radius).T]
        label, prior = f"{name} spectrum saturating at {share:g}", 0.25 / len(SATURATES)
        facts: dict[str, Any] = {"saturates": most, "prior": prior}
        facts["within"] = friction_law.no_knee(bench, torque, radius, path, most)
        out.append(spectrum(label, joint, columns, radius, "Prandtl", **facts))
    return out


SATURATES = (0.3, 0.5, 0.8)  # of the joint's largest torque


def slackening(bench: Bench, joint: int, name: str, path: Path) -> list[Variant]:
    """Of a specimen that is driven to and fro: what gives way and wears its hole by that, so that
    it bears again only where it was last pushed to; alone, and beside strengths that rub."""
    if bench.data.arm or not bench.imposed or bench.load_history.one_sided:
        return []
    torque, unit = bench.true_torque[:, joint], bench.sense * bench.compliance[joint]
    span = bench.reach_of(torque)
    far = _NEARLY * float(np.abs(torque).max())  # what gives way beyond is a spring like others
    radius = bench.radii(torque, span * np.array(SLACKENS))
    rubs = bench.radii(torque, span * np.array(RADII))
    radius, rubs = radius[radius < far], rubs[rubs < far]
    worn = [bench.add_joint(joint, -unit * s) for s in path.slacks(radius).T]
    held = [bench.add_joint(joint, unit * s) for s in (path.plays(rubs) - torque[:, None]).T]
    both = block([spectrum_root(len(r)) for r in (radius, rubs)])
    label, all_of_them = f"{name} spectrum that slackens", np.append(radius, rubs)
    wears = partial(spectrum, joint=joint, law="Iwan", slackens=len(radius))
    return [
        wears(label, columns=worn, radius=radius),
        wears(f"{label} and rubs", columns=[*worn, *held], radius=all_of_them, root=both),
    ]


_NEARLY = 0.999
SLACKENS = (0.012, 0.03, 0.06, 0.1, 0.15, 0.2, 0.27, 0.36, 0.5)  # of the range of motion
