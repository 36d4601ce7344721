"""`relume status`: progress of one bake or job, or of all running work."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING, Annotated, Any

import typer

from relume.core.errors import bytes_text
from relume_cli.options import Data
from relume_cli.terminal.printing import Json, print_result

if TYPE_CHECKING:
    from relume_cli.database.actions import OpenFolder
    from relume_worker.status import BakeStatus


def status(
    bake: Annotated[
        str | None,
        typer.Argument(metavar="[ID]", help="Id of a bake or job, or a scene for its newest bake. [default: all]"),
    ] = None,
    as_json: Json = False,
    data: Data = None,
) -> None:
    """Show the progress of one bake or job, or of all running work."""
    from relume_cli.database.actions import find_bakes, open_data_folder
    from relume_cli.database.jobs import describe_job, find_any_job, job_tables
    from relume_cli.terminal.documents import bake_document

    with open_data_folder(data) as data_folder:
        if bake is None:
            _print_all(data_folder, as_json=as_json)
            return
        if (job := find_any_job(data_folder, bake)) is not None:
            noun, row = job
            print_result(*describe_job(row, job_tables()[noun]), as_json=as_json)
            return
        newest = find_bakes(data_folder.service, bake)[0]
        print_result(bake_document(newest, data_folder.service), _line(newest), as_json=as_json)


def _line(bake: BakeStatus) -> str:
    from relume_cli.bake_progress import detail
    from relume_cli.terminal.documents import recipe_text

    details = {
        "ready": bytes_text(bake.bytes),
        "failed": bake.problem or "",
        "canceled": "the same relume bake resumes it",
    }
    state = details.get(bake.state) or detail(bake)
    return f"{bake.id}  {bake.state}  {bake.progress:.0%}  {state}  {recipe_text(bake.recipe)}"


def _print_all(data_folder: OpenFolder, *, as_json: bool) -> None:
    from importlib.metadata import version

    from relume_cli.terminal.documents import bake_document
    from relume_server.runtime.disk_space import free_bytes
    from relume_worker.scenes import list_scenes

    bakes = data_folder.service.bakes()
    active = [bake for bake in bakes if not bake.final]
    document: dict[str, Any] = {
        "version": version("relume"),
        "data": str(data_folder.settings.data),
        "free_bytes": free_bytes(data_folder.settings.data),
        "scenes": len(list_scenes(data_folder.service.ledger)),
        "bakes": dict(Counter(bake.state for bake in bakes)),
        "renders": _renders_by_state(data_folder),
        "active": [bake_document(bake, data_folder.service) for bake in active],
    }
    lines = [
        f"relume {document['version']}, {document['data']}, {bytes_text(document['free_bytes'])} free",
        f"{document['scenes']} scenes",
        *(_count_text(kind, document[kind]) for kind in ("bakes", "renders")),
        *map(_line, active),
    ]
    print_result(document, "\n".join(lines), as_json=as_json)


def _renders_by_state(data_folder: OpenFolder) -> dict[str, int]:
    from sqlalchemy import func, select

    from relume_worker.database.models import JobRow

    query = select(JobRow.state, func.count().label("num")).where(JobRow.kind == "render").group_by(JobRow.state)
    with data_folder.service.ledger.sessions() as session:
        return {row.state: row.num for row in session.execute(query)}


def _count_text(kind: str, by_state: dict[str, int]) -> str:
    """Return text such as "3 bakes (2 ready, 1 failed)"."""
    states = ", ".join(f"{num} {state}" for state, num in sorted(by_state.items()))
    return f"{sum(by_state.values())} {kind}" + (f" ({states})" if states else "")
