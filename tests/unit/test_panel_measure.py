"""What `rig measure` does with its options for page and speed before a device is opened."""

from __future__ import annotations

from pathlib import Path

import pytest
from typer.testing import CliRunner

from rig import measure as measuring
from rig.cli import app
from rig.errors import InputError
from rig.panel.link import PanelOptions

PROTOCOL = Path(__file__).resolve().parents[2] / "protocols" / "paper_xy.yaml"


def test_only_emulated_stations_have_another_speed(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"--speed 5: .*ur10e_lab.yaml is no emulated station"):
        measuring.measure(PROTOCOL, "ur10e_lab", tmp_path / "a.h5", print, speed=5)


@pytest.mark.parametrize(
    ("words", "options"),
    [
        ([], None),
        (["--panel"], PanelOptions("127.0.0.1", None)),
        (["--panel-port", "9000"], PanelOptions("127.0.0.1", 9000)),
        (["--panel-host", "0.0.0.0"], PanelOptions("0.0.0.0", None)),
    ],
)
def test_a_place_for_the_page_asks_for_the_page(
    words: list[str], options: PanelOptions | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    given: list[object] = []

    def measure(*arguments: object) -> Path:
        given.extend(arguments)
        return Path("run.h5")

    monkeypatch.setattr(measuring, "measure", measure)
    result = CliRunner().invoke(app, ["measure", str(PROTOCOL), "--speed", "5", *words])
    assert result.exit_code == 0, result.output
    assert given[-2:] == [options, 5.0]
