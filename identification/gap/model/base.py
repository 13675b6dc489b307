"""What every hypothesis contains: springs, gains, datum, scatter of runs, offsets, cross-talk."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from identification.arrays import Array
from identification.gap.model.bench import Bench
from identification.gap.model.encoders import ENCODER_OFFSET_RAD
from identification.gap.model.other_springs import doubt

HALF = 0.5  # of the geometry is expected, and as much may be missing or there
# Of a piezoelectric dynamometer, relative; and what data sheets allow at most.
CROSSTALK, MOST_CROSSTALK = 0.005, 0.02


@dataclass(frozen=True, eq=False)
class Base:
    """Columns (size, k) with prior standard deviations (k,), and names of what they are."""

    columns: Array
    sd: Array
    names: tuple[str, ...]

    def index(self, prefix: str) -> list[int]:
        """Columns whose name begins so; a number at the end of that is a whole one."""
        begins = re.compile(re.escape(prefix) + (r"(?!\d)" if prefix[-1:].isdigit() else ""))
        return [i for i, name in enumerate(self.names) if begins.match(name)]

    @cached_property
    def springs(self) -> dict[int, int]:
        """Joint (from 0) -> column of its spring, of those that have one."""
        return {int(self.names[i].removeprefix("spring")) - 1: i for i in self.index("spring")}

    def softer(self, found: Array, joints: int) -> Array:
        """(joints,) relative changes of the springs' compliance among coefficients (k,) that were
        found; 0 of a joint without a spring of its own."""
        out = np.zeros(joints)
        out[list(self.springs)] = found[list(self.springs.values())]
        return out


def prediction(bench: Bench) -> Array:
    """Stacked: what springs of `bench.compliance` predict, or another simulator, and the effects
    that the simulation has. How the joints of another simulator turn, nobody knows: as springs do
    that give way as it does (`springs_behind`), and `_others_joints` leaves open by how much."""
    known = 0.0 if bench.known is None else bench.known.does
    if bench.simulated is not None:
        return bench.stacked(bench.simulated, bench.elastic) + known
    return bench.stacked(bench.slope * bench.load, bench.elastic) + HALF * _geometry(bench) + known


def base_columns(bench: Bench) -> Base:
    """The columns common to all hypotheses."""
    parts: list[_Part] = []
    parts += _springs(bench)
    parts.append(("geometry", _geometry(bench), HALF))
    parts += _gains(bench)
    parts += _datums(bench)
    parts += _offsets(bench)
    parts += _others_joints(bench)
    parts += _crosstalk(bench)
    if bench.known is not None:
        parts += [(n, c, 1.0) for n, c in zip(bench.known.names, bench.known.free.T, strict=True)]
    return _of(parts)


_Part = tuple[str, Array, float]


def _of(parts: list[_Part]) -> Base:
    kept = [(n, c, s) for n, c, s in parts if s > 0 and np.any(c)]
    return Base(
        np.column_stack([c for _, c, _ in kept]),
        np.array([s for _, _, s in kept]),
        tuple(n for n, _, _ in kept),
    )


def _springs(bench: Bench) -> list[_Part]:
    """Relative change of a joint's compliance; the prior stays that of the simulation."""
    data = bench.data
    scale = data.compliance / bench.compliance
    out = []
    for j in range(data.joints):
        column = bench.joint_column(j, bench.elastic[:, j])
        out.append((f"spring{j + 1}", column, float(data.compliance_relative_sd[j] * scale[j])))
    return out


def _geometry(bench: Bench) -> Array:
    """What the levers change as the joints give way, `1.5 F^2 d' T d` with d the deflection per
    newton and T the change of levers per deflection: some micrometres. Coefficient 1 for stiff
    links and a load that keeps its direction; a rig that is simulated linearly has none."""
    compliance = compliance_found(bench)
    turned = np.stack([s.turned_lever for s in bench.data.setups])[bench.rows.setup]
    bends = np.einsum("nij,nj->ni", turned, bench.lever * compliance)
    response = 1.5 * bench.load**2 * np.sum(bench.lever * compliance * bends, axis=1)
    q = bends * compliance * bench.load[:, None] ** 2
    return bench.stacked(bench.sense * response, q)


def compliance_found(bench: Bench) -> Array:
    """(m,) rad/Nm (m/N for a bench): of springs alone, as far as the data tell: levers turn by what
    the joints really give, and that counts twice, however far off the simulated springs are."""
    if not bench.data.arm or bench.imposed:
        return bench.compliance
    springs = [(name, column, _WIDE) for name, column, _ in _springs(bench)]
    base = _of([*springs, *_gains(bench), *_datums(bench), *_offsets(bench)])
    root = base.columns * (base.sd / bench.sigma[:, None])
    seen = (bench.observed - bench.stacked(bench.slope * bench.load, bench.elastic)) / bench.sigma
    found = base.sd * np.linalg.solve(root.T @ root + np.eye(len(base.sd)), root.T @ seen)
    change = base.softer(found, bench.data.joints)
    return np.asarray(bench.compliance * np.clip(1 + change, *_SOFTER))


_WIDE = 0.5  # a joint may be half or twice as stiff
_SOFTER = (0.2, 5.0)  # times


