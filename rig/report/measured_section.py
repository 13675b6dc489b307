"""The chapters on what was measured: setup, protocol, devices, conditions; and the texts behind."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from rig.errors import InputError
from rig.report.document import (
    Block,
    Cell,
    Facts,
    Paragraph,
    Rich,
    Section,
    Table,
    Verbatim,
    row,
)
from rig.report.gather import Session
from rig.report.pictures import Pictures
from rig.report.results import DEGREES, NOTHING, Node
from rig.report.setup_drawing import Load

_MOST_DRAWN = 6  # poses with a drawing of their own; all stand in the table
_ORIGINS = {
    "emulated": "emulated: from simulated devices; nothing was measured",
    "measured": "measured",
    "imported": "imported from a table of measurements",
}
_NAMES = ("model", "device", "daq_product_type")  # what a device calls itself, the best one first
_BRANCHES = {"loading": "loading", "loading-unloading": "loading and unloading"}
_ORDERS = {
    "by_run": "all repetitions of a run, then the next run",
    "by_repetition": "all runs, then all of them again",
}


def measured(session: Session, data: Node, pictures: Pictures) -> Section:
    """Setup, protocol, devices, conditions."""
    blocks: list[Block] = [Facts(tuple(_what(session, data))), *_drawings(session, pictures)]
    blocks += [*_protocol(data["protocol"]), *_places(data["meta"]), *_devices(data)]
    blocks += [_instruments(data["meta"]), *_simulation(data["meta"])]
    return Section("measured", "What was measured", tuple(blocks), session.dataset.banners())


def _what(session: Session, data: Node) -> Iterator[tuple[str, Cell]]:
    meta, quality = data["meta"], data["quality"]
    imported = bool(data["imported"].value)
    yield "Imported from" if imported else "Title", data["title"].value or NOTHING
    yield "Imported on" if imported else "Begun", data["created"].value or NOTHING
    if quality["duration_s"]:
        yield "Took", quality["duration_s"].number(3, 1 / 60, "min")
    yield "Origin", _ORIGINS[session.dataset.origin]
    arm = bool(meta.get("poses"))
    yield "Robot", meta["robot"].text() if arm else "none: one spring a direction"
    yield "Imposed by the rig", meta.get("imposed").value or "not stated"
    often = "before each repetition" if meta["datum"].value == "repetition" else "once per setup"
    yield "Laser zeroed", often
    yield "Force zeroed", "before each run" if meta["tare"].value == "run" else "once a session"
    if arm:
        side = meta["joint_encoder"].text()
        seen = "contain the gears' deflection" if side == "output" else "do not contain it"
        yield "Joint readings", f"{side} side: they {seen}"
    warm = quality["temperature_C"]
    if warm:
        yield "Joint temperatures", (*warm.interval(3), " °C")


def _drawings(session: Session, pictures: Pictures) -> Iterator[Block]:
    """One drawing a pose that was measured in."""
    setups = [(d.pose, d.direction) for d in session.analysis.directions.values()]
    meta = session.dataset.meta
    for pose in list(dict.fromkeys(pose for pose, _ in setups))[:_MOST_DRAWN]:
        loads = [Load(name, meta.directions[name]) for p, name in setups if p == pose]
        try:
            yield pictures.setup(session, pose, loads)
        except InputError as error:  # a robot file that is not there any more
            yield Paragraph((f"No drawing: {error}",), "note")


def _protocol(asked: Node) -> Iterator[Block]:
    if not asked:
        return
    words: Rich = (
        *asked["repetitions"].number(),
        " repetition, " if asked["repetitions"].value == 1 else " repetitions, ",
        _BRANCHES[asked["branches"].text()],
        "; ",
        _ORDERS[asked["order"].text()],
    )
    samples: Rich = (
        "at least ",
        *asked["samples_per_step"].number(),
        " a level at ",
        *asked["rate_Hz"].stated(),
        " Hz, after settling; holds of at least ",
        *asked["hold_s"].stated(),
        " s",
    )
    zeros: Rich = (
        *asked["zero_before_s"].stated(),
        " s before and ",
        *asked["zero_after_s"].stated(),
        " s after each repetition, then ",
        *asked["rest_s"].stated(),
        " s of rest",
    )
    yield Facts((("Procedure", words), ("Samples", samples), ("Without load", zeros)))
    rows = tuple(
        row(
            run["pose"].text(),
            run["direction"].text(),
            run["levels"].number(),
            run["from_N"].stated(),
            run["to_N"].stated(),
        )
        for run in asked["runs"]
    )
    yield Table("Runs asked for", ("pose", "direction", "levels", "from N", "to N"), rows, 2)


def _places(meta: Node) -> Iterator[Table]:
    if meta.get("poses"):
        yield Table(
            "Poses: joint positions, and the point of load in the flange's frame",
            ("pose", *(f"q{j} deg" for j in range(1, 7)), "tool x mm", "y mm", "z mm"),
            tuple(
                row(
                    name,
                    *(q.number(5, DEGREES) for q in p["q_rad"]),
                    *(v.stated() for v in p["tcp_xyz_mm"]),
                )
                for name, p in meta["poses"].items()
            ),
        )
    yield Table(
        "Directions: unit vectors in the base frame",
        ("direction", "x", "y", "z"),
        tuple(row(name, *(c.stated() for c in v)) for name, v in meta["directions"].items()),
    )


def _devices(data: Node) -> Iterator[Block]:
    """One row a device; everything else that they said stands among the texts."""
    rows = []
    for name, device in data["devices"].items():
        said: dict[str, Any] = device.value
        serial = [v for k, v in said.items() if "serial" in k]
        rows.append(
            row(
                name,
                next((str(said[k]) for k in _NAMES if k in said), NOTHING),
                serial[0] if serial else NOTHING,
                str(said.get("source", NOTHING)),
            )
        )
    if rows:
        yield Table("Devices", ("device", "what", "serial number", "source"), tuple(rows), 4)
    else:
        yield Paragraph(("No device is named in this data set.",), "note")


def _instruments(meta: Node) -> Table:
    force, laser = meta["instruments"]["force"], meta["instruments"]["displacement"]
    return Table(
        "Standard uncertainties as stated: one sample, and the gain that all samples share",
        ("instrument", "unit", "one sample", "gain in %"),
        (
            row(
                "force",
                "N",
                force["standard_uncertainty_N"].stated(),
                force["gain_relative_sd"].stated(100),
            ),
            row(
                "displacement",
                "mm",
                laser["standard_uncertainty_mm"].stated(),
                laser["gain_relative_sd"].stated(100),
            ),
        ),
        words=2,
    )


def _simulation(meta: Node) -> Iterator[Block]:
    simulation = meta.get("simulation")
    if not simulation:
        yield Paragraph(("No simulation is stated for this measurement.",), "note")
        return
    joints = simulation.get("joint_stiffness_Nm_per_rad")
    if joints:
        sd = simulation["joint_stiffness_relative_sd"]
        values = row("kNm/rad", *(k.stated(1e-3) for k in joints))
        header = ("joint stiffness", *(f"joint {j}" for j in range(1, 7)))
    else:
        sd = simulation["stiffness_relative_sd"]
        springs = simulation["stiffness_N_per_mm"]
        values = row("N/mm", *(k.stated() for _, k in springs.items()))
        header = ("stiffness", *(name for name, _ in springs.items()))
    yield Table("What the simulation believed before the measurement", header, (values,))
    words = ("Relative standard deviation stated for it: ", *sd.stated(100), " %.")
    yield Paragraph(words, "note")


def texts(session: Session, data: Node) -> list[Section]:
    """The texts behind the measurement, in full: devices, settings, protocol, comments."""
    given = session.dataset.texts
    found = [
        ("Devices, all that they said", _settings(data["devices"])),
        ("Calibration and settings of the station", _settings(data["calibration"])),
        ("Protocol, verbatim", given.get("protocol", "")),
        ("Comments of the imported table", given.get("comments", "")),
    ]
    blocks = tuple(Verbatim(title, text) for title, text in found if text)
    if not blocks:
        return []
    return [Section("texts", "Texts behind the measurement", blocks, session.dataset.banners())]


def _settings(node: Node) -> str:
    """`device  setting: value`, a line each."""
    lines = []
    for name, settings in node.items():
        if isinstance(settings.value, dict):
            lines += [f"{name:<12} {key}: {_plain(v)}" for key, v in settings.value.items()]
        else:
            lines.append(f"{name}: {_plain(settings.value)}")
    return "\n".join(lines)


def _plain(value: Any) -> str:
    """A setting in one line."""
    if isinstance(value, dict):
        return ", ".join(f"{k} {_plain(v)}" for k, v in value.items())
    if isinstance(value, list):
        return ", ".join(f"[{_plain(v)}]" if isinstance(v, list) else _plain(v) for v in value)
    return NOTHING if value is None else str(value)
