from __future__ import annotations

import dataclasses
import re
from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest

from rig.errors import InputError
from rig.meta import Meta
from rig.models.model import load_model
from rig.protocol import load_protocol
from rig.station import STATIONS, load_station, parse_station, station_for
from rig.yaml.yamlfile import load_yaml

EMULATED = (STATIONS / "emulated.yaml").read_text("utf-8")
LAB = (STATIONS / "ur10e_lab.yaml").read_text("utf-8")


def said(text: str, *changes: tuple[str, str]) -> list[str]:
    """Problems of a changed station, without file, place and what is checked later."""
    for old, new in changes:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    with pytest.raises(InputError) as caught:
        parse_station(text, Path("S"))
    lines = [line.split(": ", 1)[1] for line in str(caught.value).splitlines()]
    return [line for line in lines if not line.endswith("is checked once that is mended.")]


def test_the_emulated_station() -> None:
    station = load_station("emulated")
    assert station.emulation is not None
    assert (station.emulation.world, station.emulation.faults) == ("paper", ())
    assert station.laser is not None
    assert station.laser.port == "emulated"
    assert station.operator.driver == "scripted"
    assert station.text == EMULATED
    assert dataclasses.replace(parse_station(station.text, Path("S")), path=station.path) == station


def test_the_lab_station_has_no_emulation() -> None:
    station = load_station("ur10e_lab")
    assert station.emulation is None
    assert station.operator.driver == "console"


def test_names_beside_the_protocol_come_first(tmp_path: Path) -> None:
    (tmp_path / "stations").mkdir()
    (tmp_path / "stations" / "emulated.yaml").write_text(
        EMULATED.replace("name: emulated", "name: mine")
    )
    assert load_station("emulated", tmp_path).name == "mine"
    assert load_station("emulated").name == "emulated"
    assert load_station("stations/emulated.yaml", tmp_path).name == "mine"
    assert load_station(tmp_path / "stations" / "emulated.yaml").name == "mine"


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("emulatd", 'station "emulatd" is unknown. Did you mean "emulated"? Or give the path of a'),
        ("labor", 'station "labor" is unknown. Known: emulated, ur10e_lab.'),
        ("no/such.yaml", "no/such.yaml: no such file."),
        ("", "station '': no name of a station and no path."),
        ("a\0b", r"station 'a\x00b': no name of a station and no path."),
    ],
)
def test_unknown_stations(name: str, message: str) -> None:
    with pytest.raises(InputError, match=f"^{re.escape(message)}"):
        load_station(name)


@pytest.mark.parametrize(("other", "named_in"), [(None, "tests/plan.yaml"), ("labor", "--station")])
def test_an_unknown_station_is_told_with_where_it_was_named(
    other: str | None, named_in: str
) -> None:
    with pytest.raises(InputError, match=f'^{named_in}: station "labor" is unknown. Known: '):
        station_for(Path("tests/plan.yaml"), "labor", other)


def test_the_line_of_a_protocol_that_names_an_unknown_station(tmp_path: Path) -> None:
    path = tmp_path / "p.yaml"
    path.write_text("schema: rig.protocol/1\ntitle: t\nstation:   labor\n")
    with pytest.raises(InputError, match=rf'^{path}:3:12: station "labor" is unknown. Known: '):
        station_for(path, "labor", None)


def test_an_empty_name_is_no_wish_for_the_protocols_station() -> None:
    with pytest.raises(InputError, match=r"^--station: station '': no name of a station"):
        station_for(Path("tests/plan.yaml"), "emulated", "")


def test_emulated_endpoints_need_the_emulation_section() -> None:
    problems = said(LAB, ("port: /dev/ttyUSB0 ", "port: emulated "))
    assert problems == [
        'laser.port: "emulated", and the file has no emulation: section; give the real one.'
    ]


def test_the_emulation_section_needs_emulated_endpoints() -> None:
    assert said(EMULATED, ("host: emulated", "host: 192.168.0.10")) == [
        'robot.host: 192.168.0.10: with an emulation: section it must be "emulated".'
    ]
    assert said(EMULATED, ("grpc_server: emulated", "grpc_server: null")) == [
        'dynamometer.grpc_server: null: with an emulation: section it must be "emulated".'
    ]


def test_operator_and_screw_must_fit() -> None:
    assert said(EMULATED, ("driver: scripted", "driver: console")) == [
        "operator.screw: a person at the console turns a real screw; write null, or driver: "
        "scripted."
    ]
    assert said(LAB, ("driver: console", "driver: scripted")) == [
        "operator.screw: a scripted operator needs an emulated screw to turn."
    ]


@pytest.mark.parametrize(
    ("fault", "message"),
    [
        ("{device: laser, kind: silence}", "emulation.faults[0]: give `at: start` or `after_s`"),
        (
            "{device: laser, kind: a, at: start, after_s: 3}",
            "emulation.faults[0]: give `at: start`",
        ),
        (
            "{device: lasr, kind: a, at: start}",
            'wanted: "robot", "dynamometer" or "laser". Did you',
        ),
        ("{device: laser, kind: a, after_s: -1}", "after_s: -1 s is not allowed; wanted: a number"),
        ("{device: laser, at: start}", "emulation.faults[0].kind: is missing; wanted: text"),
    ],
)
def test_fault_plans(fault: str, message: str) -> None:
    (problem,) = said(EMULATED, ("faults: [] ", f"faults: [{fault}] "))
    assert message in problem


def test_what_a_driver_refuses_has_its_place() -> None:
    rows = "[[1, 0, 0], [0, 1, 0], [0, 0, 1]]"
    (problem,) = said(LAB, (rows, "[[1, 0, 0], [0.6, 0.8, 0], [0, 0, 1]]"))
    assert problem.startswith("dynamometer: axes_in_base: rows 1 and 2")
    assert problem.endswith(".")


def test_a_station_without_devices_is_none() -> None:
    text = "schema: rig.station/1\nname: empty\noperator: {driver: console}"
    assert said(text) == ["robot, dynamometer and laser are missing; a station has one at least."]


@pytest.mark.parametrize(
    ("read", "wanted"),
    [
        (load_protocol, "a protocol"),
        (load_model, "an arm's model, as `rig identify --write-model` writes"),
        (partial(load_yaml, type_=Meta), "the META of a table"),
    ],
)
def test_a_file_of_another_kind_is_one_line(read: Callable[[Path], object], wanted: str) -> None:
    """Not one for each of its keys."""
    path = STATIONS / "emulated.yaml"
    with pytest.raises(InputError) as caught:
        read(path)
    place, what = str(caught.value).split(": schema: ")
    assert place.startswith(f"{path}:")
    assert what == f"this is a station; wanted: {wanted}. Give that file's path."


def test_a_file_without_a_kind_is_one_line_too() -> None:
    """An arm's model, in place of a protocol."""
    path = STATIONS.parents[1] / "data" / "models" / "F1.yaml"
    with pytest.raises(InputError) as caught:
        load_protocol(path)
    said = "this is not a protocol: it says no schema, and most of its keys are others."
    assert str(caught.value) == f"{path}:1:1: {said} Check the name."
