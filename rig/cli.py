"""The command `rig`: arguments only. Every command imports what it needs when it runs."""

from __future__ import annotations

import json
import sys
import tempfile
import traceback
from collections.abc import Iterable
from pathlib import Path
from types import TracebackType
from typing import Annotated, Any, Literal

import typer

app = typer.Typer(
    name="rig",
    help="How stiff is this arm, and why does the simulation disagree with it?",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
)

JsonOption = Annotated[
    str | None, typer.Option("--json", metavar="FILE", help="Write the result as JSON; - : stdout.")
]
StationOption = Annotated[
    str | None,
    typer.Option(
        help="A station's name or file, instead of the protocol's; emulated: none needed."
    ),
]
FiguresOption = Annotated[
    Path | None, typer.Option(metavar="DIR", help="Draw the figures into this folder.")
]
MujocoOption = Annotated[
    Path | None, typer.Option(metavar="FILE.xml", help="Write the arm for MuJoCo.")
]
UrdfOption = Annotated[Path | None, typer.Option(metavar="FILE.urdf", help="Write it as URDF.")]
ProtocolArgument = Annotated[Path, typer.Argument(metavar="PROTOCOL.yaml")]
DatasetArgument = Annotated[Path, typer.Argument(metavar="DATASET.h5")]


def say(text: str) -> None:
    """Progress and notes go to standard error: standard output belongs to results."""
    typer.echo(text, err=True)


def give(result: Any, json_file: str | None) -> None:
    """Prints the text of a result, or writes its JSON where asked."""
    if json_file is not None:
        text = json.dumps(result.to_json(), indent=2, allow_nan=False)
        if json_file == "-":
            typer.echo(text)
            return
        Path(json_file).write_text(text + "\n", encoding="utf-8")
    typer.echo(result.to_text())


def _list_written(paths: Iterable[Path]) -> None:
    for path in paths:
        say(f"{path}: written")


@app.command()
def measure(
    protocol: Annotated[Path | None, typer.Argument(metavar="PROTOCOL.yaml")] = None,
    station: StationOption = None,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="DATASET.h5", help="The new data set.")
    ] = None,
    resume: Annotated[
        Path | None,
        typer.Option(metavar="DATASET.h5", help="Go on where an interrupted run stopped."),
    ] = None,
    panel: Annotated[
        bool, typer.Option("--panel", help="Serve the operator's page, and print its link.")
    ] = False,
    panel_host: Annotated[
        str | None,
        typer.Option(
            metavar="ADDRESS", help="Serve it there instead of 127.0.0.1, to a network: no cipher."
        ),
    ] = None,
    panel_port: Annotated[
        int | None,
        typer.Option(min=1, max=65535, help="Its port; left out: 8321, or a free one."),
    ] = None,
    speed: Annotated[
        float | None,
        typer.Option(min=0.01, max=1000, help="Of an emulated station, times real time."),
    ] = None,
) -> None:
    """Carry out a procedure on a station, guide the operator, write the data set."""
    from rig import measure as measuring
    from rig.errors import InputError
    from rig.panel.link import DEFAULT_HOST, PanelOptions

    if (protocol is None) == (resume is None):
        raise InputError("rig measure: give a PROTOCOL.yaml, or --resume DATASET.h5.")
    page = None
    if panel or panel_host is not None or panel_port is not None:
        page = PanelOptions(panel_host or DEFAULT_HOST, panel_port)
    if resume is not None:
        path = measuring.resume(resume, say, page, speed)
    else:
        assert protocol is not None
        path = measuring.measure(protocol, station, output, say, page, speed)
    say(f"{path}: complete. Next: rig analyze {path}")


@app.command()
def check(
    protocol: ProtocolArgument, station: StationOption = None, json_file: JsonOption = None
) -> None:
    """Validate a protocol, show its plan, and ask every device whether it is ready."""
    from rig.check import check as run_check

    result = run_check(protocol, station)
    give(result, json_file)
    if result.first_error is not None:
        raise result.first_error


@app.command()
def emulate(station: Annotated[str, typer.Argument(metavar="STATION.yaml")] = "emulated") -> None:
    """Start the emulators of a station by hand, until Ctrl-C."""
    from rig.emulation import serve_by_hand
    from rig.station import load_station

    serve_by_hand(load_station(station))


