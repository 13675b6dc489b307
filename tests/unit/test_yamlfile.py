from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, ClassVar, Literal

import pytest
from annotated_types import Gt, Interval, MinLen
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import BaseModel, ConfigDict, field_validator

from rig.errors import InputError
from rig.yaml.yamlfile import MAX_BYTES, load_yaml, load_yaml_text, read_document_text
from rig.yaml.yamlwords import place, unit_of


@dataclass(frozen=True, kw_only=True)
class Laser:
    __pydantic_config__: ClassVar[dict[str, str]] = {"extra": "forbid"}

    port: Annotated[str, MinLen(1)]
    range_mm: Annotated[float, Gt(0)] = 10.0
    rate_Hz: Annotated[float, Interval(ge=1, le=500)] = 125.0
    averaging: int = 1
    on: bool = True
    sign: Literal[1, -1] = 1
    mode: Literal["moving", "median"] = "moving"


@dataclass(frozen=True, kw_only=True)
class File:
    __pydantic_config__: ClassVar[dict[str, str]] = {"extra": "forbid"}

    laser: Laser
    axis: tuple[float, float, float] = (1.0, 0.0, 0.0)
    levels_N: list[float] = field(default_factory=list)
    note: str | None = None


class Model(BaseModel):
    model_config = ConfigDict(extra="forbid")

    name: str
    sd_mm: float = 0.0

    @field_validator("name")
    @classmethod
    def _no_spaces(cls, value: str) -> str:
        if " " in value:
            raise ValueError("a name has no spaces.")
        return value


def message(text: str, type_: type = File) -> str:
    with pytest.raises(InputError) as caught:
        load_yaml_text(text, "F", type_)
    return str(caught.value)


def said_of(text: str) -> str:
    """The message, or "" where there is none."""
    try:
        load_yaml_text(text, "F", File)
    except InputError as error:
        return str(error)
    return ""


def laser(entry: str) -> str:
    return message(f"laser: {{port: COM3, {entry}}}")


def test_values_of_a_good_file() -> None:
    text = (
        "laser: {port: COM3, range_mm: 1e1, averaging: 4, on: false, sign: -1}\nlevels_N: [1, 2.5]"
    )
    value = load_yaml_text(text, "F", File)
    assert value.laser == Laser(port="COM3", range_mm=10.0, averaging=4, on=False, sign=-1)
    assert value.levels_N == [1.0, 2.5]


RATE = "wanted: a number from 1 to 500 Hz."
BOOL = "wanted: true or false."


@pytest.mark.parametrize(
    ("entry", "column", "said"),
    [
        ("range_mm: -3", 31, "range_mm: -3 mm is not allowed; wanted: a number above 0 mm."),
        ("rate_Hz: 1e3", 30, f"rate_Hz: 1000 Hz is not allowed; {RATE}"),
        (
            "rate_Hz: '5'",
            30,
            f'rate_Hz: the text "5" is not allowed; {RATE} Write it without quotes.',
        ),
        (
            "rate_Hz: 5 Hz",
            30,
            f'rate_Hz: the text "5 Hz" is not allowed; {RATE} '
            "Write the number alone; the unit stands in the key.",
        ),
        (
            "rate_Hz: '1,5'",
            30,
            f'rate_Hz: the text "1,5" is not allowed; {RATE} Write a point as decimal mark.',
        ),
        ("averaging: 1.5", 32, "averaging: 1.5 is not allowed; wanted: a whole number."),
        ("averaging: true", 32, "averaging: true is not allowed; wanted: a whole number."),
        (
            "on: yes",
            25,
            f'on: the text "yes" is not allowed; {BOOL} '
            "This is text in YAML 1.2; write true or false.",
        ),
        ("on: 1", 25, f"on: 1 is not allowed; {BOOL}"),
        ("sign: true", 27, "sign: true is not allowed; wanted: 1 or -1."),
        (
            "mode: medan",
            27,
            'mode: the text "medan" is not allowed; wanted: "moving" or "median". '
            'Did you mean "median"?',
        ),
        ("range_mn: 3", 21, 'range_mn: unknown key. Did you mean "range_mm"?'),
        (
            "range_mm: 1,5",
            33,
            "5: unknown key. A comma ends a value here; write a point as decimal mark.",
        ),
        ("range_mm: .nan", 31, "range_mm: .nan is not a finite number."),
        ("range_mm: 1e999", 31, "range_mm: 1e999 is too large a number."),
        (
            "range_mm: !metre 3",
            31,
            "range_mm: the tag !metre is not allowed; write plain values.",
        ),
        ("on: null", 25, f"on: empty (null) is not allowed; {BOOL}"),
        ("port: x", 21, "port: stands twice (first in line 1); keep one."),
    ],
)
def test_a_wrong_value_is_said_word_for_word(entry: str, column: int, said: str) -> None:
    assert laser(entry) == f"F:1:{column}: laser.{said}"


