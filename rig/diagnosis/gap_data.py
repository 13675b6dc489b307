"""From a data set to the numbers that the diagnosis of the sim-to-real gap works on (SI)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import takewhile

import numpy as np
from numpy.typing import NDArray

from identification.arm import STANDARD_GRAVITY, Arm, tool_offset
from identification.arrays import Array, Flags, Ints
from identification.elastic import Beam
from identification.gap.data import BRANCH_NAMES, GapData, Instruments, Setup
from identification.gap.effects.link_flexibility import BENDING, STRAINS
from identification.running import stretches
from rig.analysis.doubts import doubts_of_effects
from rig.contradictions import refuse_contradictions, without_turns
from rig.dataset import Dataset
from rig.digits import counted
from rig.errors import InputError
from rig.models.model import ArmModel
from rig.models.robot import load_robot
from rig.oddities import CHANNELS, incomplete_channels
from rig.passes import between_levels
from rig.runs import left_out, of_stitched, said_of_stitched, stitched, unseen_ends
from rig.storage.columns import SAMPLE_NUMBER
from rig.units import M_PER_MM

_WIDE_STEP_RAD = 1e-3  # of second derivatives
_STANDS = 0.5  # share of the samples of a run at which its clock stands still
_STEP_RAD = 1e-5  # central differences of levers: error below 1e-9


def gap_data(dataset: Dataset, model: ArmModel | None = None) -> GapData:
    """SI arrays of the samples in use. model: whose links and mounting are simulated beside the
    springs of META. InputError where META lacks what a diagnosis needs, or contradicts the data."""
    meta, where = dataset.meta, str(dataset.path or "data set")
    if meta.simulation is None:
        raise InputError(
            f"{where}: META names no simulation, so there is no gap to diagnose. Add `simulation` "
            "with the joint stiffnesses (or, without an arm, stiffness_N_per_mm) to META."
        )
    refuse_contradictions(dataset)
    used, aside, without = _in_use(dataset, where)
    columns = {k: v[used] for k, v in dataset.columns.items()}
    names = [str(d) for d in columns["direction"]]
    poses = [str(p) for p in columns["pose"]]
    keys = list(dict.fromkeys(zip(poses, names, strict=True)))
    number = {key: i for i, key in enumerate(keys)}
    setup = np.array([number[k] for k in zip(poses, names, strict=True)], dtype=np.int64)
    arm = None if meta.robot == "none" else load_robot(meta.robot)
    setups = tuple(_setup(dataset, arm, pose, name, model) for pose, name in keys)
    compliance, relative = _springs(dataset)
    meter = meta.instruments
    run, session = (
        stretches(setup, columns["repetition"].astype(np.int64)),
        _optional(columns, ["session_s"], 1),
    )
    onward = unseen_ends(dataset.columns, dataset.events, used)[used]
    time, notes = _clock(np.nan_to_num(columns["time_s"].astype(float)), session, run)
    said = (*doubts_of_effects(dataset), *_untold(onward))
    return GapData(
        arm=arm is not None,
        setups=setups,
        time=time,
        session=session,
        run=run,
        setup=setup,
        repetition=columns["repetition"].astype(np.int64),
        branch=np.array([BRANCH_NAMES.index(str(b)) for b in columns["branch"]], dtype=np.int64),
        step=_steps(columns),
        force=columns["force_N"].astype(float),
        displacement=columns["displacement_mm"].astype(float) * M_PER_MM,
        compliance=compliance,
        compliance_relative_sd=relative,
        instruments=Instruments(
            meter.force.standard_uncertainty_N,
            meter.displacement.standard_uncertainty_mm * M_PER_MM,
            meter.force.gain_relative_sd,
            meter.displacement.gain_relative_sd,
        ),
        tangential=_tangential(columns, setups, setup),
        q=_readings(dataset, columns, poses),
        temperature=_optional(columns, _thermometers(dataset), 6),
        output_encoder=meta.joint_encoder == "output",
        datum=meta.datum,
        tare=meta.tare,
        imposed=meta.imposed,
        timed=dataset.long_names.get("time_s") != SAMPLE_NUMBER,
        onward=onward,
        aside=aside,
        notes=(*notes, *without, *_unsettled(dataset), *said),
    )


def _in_use(dataset: Dataset, where: str) -> tuple[Flags, tuple[str, ...], tuple[str, ...]]:
    """The samples to use (n,), what to say of those that were set aside, and of channels that do
    not count. InputError where there is none."""
    used = dataset.used & np.isfinite(dataset.columns["force_N"])
    used &= np.isfinite(dataset.columns["displacement_mm"])
    if not used.any():
        raise InputError(f"{where}: no sample in use; every one is discarded or not finite.")
    midway = stitched(dataset.columns)
    torn = used & of_stitched(dataset.columns, midway)
    way = used & between_levels(left_out(dataset.columns, torn))
    used, aside, without = _without_holes(dataset, used & ~way & ~torn)
    for (pose, direction), (repetitions, others) in midway.items():
        said = said_of_stitched(repetitions, others=others)
        aside = (*aside, f"Pose {pose}, direction {direction}: {said}")
    if way.any():
        lost = f"{counted(int(way.sum()), 'sample')} of held runs without a step: set aside."
        aside = (*aside, lost)
    return used, aside, without


_JOINTS, _COMPONENTS, _TEMPERATURES = "joint readings", "force components", "temperatures"
_FEW = 0.05  # of the samples


def _thermometers(dataset: Dataset) -> list[str]:
    """Columns of temperatures, from the first on: an arm's joints have six, a rig may have one."""
    names = (f"temperature{j}_C" for j in range(1, 7))
    return list(takewhile(lambda name: name in dataset.columns, names))