@app.command()
def analyze(
    dataset: DatasetArgument,
    weighting: Annotated[
        str,
        typer.Option(
            help="proportional, 1/s^2 or none: how the points are weighted; "
            "auto: proportional where levels were held and a zero was measured."
        ),
    ] = "auto",
    intercept: Annotated[
        bool | None,
        typer.Option(
            "--intercept/--through-origin",
            help="Let the line miss the origin, or not; left out: as the data allow.",
        ),
    ] = None,
    errors_in_variables: Annotated[
        bool, typer.Option(help="Count the force's uncertainty as well as the displacement's.")
    ] = False,
    keep_after_knee: Annotated[
        bool, typer.Option(help="Count the steps after a knee towards k.")
    ] = False,
    figures: FiguresOption = None,
    json_file: JsonOption = None,
) -> None:
    """Curve, stiffness k, pointwise k and anisotropy, with uncertainties."""
    from rig import analyze as analysis
    from rig.dataset import load

    options = analysis.Options(
        weighting=analysis.weighting(weighting),
        intercept=intercept,
        errors_in_variables=errors_in_variables,
        keep_after_knee=keep_after_knee,
    )
    result = analysis.analyze(load(dataset), options)
    give(result, json_file)
    if options == analysis.Options():
        from rig.catalogue import remember_result

        remember_result(dataset, result)
    if figures is not None:
        from rig.figures import draw

        _list_written(draw(result, figures))


@app.command()
def identify(
    datasets: Annotated[list[Path], typer.Argument(metavar="DATASET.h5 ...")],
    joint_readings: Annotated[
        bool, typer.Option(help="Use the joint readings where they see the deflection.")
    ] = True,
    prior: Annotated[
        Path | None,
        typer.Option(metavar="MODEL.yaml", help="Prior stiffnesses, instead of the robot file's."),
    ] = None,
    proposals: Annotated[int, typer.Option(help="How many next poses to look for.", min=0)] = 6,
    criterion: Annotated[
        Literal["A", "D", "E"], typer.Option(help="What the next poses make smallest.")
    ] = "A",
    write_model: Annotated[
        Path | None, typer.Option(metavar="MODEL.yaml", help="Write the arm as a model file.")
    ] = None,
    write_protocol: Annotated[
        Path | None, typer.Option(metavar="PROTOCOL.yaml", help="Write the next measurement.")
    ] = None,
    export_mujoco: MujocoOption = None,
    export_urdf: UrdfOption = None,
    json_file: JsonOption = None,
) -> None:
    """Joint torsional stiffnesses, and what the data can and cannot tell about them."""
    from rig import identify_text, model_export
    from rig.identify import identify as run_identify
    from rig.identify import prior_of

    result = run_identify(
        datasets,
        prior=None if prior is None else prior_of(prior),
        joint_readings=joint_readings,
        proposals=proposals,
        criterion=criterion,
    )
    give(result, json_file)
    if write_model is not None:
        identify_text.write_model(result, write_model)
        say(f"{write_model}: written")
    if write_protocol is not None:
        identify_text.write_protocol(result, write_protocol)
        say(f"{write_protocol}: written")
    _list_written(model_export.write(result, mujoco=export_mujoco, urdf_file=export_urdf))


@app.command()
def couple(
    model: Annotated[Path, typer.Argument(metavar="MODEL.yaml")],
    path: Annotated[
        Path | None,
        typer.Option(metavar="PATH.csv", help="When to couple along a path with requirements."),
    ] = None,
    dead_band: Annotated[
        float, typer.Option(help="Relative dead band against chatter along the path.", min=0)
    ] = 0.0,
    samples: Annotated[
        int, typer.Option(help="Samples of the Monte Carlo workspace.", min=1000)
    ] = 1_000_000,
    best_placement: Annotated[
        bool, typer.Option(help="Look for the base distance and angle that meet `required` best.")
    ] = False,
    figures: FiguresOption = None,
    export_mujoco: MujocoOption = None,
    export_urdf: UrdfOption = None,
    json_file: JsonOption = None,
) -> None:
    """Coupled state of two arms: workspace, compound stiffness, when to couple."""
    from rig import model_export
    from rig.couple import couple as run_couple
    from rig.coupling_task import best_for
    from rig.model import load_model
    from rig.terminal import terminal_progress

    with terminal_progress() as progress:
        result = run_couple(
            model,
            samples=samples,
            path=path,
            dead_band=dead_band,
            progress=lambda share: progress("sampling the workspace", share),
        )
    give(result, json_file)
    placement = best_for(model) if best_placement else None
    if placement is not None and json_file != "-":
        typer.echo(placement.to_text())
    if figures is not None:
        from rig.coupling_figures import draw

        _list_written(draw(result, figures, placement))
    written = model_export.write(load_model(model), mujoco=export_mujoco, urdf_file=export_urdf)
    _list_written(written)


