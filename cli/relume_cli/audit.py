"""`relume audit`: list changes, and the users who made them."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import Annotated

import typer

from relume_cli.options import Data
from relume_cli.terminal.printing import Json, print_result
from relume_cli.tokens import open_access


def audit(
    data: Data = None,
    last: Annotated[int, typer.Option("--last", min=1, max=1_000, help="Number of changes.")] = 50,
    who: Annotated[str | None, typer.Option("--who", help="Only changes by this user.")] = None,
    as_json: Json = False,
) -> None:
    """List changes and their users, the newest last."""
    for entry in reversed(open_access(data, is_used=True).audit.list(last, actor=who)):
        at = datetime.fromtimestamp(entry.at, UTC).strftime("%Y-%m-%d %H:%M:%S")
        line = f"{at}  {entry.who:20}  {entry.what}  {entry.object}  {entry.status}  {entry.request}"
        print_result(vars(entry), line, as_json=as_json)
