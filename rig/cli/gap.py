"""Commands about the sim-to-real gap: diagnose, blind."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rig.cli.options import DatasetArgument, FiguresOption, JsonOption, give, list_written

if TYPE_CHECKING:
    from rig.dataset import Dataset
    from rig.diagnosis.diagnose import Diagnosis

_Model = Annotated[
    Path | None,
    typer.Option(metavar="MODEL.yaml", help="Springs and effects to believe, not META's."),
]
_Simulation = Annotated[
    Path | None,
    typer.Option(metavar="CURVES.csv", help="Curves of another simulator, instead of META's."),
]
_Add = Annotated[
    list[str] | None,
    typer.Option(metavar="WORD", help="An effect to put beside those of the explanation."),
]
_Withhold = Annotated[
    list[str] | None, typer.Option(metavar="WORD", help="An effect to take out of the library.")
]
_WriteModel = Annotated[
    Path | None,
    typer.Option(metavar="MODEL.yaml", help="Write the simulation with the effects found."),
]
_Next = Annotated[
    Path | None,
    typer.Option("--next", metavar="PROTOCOL.yaml", help="Write what to measure next."),
]
_Cases = Annotated[int, typer.Option(metavar="N", help="How many are drawn.", min=1)]
_Seed = Annotated[int, typer.Option(metavar="S", help="The same seed, the same cases.", min=0)]
_Word = Annotated[str, typer.Option(metavar="WORD", help="Draw this effect, alone, in every case.")]
_WithholdInHalf = Annotated[
    str,
    typer.Option(
        metavar="WORD",
        help="Take this effect out of the library and draw it in every second case: then "
        "`unknown` is right; each: every word in turn.",
    ),
]
_Jobs = Annotated[
    int | None,
    typer.Option(metavar="J", help="Diagnoses at a time; left out: all cores.", min=1),
]
_SnrMin = Annotated[
    float, typer.Option(help="Score gaps from so many times the noise; all are drawn.", min=0)
]
_Deadline = Annotated[
    float, typer.Option(metavar="SECONDS", help="A later answer counts as wrong.", min=1)
]
_Generator = Annotated[
    str,
    typer.Option(
        help="hidden: arms of this project's own worlds; benches: rigs without an arm; mujoco: "
        "another engine's arms; mujoco-small-turns: those without the curvature of large turns."
    ),
]
_Keep = Annotated[
    Path | None,
    typer.Option(metavar="DIR", help="Keep data sets and answers in this new folder."),
]


def diagnose(
    dataset: DatasetArgument,
    model: _Model = None,
    simulation: _Simulation = None,
    add: _Add = None,
    withhold: _Withhold = None,
    write_model: _WriteModel = None,
    next_file: _Next = None,
    figures: FiguresOption = None,
    json_file: JsonOption = None,
) -> None:
    """The sim-to-real gap: where it lies, which effect causes it, how far it shrinks."""
    from rig.dataset import load
    from rig.diagnosis.diagnose import diagnose as run_diagnose
    from rig.diagnosis.gap_model import check_writable
    from rig.terminal import terminal_progress

    with terminal_progress() as progress:
        measured = load(dataset)
        if write_model is not None:
            check_writable(measured, others=simulation is not None)
        if next_file is not None:
            from rig.diagnosis.next_protocol import check_arm

            check_arm(measured)
        result = run_diagnose(
            measured,
            model=model,
            simulation=simulation,
            add=add or (),
            withhold=withhold or (),
            progress=progress,
        )
    if not (model or simulation or add or withhold):
        from rig.catalogue import remember_result

        remember_result(dataset, result.to_json())
    give(result, json_file, _files(result, dataset, measured, write_model, next_file, figures))


def _files(
    result: Diagnosis,
    dataset: Path,
    measured: Dataset,
    model: Path | None,
    protocol: Path | None,
    figures: Path | None,
) -> Iterator[str]:
    """The model with its effects, the next protocol and the figures, where asked for."""
    if model is not None:
        from rig.diagnosis.gap_forms import left_behind
        from rig.diagnosis.gap_model import OF_THIS_SESSION, forms, write_model

        write_model(result, measured, model)
        for word in left_behind(forms(result.result)):
            yield f"{model}: {word} is {OF_THIS_SESSION}"
        yield f"{model}: written. Next: rig simulate {model} PROTOCOL.yaml"
    if protocol is not None:
        from rig.diagnosis.next_protocol import write_next

        yield write_next(result, measured, protocol)
    if figures is not None:
        from rig.diagnosis.gap_figures import draw

        yield from list_written(draw(result, figures, dataset.name))


def blind(
    cases: _Cases = 100,
    seed: _Seed = 1,
    word: _Word = "",
    withhold: _WithholdInHalf = "",
    jobs: _Jobs = None,
    snr_min: _SnrMin = 3.0,
    deadline: _Deadline = 120.0,
    generator: _Generator = "hidden",
    keep: _Keep = None,
    json_file: JsonOption = None,
) -> None:
    """Draw measurements with hidden effects, diagnose them, open the answers, score."""
    from rig.blind import command
    from rig.blind.campaign import Plan
    from rig.terminal import terminal_progress

    plan = Plan(
        cases=cases,
        seed=seed,
        word=word,
        withhold=withhold,
        jobs=jobs or command.all_cores(),
        deadline_s=deadline,
        generator=generator,
        snr_min=snr_min,
    )
    with terminal_progress() as progress:
        result = command.blind(plan, keep=keep, progress=progress)
    give(result, json_file)
    if result.interrupted:
        raise typer.Exit(130)