@app.command()
def simulate(
    model: Annotated[Path, typer.Argument(metavar="MODEL.yaml")],
    protocol: ProtocolArgument,
    csv: Annotated[
        Path | None, typer.Option(metavar="CURVES.csv", help="Write the curves as a table.")
    ] = None,
    json_file: JsonOption = None,
) -> None:
    """The curves that a model predicts for a procedure."""
    from rig.simulate import simulate as run_simulate
    from rig.simulate import write_csv

    result = run_simulate(model, protocol)
    give(result, json_file)
    if csv is not None:
        write_csv(result, csv)
        say(f"{csv}: written")


@app.command()
def diagnose(
    dataset: DatasetArgument,
    model: Annotated[
        Path | None,
        typer.Option(metavar="MODEL.yaml", help="Springs and effects to believe, not META's."),
    ] = None,
    simulation: Annotated[
        Path | None,
        typer.Option(metavar="CURVES.csv", help="Curves of another simulator, instead of META's."),
    ] = None,
    add: Annotated[
        list[str] | None,
        typer.Option(metavar="WORD", help="An effect that the explanation must contain."),
    ] = None,
    withhold: Annotated[
        list[str] | None,
        typer.Option(metavar="WORD", help="An effect to take out of the library."),
    ] = None,
    write_model: Annotated[
        Path | None,
        typer.Option(metavar="MODEL.yaml", help="Write the simulation with the effects found."),
    ] = None,
    next_file: Annotated[
        Path | None,
        typer.Option("--next", metavar="PROTOCOL.yaml", help="Write what to measure next."),
    ] = None,
    figures: FiguresOption = None,
    json_file: JsonOption = None,
) -> None:
    """The sim-to-real gap: where it lies, which effect causes it, how far it shrinks."""
    from rig.dataset import load
    from rig.diagnose import diagnose as run_diagnose
    from rig.terminal import terminal_progress

    with terminal_progress() as progress:
        measured = load(dataset)
        result = run_diagnose(
            measured,
            model=model,
            simulation=simulation,
            add=add or (),
            withhold=withhold or (),
            progress=progress,
        )
    give(result, json_file)
    if not (model or simulation or add or withhold):
        from rig.catalogue import remember_result

        remember_result(dataset, result)
    if write_model is not None:
        from rig.gap_model import write_model as write

        write(result, measured, write_model)
        say(f"{write_model}: written. Next: rig simulate {write_model} PROTOCOL.yaml")
    if next_file is not None:
        from rig.next_protocol import write_next

        say(write_next(result, measured, next_file))
    if figures is not None:
        from rig.gap_figures import draw

        _list_written(draw(result, figures, dataset.name))


@app.command()
def blind(
    cases: Annotated[int, typer.Option(metavar="N", help="How many are drawn.", min=1)] = 100,
    seed: Annotated[
        int, typer.Option(metavar="S", help="The same seed, the same cases.", min=0)
    ] = 1,
    withhold: Annotated[
        str,
        typer.Option(
            metavar="WORD",
            help="Take this effect out of the library and draw it in every second case: then "
            "`unknown` is right; each: every word in turn.",
        ),
    ] = "",
    jobs: Annotated[
        int | None,
        typer.Option(metavar="J", help="Diagnoses at a time; left out: all cores.", min=1),
    ] = None,
    snr_min: Annotated[
        float, typer.Option(help="Score gaps from so many times the noise; all are drawn.", min=0)
    ] = 3.0,
    deadline: Annotated[
        float, typer.Option(metavar="SECONDS", help="A later answer counts as wrong.", min=1)
    ] = 120.0,
    generator: Annotated[
        str,
        typer.Option(
            help="hidden: worlds of this project; mujoco: another engine's; mujoco-small-turns: "
            "that one without the curvature that large turns make."
        ),
    ] = "hidden",
    keep: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Keep data sets and answers in this new folder."),
    ] = None,
    json_file: JsonOption = None,
) -> None:
    """Draw measurements with hidden effects, diagnose them, open the answers, score."""
    from rig.blind import command
    from rig.blind.campaign import Plan
    from rig.terminal import terminal_progress

    plan = Plan(
        cases=cases,
        seed=seed,
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


@app.command()
def report(
    datasets: Annotated[list[Path], typer.Argument(metavar="DATASET.h5 ...")],
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="FILE.html", help="The page.")
    ] = None,
    pdf: Annotated[
        Path | None, typer.Option(metavar="FILE.pdf", help="The same as PDF (needs typst).")
    ] = None,
    figures: FiguresOption = None,
    couple: Annotated[
        Path | None, typer.Option(metavar="MODEL.yaml", help="With two arms coupled, too.")
    ] = None,
    gap: Annotated[bool, typer.Option("--gap/--no-gap", help="With the diagnosis or not.")] = True,
    json_file: JsonOption = None,
) -> None:
    """One page with figures and tables; several data sets are compared with the first."""
    from rig.report import report as reports
    from rig.terminal import terminal_progress

    page = reports.checked(output or reports.default_output(datasets), pdf)
    with terminal_progress() as progress:
        result = reports.make(
            datasets,
            reports.Wishes(
                couple=couple,
                gap=gap,
                made=reports.now(),
                png=figures is not None,
                processes=reports.usable_cores() - 1,
            ),
            progress,
        )
    give(result, json_file)
    reports.write_html(result, page)
    _list_written([page])
    if pdf is not None:
        reports.write_pdf(result, pdf)
        _list_written([pdf])
    if figures is not None:
        _list_written(reports.write_figures(result, figures))


