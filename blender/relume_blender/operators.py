"""Operators: send, send changes, open, pull. The work runs in a thread while Blender draws; Esc cancels it."""

from __future__ import annotations

import asyncio
import json
import tempfile
from collections.abc import Callable, Coroutine
from pathlib import Path
from typing import Any, ClassVar
from urllib.parse import urlsplit

import bpy

from relume_client import AccessError, AsyncClient, RelumeClientError

from .apply_look import apply_look
from .background_task import BackgroundTask
from .exchange import BakeSettings, PulledLook, Report, pull, send, send_changes
from .read_scene import read_scene
from .snapshot import Sent, Snapshot

_INTERVAL_S = 0.1
_RETRY_S = 10.0
_LOCAL = frozenset({"localhost", "127.0.0.1", "::1"})
_EXPECTED = (RelumeClientError, TimeoutError, LookupError, ValueError, OSError, RuntimeError)
Work = Callable[[AsyncClient, Report], Coroutine[Any, Any, Any]]


def preferences(context: Any) -> Any:
    """Preferences of the add-on."""
    return context.preferences.addons[__package__].preferences


def server_url(context: Any) -> str:
    """Address of the server, without a slash at its end."""
    return str(preferences(context).url.strip().rstrip("/"))


def sent_record(scene: Any) -> Sent | None:
    """Record of what a server has of a scene."""
    return Sent.from_text(scene.relume.sent)


def omitted_sentences(context: Any) -> list[str]:
    """Sentences about what the last operator left out."""
    text = context.window_manager.relume_omitted
    return list(json.loads(text)) if text else []


class _ServerOperator:
    """Base of operators that call the server.

    Subclasses read Blender in `start`, and change it in `finish`, both in the main thread; the coroutine between
    them runs in a thread.
    """

    _running: ClassVar[Any] = None
    _task: BackgroundTask[Any]
    _timer: Any
    _scene: str
    _folder: tempfile.TemporaryDirectory[str]

    def start(self, context: Any) -> Work:
        """Return the work for the server."""
        raise NotImplementedError

    def finish(self, context: Any, scene: Any, result: Any) -> str:
        """Use the result; returns a sentence for the status."""
        raise NotImplementedError

    @classmethod
    def poll(cls, context: Any) -> bool:
        """One operator runs at a time."""
        return _ServerOperator._running is None and context.scene is not None

    def execute(self, context: Any) -> set[str]:
        """Run to the end: for scripts, and without a window."""
        return self._end(context) if self._begin(context) else {"CANCELLED"}

    def invoke(self, context: Any, event: Any) -> set[str]:
        """Run while Blender draws."""
        if context.window is None:
            return self.execute(context)
        if not self._begin(context):
            return {"CANCELLED"}
        _ServerOperator._running = self
        self._timer = context.window_manager.event_timer_add(_INTERVAL_S, window=context.window)
        context.window_manager.progress_begin(0, 100)
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: Any, event: Any) -> set[str]:
        """Show progress until the work has ended."""
        manager = context.window_manager
        if event.type == "ESC" and event.value == "PRESS":
            self._task.cancel()
            return {"RUNNING_MODAL"}
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        if not self._task.is_done:
            manager.progress_update(100 * self._task.progress)
            self._show(context, f"{self._task.text}, {self._task.progress:.0%} (Esc cancels)")
            return {"PASS_THROUGH"}
        self._leave(context)
        return self._end(context)

    def cancel(self, context: Any) -> None:
        """Blender ends the operator, as when another file is opened."""
        self._task.cancel()
        self._leave(context)

    def _leave(self, context: Any) -> None:
        _ServerOperator._running = None
        context.window_manager.event_timer_remove(self._timer)
        context.window_manager.progress_end()

    def _begin(self, context: Any) -> bool:
        url, token = server_url(context), preferences(context).token.strip() or None
        self._scene = context.scene.name
        self._folder = tempfile.TemporaryDirectory(prefix="relume-")
        try:
            _check_online(url)
            work = self.start(context)
        except _EXPECTED as error:
            return self._fail(context, error)

        async def call(report: Report) -> Any:
            async with AsyncClient(url, token, retry_seconds=_RETRY_S) as client:
                return await work(client, report)

        self._task = BackgroundTask(call)
        return True

    def _end(self, context: Any) -> set[str]:
        try:
            result = self._task.result()
            scene = bpy.data.scenes.get(self._scene)
            if scene is None:
                raise LookupError(f"The scene “{self._scene}” was deleted or renamed meanwhile.")
            sentence = self.finish(context, scene, result)
        except asyncio.CancelledError:
            self._fail(context, RuntimeError("Canceled; nothing has changed."))
            return {"CANCELLED"}
        except _EXPECTED as error:
            self._fail(context, error)
            return {"CANCELLED"}
        finally:
            self._folder.cleanup()
        self._show(context, sentence)
        for omitted in omitted_sentences(context):
            self.report({"WARNING"}, omitted)  # type: ignore[attr-defined]
        self.report({"INFO"}, sentence)  # type: ignore[attr-defined]
        return {"FINISHED"}

    def _fail(self, context: Any, error: Exception) -> bool:
        self._folder.cleanup()
        sentence = str(error.args[0] if isinstance(error, LookupError) and error.args else error)
        if isinstance(error, AccessError):
            sentence += " (the token is in the preferences of the add-on)"
        self._show(context, sentence)
        self.report({"ERROR"}, sentence)  # type: ignore[attr-defined]
        return False

    def _show(self, context: Any, sentence: str) -> None:
        context.window_manager.relume_status = sentence
        for window in context.window_manager.windows:
            for area in window.screen.areas:
                if area.type == "VIEW_3D":
                    area.tag_redraw()


