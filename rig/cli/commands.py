"""All commands, in the order in which `rig --help` lists them."""

from __future__ import annotations

from collections.abc import Callable

import typer

from rig.cli import files, gap, measuring, models, stiffness
from rig.cli.guard import Commands, Guarded
from rig.cli.options import version

app = typer.Typer(
    name="rig",
    cls=Commands,
    help="How stiff is this arm, and why does the simulation disagree with it?",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
)
app.callback()(version)


def _add(command: Callable[..., None], name: str | None = None, brief: str | None = None) -> None:
    """brief: for the list of commands, where the first sentence of its own help is too long."""
    app.command(name, cls=Guarded, short_help=brief)(command)


_add(measuring.measure, brief="Carry out a procedure on a station, and write the data set.")
_add(measuring.check, brief="The plan of a protocol, and whether every device is ready.")
_add(measuring.emulate)
_add(stiffness.analyze, brief="Curve, stiffness k, pointwise k, anisotropy; uncertainties.")
_add(stiffness.identify, brief="Joint stiffnesses, and what the data can't tell of them.")
_add(models.couple, brief="Two coupled arms: workspace, stiffness, when to couple.")
_add(models.simulate)
_add(gap.diagnose, brief="The sim-to-real gap: where it lies, and what causes it.")
_add(gap.blind, brief="Draw hidden effects, diagnose, open the answers, score.")
_add(files.report, brief="One page to send to a colleague; data sets are compared.")
_add(files.list_, "list", brief="The data sets of a folder, with what is known of them.")
_add(files.import_, "import")
_add(files.export)
