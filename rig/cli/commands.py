"""All commands, in the order in which `rig --help` lists them."""

from __future__ import annotations

import typer

from rig.cli import files, gap, measuring, models, stiffness

app = typer.Typer(
    name="rig",
    help="How stiff is this arm, and why does the simulation disagree with it?",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
)
app.command()(measuring.measure)
app.command()(measuring.check)
app.command()(measuring.emulate)
app.command()(stiffness.analyze)
app.command()(stiffness.identify)
app.command()(models.couple)
app.command()(models.simulate)
app.command()(gap.diagnose)
app.command()(gap.blind)
app.command()(files.report)
app.command("list")(files.list_)
app.command("import")(files.import_)
app.command()(files.export)