BRACKET = "a bracket opened before is not closed, or a comma is missing"
SECOND = "a second document (---) begins; one file holds one document"
BELONGS = "(it belongs to what begins in line 1)."


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "F: empty; `key: value` lines are wanted."),
        ("# nothing", "F: empty; `key: value` lines are wanted."),
        ("- 1", "F:1:1: a list of 1; `key: value` lines are wanted."),
        ("laser", 'F:1:1: the text "laser"; `key: value` lines are wanted.'),
        ("a:\n\tb: 1", "F:2:1: not YAML: a tab stands here; indent with spaces."),
        ("a: 'x", "F:1:6: not YAML: the text in quotes is not closed."),
        ("a: [1,\nb: 2", f"F:2:5: not YAML: {BRACKET} {BELONGS}"),
        ("a: *x", "F:1:4: not YAML: an alias (*name) without an anchor (&name) before it."),
        ("a: 1\nb", "F:2:2: not YAML: a key without a colon and value."),
        ("a: 1\n---\nb: 1", f"F:2:1: not YAML: {SECOND} {BELONGS}"),
        ("a: \x01", "F:1: a control character; only text may stand here."),
        ("[" * 5000, "F: nested too deeply."),
    ],
)
def test_what_is_no_yaml_is_said_word_for_word(text: str, said: str) -> None:
    assert message(text) == said


def test_every_problem_is_in_one_message_in_the_order_of_the_file() -> None:
    text = (
        "laser:\n  prot: COM3\n  range_mm: 0\naxis: [1, 0]\nlevels_N: [1, x]\n<<: {a: 1}\nnote: 5"
    )
    assert message(text).splitlines() == [
        'F:2:3: laser.prot: unknown key. Did you mean "port"?',
        "F:3:13: laser.range_mm: 0 mm is not allowed; wanted: a number above 0 mm.",
        "F:4:7: axis: a list of 2 is not allowed; wanted: a list of 3 values.",
        'F:5:15: levels_N[1]: the text "x" is not allowed; wanted: a number in N.',
        "F:6:1: <<: a merge key is no YAML 1.2; write the keys out.",
        "F:7:7: note: 5 is not allowed; wanted: text or null. Put it in quotes if it is a name.",
    ]


def test_a_missing_key_says_what_is_wanted_and_where() -> None:
    assert message("note: x") == "F:1:1: laser: is missing; wanted: a mapping with port."
    assert message("note: x\nlaser:\n  on: true") == (
        "F:2:1: laser.port: is missing; wanted: text (not empty)."
    )


@dataclass(frozen=True, kw_only=True)
class Gauge:
    __pydantic_config__: ClassVar[dict[str, str]] = {"extra": "forbid"}

    driver: Literal["gauge"]
    port: str


@dataclass(frozen=True, kw_only=True)
class Wire:
    __pydantic_config__: ClassVar[dict[str, str]] = {"extra": "forbid"}

    driver: Literal["wire"]
    port: str


@dataclass(frozen=True, kw_only=True)
class Bench:
    sensor: Gauge | Wire


def test_of_two_drivers_only_a_word_that_neither_has_is_wrong() -> None:
    assert message("sensor: {driver: wire, prt: COM3}", Bench) == (
        'F:1:24: sensor.prt: unknown key. Did you mean "port"?'
    )
    assert message("sensor: {driver: wirr, port: COM3}", Bench) == (
        'F:1:18: sensor.driver: the text "wirr" is not allowed; wanted: "gauge" or "wire". '
        'Did you mean "wire"?'
    )


@dataclass(frozen=True, kw_only=True)
class Fast:
    kind: Literal["a"]
    mode: Literal["x"]


@dataclass(frozen=True, kw_only=True)
class Slow:
    kind: Literal["b"]
    mode: Literal["y"]


@dataclass(frozen=True, kw_only=True)
class Either:
    sensor: Fast | Slow


def test_words_that_do_not_go_together_are_told() -> None:
    assert message("sensor: {kind: a, mode: y}", Either).splitlines() == [
        'F:1:16: sensor.kind: "a" does not go with what stands beside it.',
        'F:1:25: sensor.mode: "y" does not go with what stands beside it.',
    ]


def test_a_value_under_a_mistyped_key_is_checked_too() -> None:
    assert laser("rate_Hs: 1000").splitlines() == [
        'F:1:21: laser.rate_Hs: unknown key. Did you mean "rate_Hz"?',
        "F:1:30: laser.rate_Hz: 1000 Hz is not allowed; wanted: a number from 1 to 500 Hz.",
    ]


def test_checks_across_keys_join_the_message_and_spare_what_is_wrong_already() -> None:
    def check(value: File) -> list[tuple[tuple[str | int, ...], str]]:
        found: list[tuple[tuple[str | int, ...], str]] = [(("laser", "mode"), "never shown.")]
        return [*found, (("axis", 0), f"{value.laser.mode} needs 0.")]

    with pytest.raises(InputError) as caught:
        read_document_text("axis: [1, 0, 0]\nlaser: {port: a, mode: medan}", "F", File, check)
    first, second = str(caught.value).splitlines()
    assert first == "F:1:8: axis[0]: median needs 0."
    assert second.startswith("F:2:24: laser.mode:")


