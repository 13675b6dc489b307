"""A station: which devices stand in the lab, or which emulators stand in for them."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar, Literal

from annotated_types import Ge, Interval, MinLen

import rig
from drivers.ild2200.settings import Ild2200Settings
from drivers.kistler.settings import KistlerSettings
from drivers.operator.settings import OperatorSettings
from drivers.ur10e.settings import Ur10eSettings
from rig.errors import InputError, did_you_mean
from rig.yaml.yamlfile import Document, place_in_text, read_document, read_document_text, read_text
from rig.yaml.yamlnodes import Key

STATIONS = Path(rig.__file__).resolve().parent.parent / "protocols" / "stations"
EMULATED = "emulated"
# Where the address of each device stands; "emulated" there takes what the emulator offers.
ENDPOINTS: tuple[tuple[str, str], ...] = (
    ("robot", "host"),
    ("dynamometer", "grpc_server"),
    ("laser", "port"),
    ("operator", "screw"),
)
_FORBID = {"extra": "forbid"}


@dataclass(frozen=True, kw_only=True)
class FaultPlan:
    """A fault that an emulator shows: at the start, or `after_s` seconds of the scene."""

    __pydantic_config__: ClassVar[dict[str, str]] = _FORBID

    device: Literal["robot", "dynamometer", "laser"]
    kind: Annotated[str, MinLen(1)]
    at: Literal["start"] | None = None
    after_s: Annotated[float, Ge(0)] | None = None


@dataclass(frozen=True, kw_only=True)
class Emulation:
    """`world`: the simulated rig behind the emulators; `speed`: times real time."""

    __pydantic_config__: ClassVar[dict[str, str]] = _FORBID

    world: Annotated[str, MinLen(1)]
    seed: Annotated[int, Interval(ge=0, le=2**32 - 1)] = 0
    speed: Annotated[float, Interval(ge=0.01, le=1000)] = 1.0
    faults: tuple[FaultPlan, ...] = ()


@dataclass(frozen=True, kw_only=True)
class StationFile:
    """A station as it is written (schema rig.station/1)."""

    __pydantic_config__: ClassVar[dict[str, str]] = _FORBID

    schema: Literal["rig.station/1"]
    name: Annotated[str, MinLen(1)]
    emulation: Emulation | None = None
    robot: Ur10eSettings | None = None
    dynamometer: KistlerSettings | None = None
    laser: Ild2200Settings | None = None
    operator: OperatorSettings


@dataclass(frozen=True)
class Station:
    """A station file, checked. A device that the station does not have is None."""

    name: str
    emulation: Emulation | None
    robot: Ur10eSettings | None
    dynamometer: KistlerSettings | None
    laser: Ild2200Settings | None
    operator: OperatorSettings
    text: str
    path: Path


def load_station(
    name_or_path: str | Path, beside: Path | None = None, named_in: str = ""
) -> Station:
    """Reads and checks a station: a name of protocols/stations, or a path.

    A name is looked for in `stations/` below the folder `beside` first, a relative path in
    `beside` where the working folder has none. Raises InputError with all problems of the file,
    or with the known names; `named_in`: where the name stands, for its beginning.
    """
    path = _find(str(name_or_path), beside, named_in)
    return _built(read_document(path, StationFile, _check), path)


def station_for(protocol_file: Path, its_own: str, other: str | None) -> Station:
    """The station that a protocol is carried out on: `other` (--station), or `its_own`."""
    if other is not None:
        return load_station(other, protocol_file.parent, "--station: ")
    return load_station(its_own, protocol_file.parent, f"{_where(protocol_file)}: ")


def _where(protocol_file: Path) -> str:
    """The line of a protocol that names its station; the file alone if it can't be read again."""
    name = str(protocol_file)
    try:
        return place_in_text(read_text(protocol_file), name, ("station",))
    except InputError:
        return name


def incomplete(station: Station) -> InputError:
    """What to raise where a device is missing that measuring needs."""
    lacking = [n for n in ("robot", "dynamometer", "laser") if getattr(station, n) is None]
    sections = " and ".join(f"`{name}:`" for name in lacking)
    return InputError(
        f"{station.path}: the station has no {' and no '.join(lacking)}; measuring needs robot, "
        f"dynamometer and laser. Add {sections} as in protocols/stations/ur10e_lab.yaml."
    )


def parse_station(text: str, path: Path) -> Station:
    """As `load_station`, for the text of a station that `path` (a data set) holds."""
    return _built(read_document_text(text, str(path), StationFile, _check), path)


def _find(name: str, beside: Path | None, named_in: str) -> Path:
    if not name.isprintable() or not name.strip():
        raise InputError(f"{named_in}station {name!r}: no name of a station and no path.")
    path = Path(name)
    if path.suffix in (".yaml", ".yml") or len(path.parts) > 1:
        near = None if beside is None else beside / path
        return near if near is not None and not path.exists() and near.is_file() else path
    folders = [STATIONS] if beside is None else [beside / "stations", STATIONS]
    for folder in folders:
        if (folder / f"{name}.yaml").is_file():
            return folder / f"{name}.yaml"
    known = {p.stem for folder in folders for p in folder.glob("*.yaml")}
    raise InputError(
        f'{named_in}station "{name}" is unknown.{did_you_mean(name, known)} '
        "Or give the path of a station file (.yaml)."
    )


def _built(document: Document[StationFile], path: Path) -> Station:
    written = document.value
    values = {f.name: getattr(written, f.name) for f in dataclasses.fields(written)}
    del values["schema"]
    return Station(**values, text=document.text, path=path)


def _check(written: StationFile) -> list[tuple[Key, str]]:
    """(path, what is wrong) across keys; endpoints are all emulated, or none is."""
    found: list[tuple[Key, str]] = []
    for device, key in ENDPOINTS:
        settings = getattr(written, device)
        endpoint = getattr(settings, key, None)
        if endpoint == EMULATED and written.emulation is None:
            what = '"emulated", and the file has no emulation: section; give the real one.'
            found.append(((device, key), what))
        elif settings is not None and endpoint != EMULATED and written.emulation is not None:
            if device == "operator" and written.operator.driver == "console" and not endpoint:
                continue
            what = f'{endpoint or "null"}: with an emulation: section it must be "emulated".'
            found.append(((device, key), what))
    found += _operator(written)
    found += _faults(written)
    if not (written.robot or written.dynamometer or written.laser):
        found.append(((), "robot, dynamometer and laser are missing; a station has one at least."))
    return found


def _operator(written: StationFile) -> list[tuple[Key, str]]:
    operator = written.operator
    if operator.driver == "console" and operator.screw == EMULATED:
        what = "a person at the console turns a real screw; write null, or driver: scripted."
        return [(("operator", "screw"), what)]
    if operator.driver == "scripted" and operator.screw is None:
        return [(("operator", "screw"), "a scripted operator needs an emulated screw to turn.")]
    return []


def _faults(written: StationFile) -> list[tuple[Key, str]]:
    found: list[tuple[Key, str]] = []
    for n, fault in enumerate(written.emulation.faults if written.emulation else ()):
        path: Key = ("emulation", "faults", n)
        if (fault.at is None) == (fault.after_s is None):
            found.append((path, "give `at: start` or `after_s`, and one of them."))
        if getattr(written, fault.device) is None:
            found.append(((*path, "device"), f"the station has no {fault.device}."))
    return found
