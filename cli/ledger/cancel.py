"""`relume cancel`: ends bakes that wait or run."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from cli.options import Data
from cli.terminal.printing import Json, note, print_result

if TYPE_CHECKING:
    from worker.status import BakeStatus


def cancel(
    bakes: Annotated[
        list[str], typer.Argument(metavar="BAKE…", help="Ids of bakes; or a scene: all of its that go on.")
    ],
    as_json: Json = False,
    data: Data = None,
) -> int:
    """Cancel bakes that wait or run, whoever runs them.

    What is done stays: the same relume bake goes on with it. Fails where a bake had ended already.
    """
    from cli.ledger.acting import find_bakes, opened
    from cli.terminal.documents import bake_document
    from cli.tokens import write_down

    has_failed = False
    with opened(data) as there:
        found = {one.id: one for name in bakes for one in _meant(find_bakes(there.service, name))}
        for one in found.values():
            if there.service.cancel(one.id):
                write_down(there.access, "cancel bake", one.id)
                print_result(bake_document(there.service.get(one.id), there.service), one.id, as_json=as_json)
            elif one.state != "cancelled":
                has_failed = True
                typer.echo(f"relume: bake {one.id} is {there.service.get(one.id).state}; nothing to cancel", err=True)
            else:
                note(f"bake {one.id} was cancelled already")
    return 1 if has_failed else 0


def _meant(found: list[BakeStatus]) -> list[BakeStatus]:
    """Those that go on; where none does, the newest, of which that is said."""
    return [one for one in found if not one.final] or found[:1]
