"""`relume token …`: who may do what."""

from __future__ import annotations

import getpass
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Annotated

import typer

from cli.options import Data

if TYPE_CHECKING:
    from pathlib import Path

    from server.access.access import Access

Name = Annotated[str, typer.Argument(metavar="NAME", help="Who it is for; the audit and quotas know them by it.")]
RoleOption = Annotated[str, typer.Option("--role", metavar="ROLE", help="view, edit or admin.")]
Days = Annotated[float | None, typer.Option("--days", help="How long it opens anything; for ever where not given.")]


def token_add(name: Name, role: RoleOption = "view", days: Days = None, data: Data = None) -> None:
    """Hand out a token; it is shown this once."""
    access = open_access(data)
    text = access.tokens.add(name, role, days)
    _write_down(access, f"token add --role {role}", name)
    typer.echo(text)
    typer.echo("Keep it: it is shown this once. RELUME_LOGIN=true makes the server ask for tokens.", err=True)


def token_list(data: Data = None) -> None:
    """List the tokens that were handed out."""
    now = datetime.now(UTC).timestamp()
    for token in open_access(data, is_used=True).tokens.all():
        state = "valid" if token.is_valid(now) else "revoked" if token.revoked is not None else "run out"
        until = "" if token.expires is None else f"  until {_day(token.expires)}"
        typer.echo(f"{token.id}  {token.role.word:5}  {state:7}  {_day(token.created)}  {token.name}{until}")


def token_revoke(
    name: Annotated[str, typer.Argument(metavar="NAME|ID", help="As relume token list shows it.")], data: Data = None
) -> None:
    """Revoke a token: within seconds it opens nothing, and its sessions end."""
    access = open_access(data)
    access.tokens.revoke(name)
    _write_down(access, "token revoke", name)


def open_access(data: Path | None, *, is_used: bool = False) -> Access:
    """Tokens and audit of a data folder. Raises ParameterError where `is_used` is to be and nothing is there yet."""
    from cli.data_folder import open_settings
    from relume.errors import ParameterError
    from server.access.access import Access
    from worker.database import open_database
    from worker.ledger import Ledger

    settings = open_settings(data)
    if is_used and not settings.database and not (settings.data / "relume.db").exists():
        raise ParameterError("--data", str(settings.data), "a folder that relume has used; this one is empty")
    return Access(Ledger(open_database(settings.database_url)).sessions, settings)


def _write_down(access: Access, what: str, thing: str) -> None:
    from server.access.audit import Change

    access.audit.add(Change(f"{getpass.getuser()} (shell)", "admin", "", what, thing, 0, ""))


def _day(posix_s: float) -> str:
    return datetime.fromtimestamp(posix_s, UTC).strftime("%Y-%m-%d")
