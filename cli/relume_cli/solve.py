"""`relume solve`: lights and materials of a look from a reference picture or from strokes."""

from __future__ import annotations

import base64
import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from relume_cli.options import BakeName, Data, LookFile, View, read_bounded, read_json, read_look
from relume_cli.terminal.printing import Json, note, print_result

if TYPE_CHECKING:
    from relume_server.schemas.solve import SolveBody, SolveRequest


def solve(
    bake: BakeName,
    output: Annotated[Path, typer.Option(metavar="LOOK.json", help="Look document to write.")],
    look: LookFile = None,
    view: View = None,
    reference: Annotated[
        Path | None, typer.Option(metavar="PICTURE", help="Reference picture: PNG, JPEG, WebP, HDR or EXR.")
    ] = None,
    strokes: Annotated[
        Path | None, typer.Option(metavar="STROKES.json", help="List of strokes, as in POST /api/solve.")
    ] = None,
    fit_exposure: Annotated[
        bool, typer.Option("--fit-exposure", help="Only the relative brightness of the picture counts.")
    ] = False,
    material: Annotated[
        list[str] | None, typer.Option(metavar="NAME", help="Material that may change; repeat for several.")
    ] = None,
    lock: Annotated[
        list[str] | None,
        typer.Option(metavar="POINTER", help="Light that stays, such as /lights/Key or /environment; repeatable."),
    ] = None,
    rotate: Annotated[bool, typer.Option("--rotate", help="The environment may rotate.")] = False,
    as_json: Json = False,
    data: Data = None,
) -> None:
    """Find lights and materials from a picture or strokes.

    Prints the residual.
    """
    from relume.core.errors import ParameterError
    from relume.core.filesystem import atomic_write
    from relume.images.read_image import MAX_FILE_BYTES
    from relume_cli.data_folder import find_bake_and_view, open_bakes, open_settings

    if reference is None and strokes is None:
        raise ParameterError("--reference", "missing", "a picture, or --strokes")
    picture = None if reference is None else read_bounded("--reference", reference, MAX_FILE_BYTES)
    fields: dict[str, Any] = {
        "look": read_look(look),
        "strokes": [] if strokes is None else read_json("--strokes", strokes),
        "reference": None
        if picture is None
        else {"image": base64.b64encode(picture).decode(), "fit_exposure": fit_exposure},
        "materials": material or [],
        "locked": lock or [],
        "rotate": rotate,
    }
    service = open_bakes(open_settings(data))
    try:
        _, bake_status, view_name = find_bake_and_view(service, bake, view)
        request = _request({"bake": bake_status.id, "view": view_name, **fields})
        body = _solve(request, service.store_path(bake_status.id))
    finally:
        service.close()
    with atomic_write(output) as unfinished:
        unfinished.write_text(json.dumps(body.look, indent=2), encoding="utf-8")
    for shortfall in body.shortfalls:
        region = "the reference picture" if shortfall.stroke is None else f"stroke {shortfall.stroke}"
        note(f"warning: {region} cannot be reached ({shortfall.cause}); residual {100 * shortfall.residual:.1f} %")
    document = {"path": str(output), **body.model_dump(exclude={"look"})}
    print_result(document, f"{output}: residual {100 * body.residual:.1f} %", as_json=as_json)


def _request(fields: dict[str, Any]) -> SolveRequest:
    from pydantic import ValidationError

    from relume.core.errors import RelumeError
    from relume_server.schemas.solve import SolveRequest
    from relume_server.validation_errors import list_field_errors

    try:
        return SolveRequest.model_validate(fields)
    except ValidationError as error:
        located = [{**each, "loc": ("body", *each["loc"])} for each in error.errors()]
        raise RelumeError("; ".join(each["detail"] for each in list_field_errors(located, fields))) from None


def _solve(request: SolveRequest, store: Path) -> SolveBody:
    from relume_server.api.solve import solve_request
    from relume_server.runtime.library import open_library

    library = open_library(4 << 30, 0)
    return solve_request(request, library.open_transfer(store), library)
