"""`relume demo`: bake and serve the built-in scene, and open the editor."""

from __future__ import annotations

import socket
import threading
import time
from typing import TYPE_CHECKING, Annotated
from urllib.parse import urlencode

import typer

from relume_cli.options import Data
from relume_cli.serve import Port, address, check_port

if TYPE_CHECKING:
    from relume.scene.model import Scene
    from relume.store.bake_protocol import Recipe
    from relume_server.settings import Settings

WAIT_FOR_SERVER_S = 60.0
# Selection when the editor opens: a highlight that fills part of the image.
SELECTED = {"material": "Bowl", "term": "1", "curve": "theta_h"}


def demo(
    data: Data = None,
    port: Port = None,
    browser: Annotated[bool, typer.Option(help="Open the editor in the browser.")] = True,
) -> None:
    """Bake the built-in scene if needed, serve it, and open the editor."""
    from relume.image_io.ocio.active_config import get_config
    from relume_cli.data_folder import open_settings, private_files
    from relume_server.app import serve
    from relume_server.auth.access_check import check_access_settings

    settings = open_settings(data, port=port)
    check_access_settings(settings)
    check_port(settings.host, settings.port)
    get_config()  # fail early if the config is invalid
    threading.Thread(target=_bake, args=(settings, browser), name="relume-demo", daemon=True).start()
    with private_files():
        serve(settings)


def _bake(settings: Settings, browser: bool) -> None:
    """Queue the demo's bake for the starting server, and show its progress in the terminal, too."""
    from relume_cli.error_message import error_message

    try:
        identity, editor = _queue_and_follow(settings, browser)
        typer.echo(f"bake {identity} is ready: {editor}   Ctrl-C stops the server", err=True)
    except Exception as error:  # the server keeps running, so report the error here
        typer.echo(f"relume: {error_message(error)}", err=True)


def _queue_and_follow(settings: Settings, browser: bool) -> tuple[str, str]:
    """Return the bake's id, and the editor's URL for its scene."""
    from relume.core.errors import PlanError
    from relume.scene.examples.still_life import demo_scene
    from relume_cli.bake_progress import follow
    from relume_cli.data_folder import open_bakes
    from relume_worker.scenes import register_scene

    service = open_bakes(settings)
    try:
        scene = demo_scene()
        register_scene(service.data_dir, service.ledger, scene)
        _, identity = [service.submit(scene.id, recipe) for recipe in demo_recipes(scene)]
        editor = f"{address(settings.host, settings.port)}?{urlencode({'scene': scene.id, **SELECTED})}"
        _wait_for_server(settings)
        if browser:
            _open_browser(editor)
        with service.subscribe(identity) as changes:
            status = follow(changes, scene.name)
        if status.state != "ready":
            raise PlanError(f"the bake {status.state}: {status.problem or 'it was stopped'}")
        return identity, editor
    finally:
        service.close()


def demo_recipes(scene: Scene) -> list[Recipe]:
    """Recipes of the demo: a preview, and the bake that replaces it.

    Identical to the editor's requests, so that the editor finds these bakes.
    """
    from relume.store.bake_protocol import Recipe
    from relume_worker.presets import PRESETS

    views = tuple(camera.name for camera in scene.cameras)
    return [Recipe("gather", views, PRESETS[name].size, PRESETS[name].num_lights) for name in ("preview", "good")]


def _wait_for_server(settings: Settings) -> None:
    """Return when the server accepts connections, or after a minute."""
    deadline = time.monotonic() + WAIT_FOR_SERVER_S
    while time.monotonic() < deadline:
        try:
            socket.create_connection((settings.host, settings.port), timeout=1).close()
        except OSError:
            time.sleep(0.1)
        else:
            return


def _open_browser(url: str) -> None:
    import webbrowser

    if not webbrowser.open(url):
        typer.echo(f"open {url} in a browser", err=True)