def _without_holes(dataset: Dataset, used: Flags) -> tuple[Flags, tuple[str, ...], tuple[str, ...]]:
    """The samples to use (n,), without a few that lack what all others have: a channel counts only
    where it is there throughout. And what to say of those, and of channels that do not count: such
    as are there in no sample of a level, and temperatures, which are worth no sample."""
    aside, without = [], [f"{said}." for said in incomplete_channels(dataset.meta, dataset.columns)]
    without += _unread_thermometers(dataset)
    for what, names in {**CHANNELS, _TEMPERATURES: _thermometers(dataset)}.items():
        has = names and all(n in dataset.columns for n in names)
        if not has or (what == _JOINTS and dataset.meta.robot == "none"):
            continue
        values = [dataset.columns[n].astype(float) for n in names]
        there, count = np.isfinite(values).all(axis=0), int(used.sum())
        missing = int((used & ~there).sum())
        few = what != _TEMPERATURES and missing <= _FEW * count
        if missing and few and _levels(dataset, used & there) == _levels(dataset, used):
            used = used & there
            aside.append(f"{missing} of {count} samples lack {what}: set aside.")
        elif 0 < missing < count:
            without.append(
                f"{missing} of {count} samples lack {what}: taken as if none had been recorded."
            )
    return used, tuple(aside), tuple(without)


def _unread_thermometers(dataset: Dataset) -> Iterator[str]:
    """What to say of columns behind a gap in the numbers."""
    read = _thermometers(dataset)
    left = [f"temperature{j}_C" for j in range(len(read) + 1, 7)]
    if behind := [name for name in left if name in dataset.columns]:
        yield f"{', '.join(behind)}: not used; thermometers count from temperature1_C without gaps."


def _levels(dataset: Dataset, used: Flags) -> set[tuple[object, ...]]:
    """Levels of all runs that the samples to use (n,) belong to."""
    keys = (dataset.columns[k][used] for k in ("pose", "direction", "repetition", "branch", "step"))
    return set(zip(*(k.tolist() for k in keys), strict=True))


def _untold(onward: Array) -> Iterator[str]:
    """What to say of ends of loading that no row shows (n,)."""
    if count := int(np.count_nonzero(onward)):
        yield (
            f"In {counted(count, 'run')} loading went on to stop_at_displacement_mm, and an "
            "earlier version recorded no row there: its end is taken half a level beyond the last "
            "one, and where something gives way is less sure than its interval says. Measure again."
        )


def _unsettled(dataset: Dataset) -> tuple[str, ...]:
    """What was recorded before it had come to rest."""
    kinds = [e["kind"] for e in dataset.events]
    late, steps = kinds.count("not_settled"), kinds.count("step_start")
    if not late:
        return ()
    faster = dataset.origin == "emulated"
    return (
        f"At {late} places (of {steps} steps, and zero plateaus) nothing had settled when it was "
        "recorded: what still moved may look like a drift, a swing or creep. "
        + ("Emulate at a lower --speed." if faster else "Allow more time to settle."),
    )


