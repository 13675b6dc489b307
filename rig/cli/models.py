"""Commands about models: couple, simulate."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rig.cli.options import (
    FiguresOption,
    JsonOption,
    ModelArgument,
    MujocoOption,
    ProtocolArgument,
    UrdfOption,
    give,
    list_written,
)

if TYPE_CHECKING:
    from rig.coupling.couple import CouplingResult
    from rig.models.simulate import Simulation

_Path = Annotated[
    Path | None,
    typer.Option(metavar="PATH.csv", help="When to couple along a path with requirements."),
]
_DeadBand = Annotated[
    float, typer.Option(help="Relative dead band against chatter along the path.", min=0)
]
_Samples = Annotated[int, typer.Option(help="Samples of the Monte Carlo workspace.", min=1000)]
_BestPlacement = Annotated[
    bool, typer.Option(help="Look for the base distance and angle that meet `required` best.")
]
_Curves = Annotated[
    Path | None, typer.Option(metavar="CURVES.csv", help="Write the curves as a table.")
]


def couple(
    model: ModelArgument,
    path: _Path = None,
    dead_band: _DeadBand = 0.0,
    samples: _Samples = 1_000_000,
    best_placement: _BestPlacement = False,
    figures: FiguresOption = None,
    export_mujoco: MujocoOption = None,
    export_urdf: UrdfOption = None,
    json_file: JsonOption = None,
) -> None:
    """Coupled state of two arms: workspace, compound stiffness, when to couple."""
    from rig.coupling.couple import couple as run_couple
    from rig.terminal import terminal_progress

    with terminal_progress() as progress:
        told = lambda share: progress("sampling the workspace", share)  # noqa: E731
        result = run_couple(
            model,
            samples=samples,
            path=path,
            dead_band=dead_band,
            best_placement=best_placement,
            progress=told,
        )
    give(result, json_file, _files(result, figures, export_mujoco, export_urdf))


def _files(
    result: CouplingResult, figures: Path | None, mujoco: Path | None, urdf: Path | None
) -> Iterator[str]:
    """The figures, and the arm for other simulators, where asked for."""
    from rig.models import model_export

    if figures is not None:
        from rig.coupling.coupling_figures import draw

        yield from list_written(draw(result, figures))
    yield from list_written(model_export.write(result.model, mujoco=mujoco, urdf_file=urdf))


def simulate(
    model: ModelArgument,
    protocol: ProtocolArgument,
    csv: _Curves = None,
    json_file: JsonOption = None,
) -> None:
    """The curves that a model predicts for a procedure."""
    from rig.models.simulate import simulate as run_simulate

    result = run_simulate(model, protocol)
    give(result, json_file, _table(result, csv))


def _table(result: Simulation, csv: Path | None) -> Iterator[str]:
    if csv is not None:
        from rig.models.simulate import write_csv

        write_csv(result, csv)
        yield f"{csv}: written"
