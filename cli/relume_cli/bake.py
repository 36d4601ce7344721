"""`relume bake`: queue a bake and follow it."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from relume.core.errors import bytes_text
from relume_cli.options import Data, DryRun, SceneName, Scheduler, Size, parse_size, read_camera
from relume_cli.terminal.printing import Json, note, print_result

if TYPE_CHECKING:
    from relume.store.bake_protocol import Recipe
    from relume_server.settings import Settings
    from relume_worker.cameras import Views
    from relume_worker.scenes import SceneRecord
    from relume_worker.service import BakeService
    from relume_worker.status import BakeStatus

Method = Literal["direct", "gather", "probes"]
Preset = Literal["preview", "good", "final"]


def bake(
    scene: SceneName,
    method: Annotated[
        Method, typer.Option(help="With indirect light; direct: without, faster; probes: free camera.")
    ] = "gather",
    preset: Annotated[
        Preset, typer.Option(help="Quality: preview 320x240 and 300 lights, good 640x480, 2000, final 1024x768, 4000.")
    ] = "good",
    view: Annotated[
        list[str] | None, typer.Option(metavar="NAME", help="View to bake; repeat for several. [default: all]")
    ] = None,
    camera: Annotated[
        list[Path] | None,
        typer.Option(
            metavar="FILE.json",
            help='New view from a camera: {"name", "to_world": 16 numbers, "yfov": degrees, perhaps "lens"}.',
        ),
    ] = None,
    size: Size = None,
    lights: Annotated[
        int | None, typer.Option(metavar="N", help="Environment triangles. [default: by --preset]")
    ] = None,
    probes: Annotated[
        int | None, typer.Option(metavar="N", help="Probes on surfaces (free camera), method probes. [default: 50000]")
    ] = None,
    patches: Annotated[
        int | None, typer.Option(metavar="N", help="Surface patches for indirect light. [default: automatic]")
    ] = None,
    gather_rays: Annotated[
        int | None, typer.Option(metavar="N", help="Gather rays per view sample or probe. [default: 377]")
    ] = None,
    relightable: Annotated[
        bool, typer.Option("--relightable", help="Prepare for rotating or replacing the environment.")
    ] = False,
    watch: Annotated[
        bool, typer.Option(help="Bake here and show progress; --no-watch queues it for a running server.")
    ] = True,
    scheduler: Scheduler = None,
    dry_run: DryRun = False,
    as_json: Json = False,
    data: Data = None,
) -> int:
    """Queue a bake and follow it; print its id.

    The same recipe is the same bake. An interrupted bake resumes.

    This process bakes, unless a server on the same data directory starts first. Ctrl-C asks whether to continue in the
    background or to cancel.
    """
    from relume_cli.data_folder import find_scene, open_bakes, open_settings
    from relume_cli.name_lookup import match_name
    from relume_cli.terminal.documents import bake_document
    from relume_worker.cameras import resolve_views

    settings = open_settings(data, scheduler=scheduler)
    service = open_bakes(settings)
    try:
        record = find_scene(service.ledger, scene)
        view_names = [match_name(name, _view_names(service, record)) for name in view or ()]
        views = resolve_views(service.ledger, record, [*view_names, *(read_camera(path) for path in camera or ())])
        recipe = _recipe(method, preset, views, size, lights, probes, relightable)
        recipe = replace(recipe, num_patches=patches, gather_rays=gather_rays)
        if dry_run:
            _print_plan(service, record, recipe, as_json=as_json)
            return 0
        identity = service.submit(record.id, recipe)
        if watch:
            return _watch(service, settings, identity, record.name, as_json=as_json)
        print_result(bake_document(service.get(identity), service), identity, as_json=as_json)
        return 0
    finally:
        service.close()


def _view_names(service: BakeService, record: SceneRecord) -> list[str]:
    """Names of the views that a bake of a scene can have: those of the file, and those of placed cameras."""
    from relume_worker.cameras import list_cameras

    return [*record.views, *(camera.name for camera in list_cameras(service.ledger, record.id))]


def _print_plan(service: BakeService, record: SceneRecord, recipe: Recipe, *, as_json: bool) -> None:
    """Print the cost of a bake, as POST /api/bakes returns it with `dry_run`."""
    from relume_cli.terminal.documents import plan_document, plan_lines, recipe_document, recipe_text
    from relume_worker.status import bake_id

    plan, identity = service.plan(record.id, recipe), bake_id(record.id, recipe)
    document = {"id": identity, "recipe": recipe_document(recipe), "plan": plan_document(plan, service)}
    lines = [f"would bake {record.name}: {recipe_text(recipe)}", *plan_lines(plan, service)]
    print_result(document, identity, as_json=as_json, details=lines)


def _recipe(
    method: str,
    preset: Preset,
    views: Views,
    size: str | None,
    lights: int | None,
    requested_probes: int | None,
    relightable: bool,
) -> Recipe:
    from relume.core.errors import ParameterError
    from relume.store.bake_protocol import Recipe
    from relume_worker.presets import PRESETS, resolve_num_probes

    if lights is not None and lights < 1:
        raise ParameterError("--lights", lights, "a number of at least 1")
    if requested_probes is not None and requested_probes < 1:
        raise ParameterError("--probes", requested_probes, "a number of at least 1")
    fineness, (names, cameras) = PRESETS[preset], views
    pixels = parse_size(size) if size else fineness.size
    num_lights, num_probes = lights or fineness.num_lights, resolve_num_probes(method, requested_probes)
    return Recipe(method, names, pixels, num_lights, relightable, cameras, num_probes)


def _watch(service: BakeService, settings: Settings, identity: str, label: str, *, as_json: bool) -> int:
    from relume_cli.bake_progress import follow
    from relume_cli.interrupts import capture_interrupts
    from relume_cli.terminal.documents import bake_document

    start_s = time.monotonic()
    try:
        with capture_interrupts() as interrupted:
            service.start()
            with service.subscribe(identity) as changes:
                status = follow(changes, label, interrupted.is_set)
    except KeyboardInterrupt:
        return _interrupted(service, settings, identity)
    if status.state != "ready":
        typer.echo(f"relume: the bake {status.state}: {status.problem or 'it was stopped'}", err=True)
        return 1
    print_result(bake_document(status, service), status.id, as_json=as_json)
    _report(status, settings, time.monotonic() - start_s)
    return 0


def _report(status: BakeStatus, settings: Settings, seconds: float) -> None:
    """Print size, time and error of a finished bake."""
    from relume_worker.paths import bake_path
    from relume_worker.storage import fetch_if_missing

    note(f"{bytes_text(status.bytes)} in {seconds:.1f} s")
    if status.recipe.method == "direct":
        _report_rays(fetch_if_missing(bake_path(settings.data, status.id)))
    if status.recipe.method == "probes":
        _report_free_camera_error(fetch_if_missing(bake_path(settings.data, status.id)))


def _report_rays(store: Path) -> None:
    from relume.methods.store_layout import read_rays
    from relume.store.reader import open_store

    rays = read_rays(open_store(store))
    note(
        f"{rays.num_traced / 1e6:,.1f} of {rays.num_full / 1e6:,.1f} M shadow rays traced, the others predicted; "
        f"about {100 * rays.error_rate:.2g} % wrong"
    )


def _report_free_camera_error(store: Path) -> None:
    from relume.methods.baked_error import read_free_camera_error
    from relume.store.reader import open_store

    free_camera_error = read_free_camera_error(open_store(store))
    if free_camera_error is not None:
        (delta_e, spread), (rms, rms_spread) = free_camera_error
        note(
            f"while the camera moves: mean color difference ΔE {delta_e:.1f} ± {spread:.1f} on surfaces (1 is just "
            f"noticeable), {100 * rms:.1f} ± {100 * rms_spread:.1f} % RMS of radiance; exact once it stops"
        )


def _interrupted(service: BakeService, settings: Settings, identity: str) -> int:
    """Ask whether Ctrl-C cancels the bake or leaves it running."""
    keeps_baking = sys.stdin.isatty() and typer.confirm(
        "\nContinue in the background? (no cancels the bake)", default=True
    )
    if not keeps_baking:
        service.cancel(identity)
        typer.echo("canceled; finished tasks are saved, and the same command resumes", err=True)
        return 130
    service.close()
    command = [sys.executable, "-m", "relume_cli.background", str(settings.data)]
    subprocess.Popen(  # noqa: S603
        [*command, settings.scheduler or "", identity],
        env={**os.environ, "RELUME_DATABASE": settings.database_url},  # other users can read the arguments of a process
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    typer.echo(f"{identity} continues in the background; the same command shows it again", err=True)
    return 0