def _clock(time: Array, session: Array | None, run: Ints) -> tuple[Array, tuple[str, ...]]:
    """Seconds since the start of each run; by the session's clock where that of a run stands while
    this goes on, with a note."""
    if session is None:
        return time, ()
    out, stood = time.copy(), 0
    for r in range(int(run[-1]) + 1):
        mine = run == r
        goes, stands = np.diff(session[mine]) > 0, np.diff(time[mine]) == 0
        if np.sum(stands & goes) > _STANDS * max(len(goes), 1):
            out[mine] = session[mine] - session[mine][0]
            stood += 1
    if not stood:
        return time, ()
    return out, (
        f"time_s stands still in {stood} of {int(run[-1]) + 1} runs: taken from session_s there.",
    )


def _steps(columns: dict[str, NDArray[np.generic]]) -> Ints:
    """Steps (n,): 0 of unloaded samples that bear none, where all loaded ones bear one."""
    step, unloaded = columns["step"].astype(np.int64), columns["branch"] == "zero"
    if unloaded.all() or np.any(step[~unloaded] < 0):
        return step
    return np.where(unloaded & (step < 0), 0, step)


def _springs(dataset: Dataset) -> tuple[Array, Array]:
    simulation = dataset.meta.simulation
    assert simulation is not None
    if simulation.joint_stiffness_Nm_per_rad is not None:
        k = np.array(simulation.joint_stiffness_Nm_per_rad, dtype=float)
        return 1 / k, np.full(6, simulation.joint_stiffness_relative_sd)
    assert simulation.stiffness_N_per_mm is not None
    per_m = [simulation.stiffness_N_per_mm[d] / M_PER_MM for d in dataset.meta.directions]
    return 1 / np.array(per_m), np.full(len(per_m), simulation.stiffness_relative_sd)


def _optional(
    columns: dict[str, NDArray[np.generic]], names: list[str], width: int
) -> Array | None:
    """(n,), or (n, names) where more than one may be there: where every column is there and finite
    throughout."""
    if not names or not all(n in columns for n in names):
        return None
    values = np.column_stack([columns[n].astype(float) for n in names])
    if not np.isfinite(values).all():
        return None
    return values[:, 0] if width == 1 else values


def _readings(
    dataset: Dataset, columns: dict[str, NDArray[np.generic]], poses: list[str]
) -> Array | None:
    if dataset.meta.robot == "none":
        return None
    q = _optional(columns, CHANNELS[_JOINTS], 6)
    if q is None:
        return None
    commanded = {name: np.array(p.q_rad) for name, p in dataset.meta.poses.items()}
    return without_turns(q - np.stack([commanded[p] for p in poses]))


def _tangential(
    columns: dict[str, NDArray[np.generic]], setups: tuple[Setup, ...], setup: Ints
) -> Array | None:
    vector = _optional(columns, CHANNELS[_COMPONENTS], 3)
    if vector is None:
        return None
    return np.asarray(
        np.einsum("nij,nj->ni", np.stack([s.tangents for s in setups])[setup], vector)
    )


def _setup(
    dataset: Dataset, arm: Arm | None, pose: str, direction: str, model: ArmModel | None
) -> Setup:
    n = np.array(dataset.meta.directions[direction], dtype=float)
    if arm is None:
        return _bench_setup(dataset, direction, n, _tangents(n))
    where = dataset.meta.poses[pose]
    return arm_setup(
        arm, pose, np.array(where.q_rad), np.array(where.tcp_xyz_mm) * M_PER_MM, direction, n, model
    )


def arm_setup(
    arm: Arm,
    pose: str,
    q: Array,
    tcp: Array,
    direction: str,
    n: Array,
    model: ArmModel | None = None,
) -> Setup:
    """The setup of an arm: q (6,) rad, point of load tcp (3,) m in the flange frame, direction n
    (3,) of length 1; model: whose links and mounting are simulated, by default none."""
    tool, tangents = tool_offset(tcp), _tangents(n)
    J = arm.jacobian(q, tool)[:3]
    flange = arm.fk(q, tool)
    point, R = flange[:3, 3], flange[:3, :3]
    frames = arm.frames(q)
    axes = frames[:6, :3, 2]
    # lever = z x (p - o) . n, so a shift R d of the tool changes it by R d . (n x z)
    offset = np.cross(n, axes) @ R
    return Setup(
        pose=pose,
        direction=direction,
        unit_vector=n,
        lever=J.T @ n,
        tangents=tangents,
        tangent_lever=tangents @ J,
        offset_lever=offset,
        turned_lever=_turned(arm, q, tool, n),
        moment=np.cross(point, n),
        links=np.array(
            [
                [_link(arm, link, q, tool, n) for link in links]
                for links in (arm.links, [_joint_to_joint(arm, link) for link in arm.links])
            ]
        ).reshape(2, -1, len(STRAINS)),
        gravity=-arm.gravity_torques(q),  # what the weight does, not what holds it
        tool_gravity=J.T @ np.array(STANDARD_GRAVITY),
        bent_lever=_bent(arm, q, tool, n),
        turned_offset=_turned_offset(axes, n) @ R,
        outside=0.0 if model is None else model.outside(q, tool, n),
        point=point,
        shifted_point=R,
        turned_point=J,
    )


