"""Commands about the stiffness of the measured arm: analyze, identify."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from rig.cli.options import (
    DatasetArgument,
    DatasetsArgument,
    FiguresOption,
    JsonOption,
    MujocoOption,
    UrdfOption,
    give,
    list_written,
)
from rig.errors import InputError

if TYPE_CHECKING:
    from rig.analysis.analyze import Analysis
    from rig.analysis.identify import IdentifyResult

_Weighting = Annotated[
    str,
    typer.Option(
        help="proportional, 1/s^2, none or errors-in-variables: how the points are weighted; "
        "auto: proportional where levels were held and a zero was measured."
    ),
]
_Intercept = Annotated[
    bool | None,
    typer.Option(
        "--intercept/--through-origin",
        help="Let the line miss the origin, or not; left out: as the data allow.",
    ),
]
_ErrorsInVariables = Annotated[
    bool, typer.Option(help="Count the force's uncertainty as well as the displacement's.")
]
_KeepAfterKnee = Annotated[bool, typer.Option(help="Count the steps after a knee towards k.")]
_JointReadings = Annotated[
    bool, typer.Option(help="Use the joint readings where they see the deflection.")
]
_Prior = Annotated[
    Path | None,
    typer.Option(metavar="MODEL.yaml", help="Prior stiffnesses, instead of the robot file's."),
]
_Proposals = Annotated[int, typer.Option(help="How many next poses to look for.", min=0)]
_Criterion = Annotated[
    Literal["A", "D", "E"], typer.Option(help="What the next poses make smallest.")
]
_WriteModel = Annotated[
    Path | None, typer.Option(metavar="MODEL.yaml", help="Write the arm as a model file.")
]
_WriteProtocol = Annotated[
    Path | None, typer.Option(metavar="PROTOCOL.yaml", help="Write the next measurement.")
]


def analyze(
    dataset: DatasetArgument,
    weighting: _Weighting = "auto",
    intercept: _Intercept = None,
    errors_in_variables: _ErrorsInVariables = False,
    keep_after_knee: _KeepAfterKnee = False,
    figures: FiguresOption = None,
    json_file: JsonOption = None,
) -> None:
    """Curve, stiffness k, pointwise k and anisotropy, with uncertainties."""
    from rig.analysis import analyze as analysis
    from rig.dataset import load

    options = analysis.Options(
        weighting=analysis.weighting(weighting),
        intercept=intercept,
        errors_in_variables=errors_in_variables,
        keep_after_knee=keep_after_knee,
    )
    result = analysis.analyze(load(dataset), options)
    if options == analysis.Options():
        from rig.catalogue import remember_result

        remember_result(dataset, result.to_json())
    give(result, json_file, _drawn(result, figures))


def _drawn(result: Analysis, figures: Path | None) -> Iterator[str]:
    if figures is not None:
        from rig.analysis.figures import draw

        yield from list_written(draw(result, figures))


def identify(
    datasets: DatasetsArgument,
    joint_readings: _JointReadings = True,
    prior: _Prior = None,
    proposals: _Proposals = 6,
    criterion: _Criterion = "A",
    write_model: _WriteModel = None,
    write_protocol: _WriteProtocol = None,
    export_mujoco: MujocoOption = None,
    export_urdf: UrdfOption = None,
    json_file: JsonOption = None,
) -> None:
    """Joint torsional stiffnesses, and what the data can and cannot tell about them."""
    from rig.analysis.identify import identify as run_identify
    from rig.analysis.identify import prior_of

    if write_protocol is not None and not proposals:
        raise InputError(
            f"--write-protocol {write_protocol}: with --proposals 0 no next poses are looked for. "
            "Give --proposals 1 or more, or leave --write-protocol out."
        )
    result = run_identify(
        datasets,
        prior=None if prior is None else prior_of(prior),
        joint_readings=joint_readings,
        proposals=proposals,
        criterion=criterion,
    )
    files = _files(result, write_model, write_protocol, export_mujoco, export_urdf)
    give(result, json_file, files)


def _files(
    result: IdentifyResult,
    model: Path | None,
    protocol: Path | None,
    mujoco: Path | None,
    urdf: Path | None,
) -> Iterator[str]:
    """The arm as a model and for other simulators, and the next protocol, where asked for."""
    from rig.analysis import identify_text
    from rig.models import model_export

    if model is not None:
        identify_text.write_model(result, model)
        yield f"{model}: written"
    if protocol is not None:
        identify_text.write_protocol(result, protocol)
        yield f"{protocol}: written"
    yield from list_written(model_export.write(result, mujoco=mujoco, urdf_file=urdf))