@app.command("list")
def list_(
    folder: Annotated[Path, typer.Argument(metavar="FOLDER")] = Path(),
    analyze: Annotated[
        bool, typer.Option("--analyze", help="Compute k where it is not known yet.")
    ] = False,
    json_file: JsonOption = None,
) -> None:
    """The data sets of a folder: date, robot, directions, k, verdict, complete or not."""
    from rig.listing import list_folder
    from rig.terminal import terminal_progress

    with terminal_progress() as progress:
        result = list_folder(folder, analyze=analyze, progress=progress)
    give(result, json_file)


@app.command("import")
def import_(
    table: Annotated[Path, typer.Argument(metavar="TABLE.csv")],
    meta: Annotated[Path, typer.Argument(metavar="META.yaml")],
    output: Annotated[Path, typer.Option("-o", "--output", metavar="DATASET.h5")],
) -> None:
    """Bring in measurements that were taken with other software."""
    from rig.tables import import_table
    from rig.terminal import terminal_progress

    with terminal_progress() as progress:
        result = import_table(table, meta, output, progress)
    for event in result.events:
        if event["kind"] == "note":
            say(f"note: {event['text']}")
    say(f"{output}: {result.rows} rows. Next: rig analyze {output}")


@app.command()
def export(
    dataset: DatasetArgument,
    output: Annotated[Path, typer.Option("-o", "--output", metavar="FILE.csv|.parquet")],
) -> None:
    """Write a data set as CSV or Parquet."""
    from rig.dataset import load
    from rig.tables import export_table

    export_table(load(dataset), output)
    say(f"{output}: written")


def main() -> None:
    """Runs the command and turns every ending into its exit status; no traceback for users."""
    from rig.errors import InputError, MeasurementStopped
    from rig.intruders import refuse_intruders

    sys.excepthook = _report_bug
    try:
        refuse_intruders()
        _run()
    except InputError as error:
        _end(2, str(error))
    except MeasurementStopped as error:
        _end(4, f"Stopped: {error}")


def _run() -> None:
    # Only now: another distribution's `drivers` would fail here before it could be named.
    from drivers.errors import DeviceError, SafetyStop

    try:
        # Ends the process itself: 0 done, 2 wrong arguments, 130 interrupted. Calling `app`
        # would put typer's hook, which prints tracebacks, in place of ours.
        typer.main.get_command(app)()
    except SafetyStop as error:
        _end(4, f"Stopped for safety. {error}")
    except DeviceError as error:
        _end(3, str(error))


def _end(status: int, message: str) -> None:
    say(message)
    sys.exit(status)


def _report_bug(
    kind: type[BaseException], error: BaseException, trace: TracebackType | None
) -> None:
    """What nobody foresaw: the traceback goes to a file, one message to the user."""
    with tempfile.NamedTemporaryFile(
        "w", prefix="rig-bug-", suffix=".txt", delete=False, encoding="utf-8"
    ) as file:
        traceback.print_exception(kind, error, trace, file=file)
    say(f"This is a bug in rig ({kind.__name__}: {error}). Please report it with {file.name}.")