class RELUME_OT_send(_ServerOperator, bpy.types.Operator):  # noqa: N801 - Blender's convention
    """Send the scene, its world, lights and cameras to relume, and bake it there."""

    bl_idname, bl_label = "relume.send", "Send to relume"

    def start(self, context: Any) -> Work:
        """Read the scene."""
        self._snapshot, settings = _read(context, self._folder.name), _bake_settings(context)
        url = server_url(context)
        return lambda client, report: send(client, url, self._snapshot, settings, report)

    def finish(self, context: Any, scene: Any, result: Sent) -> str:
        """Store the record. See `_ServerOperator`."""
        scene.relume.sent = result.to_text()
        return "The scene is in relume: open it in the browser."


class RELUME_OT_send_changes(_ServerOperator, bpy.types.Operator):  # noqa: N801 - Blender's convention
    """Send what has changed: materials, lights and world as a look, all else as a new scene."""

    bl_idname, bl_label = "relume.send_changes", "Send changes"

    def start(self, context: Any) -> Work:
        """Read the scene."""
        self._snapshot, settings = _read(context, self._folder.name), _bake_settings(context)
        url, sent = server_url(context), sent_record(context.scene)
        return lambda client, report: send_changes(client, url, self._snapshot, sent, settings, report)

    def finish(self, context: Any, scene: Any, result: tuple[Sent, str]) -> str:
        """Store the record. See `_ServerOperator`."""
        sent, sentence = result
        scene.relume.sent = sent.to_text()
        return sentence


class RELUME_OT_pull(_ServerOperator, bpy.types.Operator):  # noqa: N801 - Blender's convention
    """Bring materials and lights of a look back from relume: the look saved last, or the named one."""

    bl_idname, bl_label, bl_options = "relume.pull", "Pull look", {"REGISTER", "UNDO"}

    def start(self, context: Any) -> Work:
        """Read the record."""
        sent = sent_record(context.scene)
        if sent is None:
            raise ValueError("This scene was not sent yet: send it first.")
        if sent.url != server_url(context):
            raise ValueError(f"This scene was sent to {sent.url}: send it to this server, or change the server.")
        self._sent, name = sent, context.scene.relume.look
        return lambda client, report: pull(client, sent, name, report)

    def finish(self, context: Any, scene: Any, result: PulledLook) -> str:
        """Change materials and lights. See `_ServerOperator`."""
        omitted = [*result.omitted, *apply_look(scene, self._sent, result)]
        context.window_manager.relume_omitted = json.dumps(omitted)
        return f"Pulled look {result.name}: {len(result.materials)} materials, {len(result.lights)} lights."


class RELUME_OT_open(bpy.types.Operator):  # noqa: N801 - Blender's convention
    """Open the scene in the browser as it was sent last."""

    bl_idname, bl_label = "relume.open", "Open in browser"

    @classmethod
    def poll(cls, context: Any) -> bool:
        """The scene was sent."""
        return sent_record(context.scene) is not None

    def execute(self, context: Any) -> set[str]:
        """Open the link."""
        sent = sent_record(context.scene)
        if sent is None:
            return {"CANCELLED"}
        bpy.ops.wm.url_open(url=sent.link)
        return {"FINISHED"}


def _read(context: Any, folder: str) -> Snapshot:
    snapshot = read_scene(context, Path(folder))
    context.window_manager.relume_omitted = json.dumps(snapshot.omitted)
    return snapshot


def _bake_settings(context: Any) -> BakeSettings:
    return BakeSettings(context.scene.relume.method, context.scene.relume.preset)


def _check_online(url: str) -> None:
    """Respect Blender's switch for online access; a server on this machine is not online."""
    host = urlsplit(url if "://" in url else f"http://{url}").hostname
    if not bpy.app.online_access and host not in _LOCAL:
        raise ValueError("Online access is switched off: allow it in Preferences, System.")
