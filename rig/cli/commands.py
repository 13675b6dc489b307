"""All commands, in the order in which `rig --help` lists them."""

from __future__ import annotations

import typer

from rig.cli import files, gap, measuring, models, stiffness
from rig.cli.guard import Guarded
from rig.cli.options import version

app = typer.Typer(
    name="rig",
    help="How stiff is this arm, and why does the simulation disagree with it?",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
)
app.callback()(version)
app.command(cls=Guarded)(measuring.measure)
app.command(cls=Guarded)(measuring.check)
app.command(cls=Guarded)(measuring.emulate)
app.command(cls=Guarded)(stiffness.analyze)
app.command(cls=Guarded)(stiffness.identify)
app.command(cls=Guarded)(models.couple)
app.command(cls=Guarded)(models.simulate)
app.command(cls=Guarded)(gap.diagnose)
app.command(cls=Guarded)(gap.blind)
app.command(cls=Guarded)(files.report)
app.command("list", cls=Guarded)(files.list_)
app.command("import", cls=Guarded)(files.import_)
app.command(cls=Guarded)(files.export)
