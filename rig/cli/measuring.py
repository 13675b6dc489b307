"""Commands that meet devices: measure, check, emulate."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rig.cli.options import JsonOption, ProtocolArgument, StationOption, give, say

_Protocol = Annotated[Path | None, typer.Argument(metavar="PROTOCOL.yaml")]
_Output = Annotated[
    Path | None, typer.Option("-o", "--output", metavar="DATASET.h5", help="The new data set.")
]
_Resume = Annotated[
    Path | None, typer.Option(metavar="DATASET.h5", help="Go on with an interrupted run.")
]
_Panel = Annotated[
    bool, typer.Option("--panel", help="Serve the operator's page, and print its link.")
]
_PanelHost = Annotated[
    str | None,
    typer.Option(
        metavar="ADDRESS", help="Serve it there instead of 127.0.0.1, to a network: no cipher."
    ),
]
_PanelPort = Annotated[
    int | None, typer.Option(min=1, max=65535, help="Its port; left out: 8321, or a free one.")
]
_Speed = Annotated[
    float | None,
    typer.Option(min=0.01, max=1000, help="Of an emulated station, times real time."),
]


def measure(
    protocol: _Protocol = None,
    station: StationOption = None,
    output: _Output = None,
    resume: _Resume = None,
    panel: _Panel = False,
    panel_host: _PanelHost = None,
    panel_port: _PanelPort = None,
    speed: _Speed = None,
) -> None:
    """Carry out a procedure on a station, guide the operator, write the data set."""
    from rig import measure as measuring
    from rig.errors import InputError
    from rig.panel.link import DEFAULT_HOST, PanelOptions

    if (protocol is None) == (resume is None):
        both = f"{protocol}, --resume {resume}: " if protocol else ""
        raise InputError(f"rig measure: {both}give a PROTOCOL.yaml, or --resume DATASET.h5.")
    for option, value in (("--station", station), ("-o", output)):
        if resume is not None and value is not None:
            raise InputError(
                f"{option} {value}: a measurement that is resumed keeps its station and its file. "
                f"Leave {option} out."
            )
    page = None
    if panel or panel_host is not None or panel_port is not None:
        page = PanelOptions(panel_host or DEFAULT_HOST, panel_port)
    if resume is not None:
        path = measuring.resume(resume, say, page, speed)
    else:
        assert protocol is not None
        path = measuring.measure(protocol, station, output, say, page, speed)
    say(f"{path}: complete. Next: rig analyze {path}")


def check(
    protocol: ProtocolArgument, station: StationOption = None, json_file: JsonOption = None
) -> None:
    """Validate a protocol, show its plan, and ask every device whether it is ready."""
    from rig.check import check as run_check

    result = run_check(protocol, station)
    give(result, json_file)
    if result.failure is not None:
        raise result.failure


def emulate(station: Annotated[str, typer.Argument(metavar="STATION.yaml")] = "emulated") -> None:
    """Start the emulators of a station by hand, until Ctrl-C."""
    from rig.emulation.emulated import serve_by_hand
    from rig.station import load_station

    serve_by_hand(load_station(station))
