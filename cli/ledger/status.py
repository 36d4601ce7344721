"""`relume status`: how far a bake is, or all that goes on."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING, Annotated, Any

import typer

from cli.options import Data
from cli.terminal.printing import Json, print_result, size_text

if TYPE_CHECKING:
    from cli.ledger.acting import Opened
    from worker.status import BakeStatus


def status(
    bake: Annotated[
        str | None, typer.Argument(metavar="[BAKE]", help="Id of a bake, or a scene, whose newest is meant; else all.")
    ] = None,
    as_json: Json = False,
    data: Data = None,
) -> None:
    """Show how far a bake is, or all that goes on."""
    from cli.ledger.acting import find_bakes, opened
    from cli.terminal.documents import bake_document

    with opened(data) as there:
        if bake is None:
            _print_all(there, as_json=as_json)
            return
        newest = find_bakes(there.service, bake)[0]
        print_result(bake_document(newest, there.service), _line(newest), as_json=as_json)


def _line(one: BakeStatus) -> str:
    from cli.follow import detail
    from cli.terminal.documents import recipe_text

    more = {"ready": size_text(one.bytes), "failed": one.problem or "", "cancelled": "the same command goes on with it"}
    return f"{one.id}  {one.state}  {one.progress:.0%}  {more.get(one.state) or detail(one)}  {recipe_text(one.recipe)}"


def _print_all(there: Opened, *, as_json: bool) -> None:
    from importlib.metadata import version

    from cli.terminal.documents import bake_document
    from server.library.disk import free_bytes
    from worker.scenes import list_scenes

    bakes = there.service.bakes()
    active = [one for one in bakes if not one.final]
    document: dict[str, Any] = {
        "version": version("relume"),
        "data": str(there.settings.data),
        "free_bytes": free_bytes(there.settings.data),
        "scenes": len(list_scenes(there.service.ledger)),
        "bakes": dict(Counter(one.state for one in bakes)),
        "renders": _renders_by_state(there),
        "active": [bake_document(one, there.service) for one in active],
    }
    lines = [
        f"relume {document['version']}, {document['data']}, {size_text(document['free_bytes'])} free",
        f"{document['scenes']} scenes",
        *(_counted(kind, document[kind]) for kind in ("bakes", "renders")),
        *map(_line, active),
    ]
    print_result(document, "\n".join(lines), as_json=as_json)


def _renders_by_state(there: Opened) -> dict[str, int]:
    from sqlalchemy import func, select

    from server.records.tables import RenderRow

    counted = select(RenderRow.state, func.count().label("num")).group_by(RenderRow.state)
    with there.service.ledger.sessions() as session:
        return {row.state: row.num for row in session.execute(counted)}


def _counted(kind: str, by_state: dict[str, int]) -> str:
    """As in "3 bakes (2 ready, 1 failed)"."""
    states = ", ".join(f"{num} {state}" for state, num in sorted(by_state.items()))
    return f"{sum(by_state.values())} {kind}" + (f" ({states})" if states else "")