def _bench_setup(dataset: Dataset, direction: str, n: Array, tangents: Array) -> Setup:
    names = list(dataset.meta.directions)
    m = len(names)
    lever = np.zeros(m)
    lever[names.index(direction)] = 1.0
    return Setup(
        pose="",
        direction=direction,
        unit_vector=n,
        lever=lever,
        tangents=tangents,
        tangent_lever=np.zeros((2, m)),
        offset_lever=np.zeros((m, 3)),
        turned_lever=np.zeros((m, m)),
        moment=np.zeros(3),
        links=np.zeros((2, 0, len(STRAINS))),
        gravity=np.zeros(m),
    )


def _tangents(n: Array) -> Array:
    """Two unit vectors (2, 3) across n: the base axes themselves where n is one of them."""
    helper = np.eye(3)[np.argsort(np.abs(n), kind="stable")[:1]][0]
    first = helper - (helper @ n) * n
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(n, first)])


def _turned(arm: Arm, q: Array, tool: Array, n: Array) -> Array:
    """(..., 6, 6): change of lever i per radian of joint j, for q (..., 6)."""
    steps = q[..., None, :] + _STEP_RAD * np.eye(6), q[..., None, :] - _STEP_RAD * np.eye(6)
    above, below = (n @ arm.jacobian(at, tool)[..., :3, :] for at in steps)
    return np.asarray(np.swapaxes(above - below, -1, -2) / (2 * _STEP_RAD))


def _turned_offset(axes: Array, n: Array) -> Array:
    """(6, 6, 3): change, per radian of joint j, of what a shift of the tool along the base axes
    does to lever i: the joint turns the shift, and the axes behind it."""
    across = np.cross(n, axes)
    shift = np.cross(across[:, None], axes[None, :])
    behind = np.tril(np.ones((6, 6)), -1)[:, :, None]  # joint j before axis i
    return np.asarray(shift + behind * np.cross(n, np.cross(axes[None, :], axes[:, None])))


def _bent(arm: Arm, q: Array, tool: Array, n: Array) -> Array:
    """(6, 6, 6): change of `_turned` per radian of joint k, the last index."""
    above, below = (
        _turned(arm, q + w * np.eye(6), tool, n) for w in (_WIDE_STEP_RAD, -_WIDE_STEP_RAD)
    )
    return np.asarray(np.moveaxis(above - below, 0, -1) / (2 * _WIDE_STEP_RAD))


def _joint_to_joint(arm: Arm, link: Beam) -> Beam:
    """The segment from the origin of the frame before its own to that of its own; as it is where
    these are one point."""
    before, own = (arm.frames(np.zeros(6))[max(link.frame - k, 0)] for k in (1, 0))
    start = own[:3, :3].T @ (before[:3, 3] - own[:3, 3])
    if not np.linalg.norm(start) > 0:
        return link
    return replace(link, start=tuple(start.tolist()), end=(0.0, 0.0, 0.0))


def _link(arm: Arm, link: Beam, q: Array, tool: Array, n: Array) -> list[float]:
    """Compliance of one nominal link along n, m/N: what each of STRAINS adds, by the moment of a
    newton at the tool (the little that it is stretched is left out)."""
    T, x, section = arm.frames(q)[link.frame], arm.fk(q, tool)[:3, 3], link.section
    start, end = (T[:3, :3] @ np.array(p) + T[:3, 3] for p in (link.start, link.end))
    axes = T[:3, :3] @ link.axes()
    bends = []
    for share, weight in zip((0.0, 0.5, 1.0), BENDING.values(), strict=True):
        torsion, about_y, about_z = np.cross(x - start - share * (end - start), n) @ axes
        bent = about_y**2 / section.bending_y + about_z**2 / section.bending_z
        bends.append(weight * link.length * float(bent))
    return [*bends, link.length * float(torsion**2 / section.torsion)]
