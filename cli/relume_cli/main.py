"""The `relume` command. Each subcommand is a module; heavy modules are imported when a command runs."""

from __future__ import annotations

import logging
import sys
import traceback
from collections.abc import Sequence
from importlib.metadata import version
from typing import Annotated

import typer
from typer.exceptions import TyperException

from relume_cli import (
    audit,
    bake,
    bench,
    demo,
    environment_import,
    export,
    import_scene,
    render,
    serve,
    solve,
    tokens,
    worker,
)
from relume_cli.backup import backup, restore
from relume_cli.database import cancel, delete, listing, revision_draft, status, upgrade
from relume_cli.error_message import error_message
from relume_cli.material import exporting, importing, make_btf
from relume_cli.reference import reference
from relume_cli.terminal.printing import is_quiet


def _print_version(is_asked: bool) -> None:
    if is_asked:
        typer.echo(version("relume"))
        raise typer.Exit


app = typer.Typer(
    name="relume",
    epilog="Data are in the directory RELUME_DATA, by default in your user data directory. "
    "Every command accepts --verbose (tracebacks of errors) and --quiet (neither progress nor notes; results and "
    "warnings remain).",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
)
app.command("demo", short_help="Bake, serve and open the built-in scene.")(demo.demo)
app.command("import")(import_scene.import_scene)
app.command("list")(listing.list_items)
app.command("bake")(bake.bake)
app.command("status")(status.status)
app.command("cancel")(cancel.cancel)
app.command("render")(render.render)
app.command("solve")(solve.solve)
app.command("export")(export.export)
app.command("delete")(delete.delete)
app.command("serve", short_help="Serve the editor and the API.")(serve.serve)
app.command("worker", short_help="Bake for servers until stopped.")(worker.worker)
app.command("backup")(backup.backup)
app.command("restore")(restore.restore)
app.command("reference")(reference.reference)
app.command("bench")(bench.bench)
app.command("audit")(audit.audit)
token = typer.Typer(help="Access tokens and roles.", no_args_is_help=True, rich_markup_mode=None)
token.command("add")(tokens.token_add)
token.command("list")(tokens.token_list)
token.command("revoke")(tokens.token_revoke)
app.add_typer(token, name="token")
materials = typer.Typer(help="Measured materials and BTFs.", no_args_is_help=True, rich_markup_mode=None)
materials.command("import")(importing.material_import)
materials.command("make-btf")(make_btf.material_make_btf)
materials.command("export")(exporting.material_export)
app.add_typer(materials, name="material")
environments = typer.Typer(help="Environments for looks.", no_args_is_help=True, rich_markup_mode=None)
environments.command("import")(environment_import.environment_import)
app.add_typer(environments, name="environment")
database = typer.Typer(help="The database of scenes, bakes and looks.", no_args_is_help=True, rich_markup_mode=None)
database.command("upgrade")(upgrade.db_upgrade)
database.command("draft")(revision_draft.db_draft)
app.add_typer(database, name="db")

INTERRUPTED = 130
FOR_ALL = ("--verbose", "--quiet")


@app.callback()
def root(
    is_version: Annotated[
        bool, typer.Option("--version", is_eager=True, callback=_print_version, help="Print the version.")
    ] = False,
) -> None:
    """Edit materials and lights in the finished render. Every drag updates the real shadows and reflections."""


def main(arguments: Sequence[str]) -> int:
    """Run one command and return its exit code; an error is one line on stderr."""
    verbose = "--verbose" in arguments
    is_quiet.set("--quiet" in arguments)
    handler = logging.StreamHandler()
    handler.setLevel(logging.INFO if verbose else logging.ERROR)  # libraries set the levels of their loggers
    logging.basicConfig(level=handler.level, format="%(levelname)s %(name)s: %(message)s", handlers=[handler])
    try:
        result = app([a for a in arguments if a not in FOR_ALL], prog_name="relume", standalone_mode=False)
    except (KeyboardInterrupt, typer.Abort):
        return INTERRUPTED
    except typer.Exit as done:
        return done.exit_code
    except Exception as error:
        if verbose:
            traceback.print_exc()
        typer.echo(f"relume: {error_message(error, arguments)}", err=True)
        return error.exit_code if isinstance(error, TyperException) else 1
    return result if isinstance(result, int) else 0


def run() -> None:
    """Entry point of the console script."""
    sys.exit(main(sys.argv[1:]))


if __name__ == "__main__":
    run()