def test_messages_of_models_own_validators_carry_their_place() -> None:
    assert message("name: a b\nsd_mm: x", Model).splitlines() == [
        "F:1:7: name: a name has no spaces.",
        'F:2:8: sd_mm: the text "x" is not allowed; wanted: a number in mm.',
    ]


def test_anchors_work_and_cannot_explode() -> None:
    value = load_yaml_text("levels_N: &a [1, 2]\nlaser: {port: &p x}\nnote: *p", "F", File)
    assert value.note == "x"
    assert "inside its own anchor" in message("laser: &a {port: *a}")
    bomb = "a0: &a0 [x, x, x, x, x, x, x, x, x, x]\n" + "".join(
        f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 10)}]\n" for i in range(1, 9)
    )
    assert "too many of them" in message(bomb)


def test_at_most_thirty_problems_are_listed() -> None:
    lines = message("laser: {port: x}\nlevels_N: [" + "x, " * 100 + "x]").splitlines()
    assert len(lines) == 31
    assert lines[-1] == "F: and 71 more problems."


def test_files_that_are_none(tmp_path: Path) -> None:
    def said(path: Path) -> str:
        with pytest.raises(InputError) as caught:
            load_yaml(path, File)
        return str(caught.value).removeprefix(str(path))

    (tmp_path / "station.yaml").write_text("laser: {port: x}")
    assert said(tmp_path / "stations.yaml") == ': no such file. Did you mean "station.yaml"?'
    assert said(tmp_path / "station.yml") == ': no such file. Did you mean "station.yaml"?'
    # no likeness by the ending alone
    assert said(tmp_path / "missing.yaml") == ": no such file. Known: station.yaml."
    assert said(tmp_path / "no" / "f.yaml") == ": no such file."
    assert said(tmp_path) == ": a folder; a YAML file is wanted."
    assert said(Path("/dev/null")) == ": not a regular file; a YAML file is wanted."
    assert said(tmp_path / ("x" * 300)).startswith(": cannot be read: ")
    file = tmp_path / "f.yaml"
    file.write_bytes(b"#" * (MAX_BYTES + 1))
    assert said(file) == ": 250 kB; these files have at most 250 kB. Is it a YAML file?"
    file.write_bytes(b"a: 1\nb: \xff")
    assert said(file) == ":2: the byte 0xFF is no UTF-8 text; save the file as UTF-8."
    file.write_bytes("a: 1".encode("utf-16"))
    assert said(file) == ": UTF-16 text; save the file as UTF-8."
    file.write_bytes(b"a: 1\0")
    assert said(file) == ": binary data; a YAML text file is wanted."
    file.write_bytes(bytes(range(256)))
    assert said(file) == ": binary data; a YAML text file is wanted."
    file.write_bytes(b"\x89HDF\r\n\x1a\n\0")
    assert said(file) == ": an HDF5 file; a YAML file is wanted."


def test_a_byte_order_mark_is_accepted(tmp_path: Path) -> None:
    file = tmp_path / "f.yaml"
    file.write_bytes(b"\xef\xbb\xbflaser: {port: x}")
    assert load_yaml(file, File).laser.port == "x"


@settings(max_examples=50, deadline=None)
@given(st.floats(allow_nan=False, allow_infinity=False, min_value=-1e299, max_value=1e299))
def test_numbers_survive_exactly(number: float) -> None:
    text = f"laser: {{port: x}}\nlevels_N: [{number!r}, {number:.3e}]"
    assert load_yaml_text(text, "F", File).levels_N == [number, float(f"{number:.3e}")]


@settings(max_examples=50, deadline=None)
@given(st.text())
def test_any_text_ends_in_a_value_or_one_message(text: str) -> None:
    for content in (text, f"note: {text}"):
        assert said_of(content)[:2] in ("", "F:")


@pytest.mark.parametrize(
    ("path", "unit"),
    [
        (("range_mm",), "mm"),
        (("force_slope_N_per_s",), "N/s"),
        (("q_deg", 2), "deg"),
        (("full_scale_N", "x"), "N"),
        (("force_N", "max"), "N"),
        (("temperature1_C",), "deg C"),
        (("joint_stiffness_Nm_per_rad",), "Nm/rad"),
        (("sensitivity_pC_per_N",), "pC/N"),
        (("band_N", "rate_Hz"), "Hz"),
        (("name",), ""),
        (("N",), ""),
        (("gain_relative_sd",), ""),
    ],
)
def test_units_are_read_from_keys(path: tuple[str | int, ...], unit: str) -> None:
    assert unit_of(path) == unit


def test_places_read_like_code() -> None:
    assert place(("runs", 2, "steps_N", 0)) == "runs[2].steps_N[0]"
