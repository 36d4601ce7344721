"""A live session: edits of a look go out, frames come in. It reconnects by itself and goes on with the same look."""

from __future__ import annotations

import asyncio
import json
import time
from collections.abc import Callable, Sequence
from types import TracebackType
from typing import Any, Literal, Self, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from relume_client.bodies import MAX_MESSAGE_BYTES, HelloMessage, ProblemMessage, StatusMessage, ViewInfo
from relume_client.errors import EditRejectedError, ProblemError, ServerUnavailableError
from relume_client.images import DISPLAYED, Frame, add_tiles, decode_displayed, parse_frame
from relume_client.looks import Change, Look, pointer, to_json, with_changes
from relume_client.session_socket import SessionSocket
from relume_client.transport import Transport

Encoding = Literal["hdr", "png", "jpeg"]
FrameListener = Callable[[Frame | None], None]
_MIN_EDIT_INTERVAL_S = 0.01
_MAX_PATCH_BYTES = MAX_MESSAGE_BYTES // 2
_MAX_OPERATIONS = 64
_PERSONAL = frozenset({"display", "transport"})
"""Sections of a look that the role `view` may edit."""


class AsyncSession:
    """One view of a bake, open for edits; made by `AsyncBake.session`.

        async with bake.session() as session:
            session["Teapot"].roughness = 0.3
            image = await session.frame(exact=True)

    Attributes:
        look: the complete look. Its edits are sent at once; those made together are one.
        hello: the server's first message: views, materials, method, role.
    """

    look: Look
    hello: HelloMessage

    def __init__(self, transport: Transport, bake: str, *, view: str | None, timeout: float) -> None:
        self._wanted_view, self._timeout = view, timeout
        self._socket = SessionSocket(transport, bake, self._receive, self._on_lost)
        self._changed = asyncio.Condition()
        self._loop = asyncio.get_running_loop()
        self._runner: asyncio.Task[None] | None = None
        self._is_greeted = False
        self._rejection: EditRejectedError | None = None
        self._unsent, self._timer, self._sent_s = list[Change](), cast("asyncio.TimerHandle | None", None), 0.0
        self._revision = self._recovery = 0
        self._sent_look: Any = None
        self._shown_look: Any = None
        self._sent_looks: dict[int, Any] = {}
        self._encoding: Encoding = "png"
        self._camera: dict[str, Any] | None = None
        self._camera_seq = 0
        self._frame: Frame | None = None
        self._linear: NDArray[np.float32] | None = None
        self._status: StatusMessage | None = None
        self._listeners = list[FrameListener]()

    async def __aenter__(self) -> Self:
        self._runner = asyncio.create_task(self._socket.run())
        try:
            await self._wait(lambda: self._socket.is_open, self._timeout, "the session was not opened")
        except BaseException:
            await self.close()
            raise
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        await self.close()

    async def close(self) -> None:
        """Leave the session."""
        if self._timer is not None:
            self._timer.cancel()
        if self._runner is not None:
            self._runner.cancel()
            await asyncio.gather(self._runner, return_exceptions=True)

    def __getitem__(self, name: str) -> Any:
        """A material or light of the look by name."""
        return self.look[name]

    def _ipython_key_completions_(self) -> list[str]:
        return self.look._ipython_key_completions_()

    @property
    def view(self) -> ViewInfo:
        """The view that is shown: name, size in pixels, camera; bounds of the scene for a free camera."""
        name = self._wanted_view or self.hello["focused_view"]
        return next(view for view in self.hello["views"] if view["name"] == name)

    @property
    def status(self) -> str:
        """State of the image: `exact` or a lower fidelity; `connecting` while there is no connection."""
        if not self._socket.is_open:
            return "connecting"
        if self._frame is None:
            return "preview"
        return "exact" if self._frame.header["exact"] else self._frame.header["fidelity"]

    def subscribe(self, listener: FrameListener) -> Callable[[], None]:
        """Call a function with each frame, and with None when the connection is lost, in the thread of the event loop;
        returns a function that ends it.
        """
        self._listeners.append(listener)
        return lambda: self._listeners.remove(listener)

    def set_encoding(self, encoding: Encoding) -> None:
        """Choose the pixels of frames: linear (`hdr`), displayed without loss (`png`), displayed and small (`jpeg`)."""
        if encoding != self._encoding:
            self._encoding = encoding
            self.refresh()

    def refresh(self) -> None:
        """Ask for the whole image again."""
        self._frame, self._linear = None, None
        self._socket.send({"type": "encoding", "format": self._encoding})
        self._socket.send({"type": "views", "names": [self.view["name"]]})

    def move_camera(
        self, to_world: ArrayLike, *, yfov: float | None = None, size: Sequence[int] | None = None, near: float = 0.0
    ) -> None:
        """Move a free camera. When it stops, an exact image follows.

        Args:
            to_world: camera to world, looking along −Z, meters. (4, 4)
            yfov: vertical field of view, degrees; by default as it is.
            size: width and height of the image in pixels; by default as it is.
            near: distance of the near clipping plane, meters.
        Raises:
            ValueError: the bake has fixed cameras, or the pose is not 4 × 4 finite numbers.
        """
        view = self.view
        if view["camera_mode"] != "free":
            raise ValueError("this bake has fixed cameras; bake with the method 'probes' to move the camera")
        pose = np.asarray(to_world, np.float64)
        if pose.shape != (4, 4):
            raise ValueError(f"a pose has 4 × 4 numbers, not the shape {pose.shape}")
        former = self._camera or {"yfov": view["camera"]["yfov"], "size": [view["width"], view["height"]]}
        camera = {
            "type": "camera", "view": view["name"], "seq": self._camera_seq + 1, "to_world": pose.ravel(), "near": near,
            "yfov": former["yfov"] if yfov is None else np.radians(yfov),
            "size": former["size"] if size is None else size,
        }  # fmt: skip
        self._camera = to_json(camera)
        self._camera_seq += 1
        self._socket.send(cast("dict[str, Any]", self._camera))

    async def frame(self, *, exact: bool = True, linear: bool = False, timeout: float | None = None) -> NDArray[Any]:
        """Image of the look with all edits so far.

        Args:
            exact: wait until it is the full evaluation of the look; otherwise the first complete image of it.
            linear: radiance, linear Rec. 709, with nine bits for the largest channel; otherwise as displayed, by the
                exposure and the tone map of the look.
            timeout: seconds; by default those of the session.
        Returns:
            (height, width, 3), float32 if linear, otherwise uint8; top row first.
        Raises:
            EditRejectedError: the server rejected an edit; the look is the one shown before it.
            TimeoutError: there was no such image in time; the message names the server's work.
            ServerUnavailableError: there was no connection in time.
            ProblemError: the server ended the session, for instance because the bake was deleted.
        """
        await asyncio.sleep(0)  # edits so far are queued in the loop
        self.set_encoding("hdr" if linear else "png")
        self._flush()
        failure = f"no {'exact ' if exact else ''}image"
        await self._wait(lambda: self._shows(exact), self._timeout if timeout is None else timeout, failure)
        frame = cast(Frame, self._frame)
        return cast("NDArray[np.float32]", self._linear).copy() if linear else decode_displayed(frame.payload)

    async def _wait(self, is_done: Callable[[], bool], limit_s: float, failure: str) -> None:
        """Wait for a state; raises what ended the session, or rejected an edit, first."""
        try:
            async with asyncio.timeout(limit_s), self._changed:
                await self._changed.wait_for(lambda: self._socket.failure or self._rejection or is_done())
        except TimeoutError:
            if not self._socket.is_open:
                raise ServerUnavailableError(f"{failure} within {limit_s:g} s: {self._socket.reason}") from None
            raise TimeoutError(f"{failure} within {limit_s:g} s: {self._work()}") from None
        if self._socket.failure is not None:
            raise self._socket.failure
        if self._rejection is not None:
            rejection, self._rejection = self._rejection, None
            raise rejection

    def _work(self) -> str:
        status = self._status
        return f"the image is {self.status}" if status is None else f"{status['state']} {status['label']}"

    def _shows(self, exact: bool) -> bool:
        """True if the last frame shows all edits and the camera, and is exact if it must be."""
        if self._frame is None or self._unsent:
            return False
        header = self._frame.header
        is_current = header["revision"] >= self._revision and (header["camera_seq"] or 0) >= self._camera_seq
        return is_current and header["complete"] and (header["exact"] or not exact)

    # Messages

    async def _notify(self) -> None:
        async with self._changed:
            self._changed.notify_all()

    async def _receive(self, message: str | bytes) -> None:
        if isinstance(message, bytes):
            self._on_frame(parse_frame(message))
        else:
            self._on_message(json.loads(message))
        await self._notify()

    def _on_message(self, message: dict[str, Any]) -> None:
        match message["type"]:
            case "hello":
                self._on_hello(cast(HelloMessage, message))
            case "problem":
                self._on_problem(cast(ProblemMessage, message))
            case "status":
                self._status = None if message["state"] == "ready" else cast(StatusMessage, message)
            case "server_draining":
                self._socket.abandon()

    def _on_hello(self, hello: HelloMessage) -> None:
        is_first, self._is_greeted = not self._is_greeted, True
        self.hello, self._socket.resume, self._socket.is_open = hello, hello["resume"], True
        self._status = None
        self._revision, self._sent_looks = hello["revision"], {}
        self._sent_look = self._shown_look = hello["look"]
        names = [view["name"] for view in hello["views"]]
        if self._wanted_view is not None and self._wanted_view not in names:
            sentence = f"the bake has no view {self._wanted_view!r}; it has {', '.join(names)}"
            self._socket.failure = ProblemError(404, "not-found", sentence)
            return
        if is_first:
            self.look = Look(hello["look"], self._on_change)
        elif hello["look"] != self.look.document:
            self._send_whole(self.look.document)
        self.refresh()
        if self._camera is not None:
            self._socket.send(self._camera)

    def _on_problem(self, message: ProblemMessage) -> None:
        problem, revision = message["problem"], message["revision"]
        is_about_image = problem["type"].endswith(":generation-failed")
        if revision is None and not is_about_image:
            return
        self._rejection = EditRejectedError(problem["detail"])
        if revision is None:
            return
        if revision == self._recovery:
            self._socket.failure = self._rejection
            return
        self.look._reset(self._shown_look)
        # the server may have merged this edit with earlier ones, so that its look is unknown
        self._send_whole(self._shown_look)
        self._recovery = self._revision

    async def _on_lost(self, sentence: str | None) -> None:
        """Go back to the last shown look if edits since then have ended the connection."""
        if sentence is not None and self._sent_looks:
            self._rejection = EditRejectedError(sentence)
            self.look._reset(self._shown_look)
            self._unsent, self._sent_looks, self._socket.resume = [], {}, ""
        for listener in tuple(self._listeners):
            listener(None)
        await self._notify()

    def _on_frame(self, frame: Frame) -> None:
        header = frame.header
        self._socket.send({"type": "ack", "frame": header["frame"]})
        if header["kind"] != "picture" or header["view"] != self.view["name"]:
            return
        if header["format"] in DISPLAYED and header["format"] == self._encoding:
            self._frame = frame
        elif header["format"] not in DISPLAYED and self._encoding == "hdr":
            self._frame, self._linear = frame, add_tiles(self._linear, frame)
        else:
            return  # of the encoding before
        for revision in [sent for sent in self._sent_looks if sent <= header["revision"]]:
            self._shown_look = self._sent_looks.pop(revision)
        for listener in tuple(self._listeners):
            listener(frame)

    # Edits

    def _on_change(self, changes: Sequence[Change]) -> None:
        """Queue an edit, in any thread."""
        self._loop.call_soon_threadsafe(self._queue, changes)

    def _queue(self, changes: Sequence[Change]) -> None:
        """Queue changes, and send them after the shortest time between two edits."""
        for path, value in changes:
            if self._unsent and self._unsent[-1][0] == path:
                self._unsent.pop()  # a drag: only the newest value matters
            self._unsent.append((path, value))
        if self._timer is None:
            wait_s = max(0.0, self._sent_s + _MIN_EDIT_INTERVAL_S - time.monotonic())
            self._timer = self._loop.call_later(wait_s, self._flush)

    def _flush(self) -> None:
        """Send all queued changes."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        if not self._socket.is_open:
            return
        changes, self._unsent = self._unsent, []
        for start in range(0, len(changes), _MAX_OPERATIONS):
            self._send_edit(changes[start : start + _MAX_OPERATIONS])
        self._sent_s = time.monotonic()

    def _send_edit(self, changes: Sequence[Change]) -> None:
        patch = [{"op": "add", "path": pointer(path), "value": value} for path, value in changes]
        if len(changes) > 1 and len(json.dumps(patch)) > _MAX_PATCH_BYTES:
            self._send_edit(changes[: len(changes) // 2])
            self._send_edit(changes[len(changes) // 2 :])
            return
        self._revision += 1
        self._sent_look = with_changes(self._sent_look, changes)
        self._sent_looks[self._revision] = self._sent_look
        self._socket.send({"type": "edit", "revision": self._revision, "patch": patch})

    def _send_whole(self, look: Any) -> None:
        """Bring the server to a look, whatever it has: each section, and each material."""
        changes = list[Change]()
        for section, value in look.items():
            if self.hello["role"] == "view" and section not in _PERSONAL:
                continue
            is_group = section == "materials"
            changes += [((section, name), item) for name, item in value.items()] if is_group else [((section,), value)]
        self._unsent, self._sent_look, self._sent_looks = changes, look, {}
        self._flush()