def _gains(bench: Bench) -> list[_Part]:
    meter = bench.data.instruments
    line = bench.slope * bench.load
    if bench.imposed:  # only the ratio of the two gains shows
        both = float(np.hypot(meter.force_gain, meter.displacement_gain))
        return [("gain force", bench.stacked(line), both)]
    force = [("gain force", shown(bench, bench.load), meter.force_gain)]
    if _askew(bench):  # every component has a sensor and an amplifier of its own
        force = [
            (f"gain force {'xyz'[a]}", component(bench, a), meter.force_gain) for a in range(3)
        ]
    # the laser's acts on what it read, however far off the simulated springs are
    read = bench.line if bench.data.arm else line
    return [
        *force,
        ("gain displacement", bench.stacked(read), meter.displacement_gain),
    ]


def _askew(bench: Bench) -> bool:
    """Whether an arm is pushed along more than one axis of the dynamometer at once. What single
    axes read too much, differently, the springs give way for."""
    return bench.data.arm and any(np.count_nonzero(s.loads) > 1 for s in bench.data.setups)


def component(bench: Bench, axis: int) -> Array:
    """(size,): what it does that a component of the force reads too much by a share: less of the
    push along the direction, and a force across that is none."""
    setups, which = bench.data.setups, bench.rows.setup
    along = np.array([s.unit_vector[axis] for s in setups])[which]
    across = np.stack([s.tangents[:, axis] for s in setups])[which]
    read = along * bench.load
    return shown(bench, along * read) + bench.stacked(tangential=across * read[:, None])


def shown(bench: Bench, excess: Array) -> Array:
    """(size,): what a share of the readings (n,) N does that is too much."""
    if bench.imposed:
        return bench.stacked(bench.slope * excess)
    return bench.force_column(-excess)


def _datums(bench: Bench) -> list[_Part]:
    """Laser datum of a setup (free) and scatter of whole runs within it; tare of the force."""
    rows = bench.rows
    per_run = bench.data.datum == "repetition"
    line = np.abs(bench.slope * bench.load).max()
    wide = max(bench.reach, float(np.abs(bench.response).max()), float(line))
    out = []
    for s in range(len(bench.data.setups)):
        mine = rows.setup == s
        runs = list(dict.fromkeys(rows.run[mine].tolist()))
        if not per_run:
            out.append((f"datum {s}", bench.stacked(mine.astype(float)), wide))
        for r in runs:
            if per_run or len(runs) > 1:
                column = bench.stacked((rows.run == r).astype(float))
                name = "datum run" if per_run else "scatter run"
                out.append((f"{name} {r}", column, wide if per_run else bench.noise.run))
    if not bench.imposed:
        out += _tares(bench)
    return out


def _tares(bench: Bench) -> list[_Part]:
    """The zero of each force component, taken from a few samples: acts on every force after."""
    rows, setups = bench.rows, bench.data.setups
    unit = np.stack([s.unit_vector for s in setups])[rows.setup]
    across = np.stack([s.tangents for s in setups])[rows.setup]  # (n, 2, 3)
    groups = np.unique(rows.run) if bench.data.tare == "run" else np.array([-1])
    out = []
    for g in groups:
        mine = rows.run == g if g >= 0 else np.ones(rows.n, dtype=bool)
        for k, axis in enumerate("xyz"):
            d = np.where(mine, unit[:, k], 0.0)
            beside = np.where(mine[:, None], across[:, :, k], 0.0)
            column = bench.force_column(-d) + bench.stacked(zero_force=d, tangential=beside)
            out.append((f"tare {g} {axis}", column, bench.noise.force))
    return out


def _offsets(bench: Bench) -> list[_Part]:
    """Joint readings against the commanded pose, per pose and joint; where setups of one pose are
    read differently, per setup as well."""
    if not bench.has_q:
        return []
    rows, out = bench.rows, list[_Part]()
    poses = [s.pose for s in bench.data.setups]
    groups = [
        (pose, [p == pose for p in poses], ENCODER_OFFSET_RAD) for pose in dict.fromkeys(poses)
    ]
    if bench.noise.q_setup > 0:
        each = np.eye(len(poses), dtype=bool).tolist()
        several = [s for s, pose in enumerate(poses) if poses.count(pose) > 1]
        groups += [(f"setup {s}", each[s], bench.noise.q_setup) for s in several]
    for name, setups, sd in groups:
        mine = np.array(setups)[rows.setup]
        for j in range(bench.data.joints):
            q = np.zeros((rows.n, bench.data.joints))
            q[mine, j] = 1.0
            out.append((f"offset {name} {j + 1}", bench.stacked(q=q), sd))
    return out


def _others_joints(bench: Bench) -> list[_Part]:
    """By how much each joint turns in another simulator, whose curves tell the whole only."""
    if not bench.has_q or bench.data.curves is None:
        return []
    sd, turned = doubt(bench.data, bench.compliance), np.eye(bench.data.joints)
    return [
        (f"other simulator {j + 1}", bench.stacked(q=bench.elastic * turned[j]), sd)
        for j in range(bench.data.joints)
    ]


def _crosstalk(bench: Bench) -> list[_Part]:
    rows = bench.rows
    if rows.tangential is None:
        return []
    out = []
    for s in range(len(bench.data.setups)):
        for k in range(2):
            t = np.zeros((rows.n, 2))
            mine = rows.setup == s
            t[mine, k] = rows.force[mine]
            out.append((f"crosstalk {s} {k}", bench.stacked(tangential=t), CROSSTALK))
    return out
