"""`relume token …`: manage access tokens."""

from __future__ import annotations

import getpass
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Annotated

import typer

from relume_cli.options import Data
from relume_cli.terminal.printing import Json, iso_time, note, print_result

if TYPE_CHECKING:
    from pathlib import Path

    from relume_server.auth.services import AuthServices

Name = Annotated[str, typer.Argument(metavar="NAME", help="User of the token, for audit and quotas.")]
RoleOption = Annotated[str, typer.Option("--role", metavar="ROLE", help="view, edit or admin.")]
Days = Annotated[float | None, typer.Option("--days", help="Days until it expires. [default: never]")]


def token_add(
    name: Name, role: RoleOption = "view", days: Days = None, as_json: Json = False, data: Data = None
) -> None:
    """Create a token; it is shown only once."""
    access = open_access(data)
    text = access.tokens.add(name, role, days)
    audit_change(access, f"token add --role {role}", name)
    print_result({"name": name, "role": role, "token": text}, text, as_json=as_json)
    if not as_json:
        note("Store it: it is shown only once. Servers require tokens with RELUME_LOGIN=true.")


def token_list(as_json: Json = False, data: Data = None) -> None:
    """List the tokens."""
    now = datetime.now(UTC).timestamp()
    for token in open_access(data, is_used=True).tokens.all():
        state = "valid" if token.is_valid(now) else "revoked" if token.revoked is not None else "expired"
        until = "" if token.expires is None else f"  until {_day(token.expires)}"
        document = {
            "id": token.id,
            "name": token.name,
            "role": token.role.label,
            "state": state,
            "created": iso_time(token.created),
            "expires": None if token.expires is None else iso_time(token.expires),
        }
        line = f"{token.id}  {token.role.label:5}  {state:7}  {_day(token.created)}  {token.name}{until}"
        print_result(document, line, as_json=as_json)


def token_revoke(
    name: Annotated[str, typer.Argument(metavar="NAME|ID", help="Name or id from relume token list.")],
    data: Data = None,
) -> None:
    """Revoke a token.

    Within seconds it is invalid, and its sessions end.
    """
    access = open_access(data)
    access.tokens.revoke(name)
    audit_change(access, "token revoke", name)


def open_access(data: Path | None, *, is_used: bool = False) -> AuthServices:
    """Tokens and audit of a data directory. Raises ParameterError if `is_used` and nothing is there."""
    from relume_cli.data_folder import check_used, open_settings
    from relume_server.auth.services import AuthServices
    from relume_worker.database import open_database
    from relume_worker.ledger import Ledger

    settings = open_settings(data)
    if is_used:
        check_used(settings)
    return AuthServices(Ledger(open_database(settings.database_url)).sessions, settings)


def audit_change(access: AuthServices, action: str, target: str) -> None:
    """Record a change in the audit, by the user of this shell."""
    from relume_server.auth.audit import Change

    access.audit.add(Change(f"{getpass.getuser()} (shell)", "admin", "", action, target, 0, ""))


def _day(posix_s: float) -> str:
    return datetime.fromtimestamp(posix_s, UTC).strftime("%Y-%m-%d")
