"""Scenes, bakes and sessions for programs without an event loop: each call waits for its result.

All calls of a client run in one background thread, which also answers the server while the program does other work.
"""

from __future__ import annotations

import asyncio
import os
import threading
import weakref
from collections.abc import Callable, Coroutine, Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, Generic, Literal, Self, TypeVar, Unpack, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from relume_client.async_client import (
    AnyLook,
    AsyncBake,
    AsyncClient,
    AsyncJob,
    AsyncRender,
    AsyncScene,
    Body,
    Looks,
    Progress,
)
from relume_client.async_session import AsyncSession, Encoding, FrameListener
from relume_client.bodies import (
    BakeBody,
    BakeOptions,
    HelloMessage,
    ImportOptions,
    LookDocument,
    LookEntry,
    ModelBody,
    RenderBody,
    RenderOptions,
    SceneBody,
    SolveBody,
    SolveOptions,
    ViewInfo,
)
from relume_client.looks import Look

Result = TypeVar("Result")


class LoopThread:
    """An event loop in a background thread. It ends when nothing uses it any more, or with the program."""

    def __init__(self) -> None:
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, name="relume-client", daemon=True)
        self._thread.start()
        self._closing = list[Callable[[], Coroutine[Any, Any, None]]]()
        self.close = weakref.finalize(self, _end, self._loop, self._thread, self._closing)

    def run(self, work: Coroutine[Any, Any, Result]) -> Result:
        """Run a coroutine and wait for it; an interrupt cancels it."""
        future = asyncio.run_coroutine_threadsafe(work, self._loop)
        try:
            return future.result()
        except BaseException:
            future.cancel()
            raise

    def before_close(self, work: Callable[[], Coroutine[Any, Any, None]]) -> None:
        """Run a coroutine before the loop ends."""
        self._closing.append(work)

    def call(self, function: Callable[[], Result]) -> Result:
        """Call a function in the thread and wait for its result."""

        async def work() -> Result:
            return function()

        return self.run(work())


def _end(
    loop: asyncio.AbstractEventLoop,
    thread: threading.Thread,
    closing: Sequence[Callable[[], Coroutine[Any, Any, None]]],
) -> None:
    if threading.current_thread() is thread:  # the last reference was the loop's own: it cannot wait for itself
        loop.stop()
        return
    for work in closing:
        asyncio.run_coroutine_threadsafe(work(), loop).result()
    loop.call_soon_threadsafe(loop.stop)
    thread.join()
    loop.close()


class Client:
    """A relume server.

        client = Client("http://127.0.0.1:8420")
        bake = client.import_scene("teapot.glb", up="z").bake("gather", size=(960, 540)).wait(progress=True)
        with bake.session() as session:
            session["Teapot"].roughness = 0.3
            image = session.frame(exact=True)

    Args:
        url: its address, with the path of a proxy if there is one; default: RELUME_URL, or http://127.0.0.1:8420.
        token: access token; default: RELUME_TOKEN. Servers without login need none.
        timeout: seconds that one call may take, an upload included.
        retry_seconds: time for which a server that is away or busy is tried again.
    """

    def __init__(
        self, url: str | None = None, token: str | None = None, *, timeout: float = 600.0, retry_seconds: float = 10.0
    ) -> None:
        self._thread = LoopThread()
        try:
            self._client = self._thread.call(
                lambda: AsyncClient(url, token, timeout=timeout, retry_seconds=retry_seconds)
            )
        except BaseException:
            self._thread.close()
            raise
        self._thread.before_close(self._client.close)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Close all connections; also at the end of the program."""
        self._thread.close()

    def import_scene(
        self,
        file: str | os.PathLike[str],
        *,
        environment: str | os.PathLike[str] | None = None,
        companions: Sequence[str | os.PathLike[str]] = (),
        **options: Unpack[ImportOptions],
    ) -> Scene:
        """Import a scene file. See `AsyncClient.import_scene`."""
        call = self._client.import_scene(file, environment=environment, companions=companions, **options)
        return Scene(self._thread, self._thread.run(call))

    def import_environment(self, file: str | os.PathLike[str], *, name: str = "") -> str:
        """Import an environment, .hdr or .exr; returns its name for `environment.map` of looks."""
        return self._thread.run(self._client.import_environment(file, name=name))

    def saved_looks(self) -> list[LookEntry]:
        """Names and versions of the saved looks, newest first."""
        return self._thread.run(self._client.saved_looks())

    def saved_look(self, name: str) -> LookDocument:
        """A saved look by its name."""
        return self._thread.run(self._client.saved_look(name))

    def shared_look(self, id: str) -> LookDocument:  # noqa: A002
        """The look of a share link by the id in its address, `/?share=<id>`."""
        return self._thread.run(self._client.shared_look(id))

    def example(self, name: str) -> Scene:
        """A built-in scene by name, such as `still_life`."""
        return Scene(self._thread, self._thread.run(self._client.example(name)))

    def scenes(self) -> list[Scene]:
        """All scenes of the server."""
        return [Scene(self._thread, scene) for scene in self._thread.run(self._client.scenes())]

    def scene(self, id: str) -> Scene:  # noqa: A002
        """A scene by its id."""
        return Scene(self._thread, self._thread.run(self._client.scene(id)))

    def render(self, id: str) -> Render:  # noqa: A002
        """A render by its id."""
        return Render(self._thread, self._thread.run(self._client.render(id)))

    def bake(self, id: str) -> Bake:  # noqa: A002
        """A bake by its id."""
        return Bake(self._thread, self._thread.run(self._client.bake(id)))


class Scene:
    """A scene of the server."""

    def __init__(self, thread: LoopThread, scene: AsyncScene) -> None:
        self._thread, self._scene = thread, scene

    @property
    def id(self) -> str:
        """Id on the server."""
        return self._scene.id

    @property
    def info(self) -> SceneBody:
        """Materials, views, lights, variants and warnings."""
        return self._scene.info

    def bake(self, method: str = "gather", **options: Unpack[BakeOptions]) -> Bake:
        """Queue a bake. See `AsyncScene.bake`."""
        return Bake(self._thread, self._thread.run(self._scene.bake(method, **options)))

    def export(self, out: str | os.PathLike[str], look: AnyLook | None = None) -> None:
        """Write the scene with a look as a file for other programs. See `AsyncScene.export`."""
        self._thread.run(self._scene.export(out, {} if look is None else look))

    def delete(self) -> None:
        """Delete the scene with its bakes."""
        self._thread.run(self._scene.delete())


class _Job(Generic[Body]):
    """Work of the server. See `AsyncJob`."""

    def __init__(self, thread: LoopThread, job: AsyncJob[Body]) -> None:
        self._thread = thread
        self._job: AsyncJob[Body] = job

    @property
    def id(self) -> str:
        """Id on the server."""
        return self._job.id

    @property
    def info(self) -> Body:
        """The last known state."""
        return self._job.info

    def refresh(self) -> Body:
        """Read the state anew."""
        return self._thread.run(self._job.refresh())

    def wait(self, *, progress: Progress = False, timeout: float | None = None) -> Self:
        """Wait until it is ready. See `AsyncJob.wait`."""
        self._thread.run(self._job.wait(progress=progress, timeout=timeout))
        return self


class Bake(_Job[BakeBody]):
    """A bake of a scene: what looks are shown with."""

    def __init__(self, thread: LoopThread, bake: AsyncBake) -> None:
        super().__init__(thread, bake)
        self._bake = bake

    def session(self, *, view: str | None = None, timeout: float = 120.0) -> Session:
        """A live session with this bake, for `with`. See `AsyncBake.session`."""
        return Session(self._thread, self._thread.call(lambda: self._bake.session(view=view, timeout=timeout)))

    def look(self, changes: AnyLook | None = None) -> Look:
        """The scene's own look with changes, complete, to be edited without a session."""
        return self._thread.run(self._bake.look({} if changes is None else changes))

    def with_light_mix(self, look: AnyLook, mix: Mapping[str, Any]) -> Look:
        """A look with the lights of a light mix. See `AsyncBake.with_light_mix`."""
        return self._thread.run(self._bake.with_light_mix(look, mix))

    def share(self, look: AnyLook | None = None, *, view: str | None = None) -> str:
        """Create a share link of a look; returns its address. See `AsyncBake.share`."""
        return self._thread.run(self._bake.share({} if look is None else look, view=view))

    def render(
        self,
        looks: Looks,
        out: str | os.PathLike[str],
        *,
        view: str | None = None,
        progress: Progress = False,
        timeout: float | None = None,
        **options: Unpack[RenderOptions],
    ) -> list[Path]:
        """Render exact images of looks into files. See `AsyncBake.render`."""
        call = self._bake.render(looks, out, view=view, progress=progress, timeout=timeout, **options)
        return self._thread.run(call)

    def solve(
        self,
        look: AnyLook | None = None,
        *,
        reference: str | os.PathLike[str] | None = None,
        fit_exposure: bool = False,
        view: str | None = None,
        **options: Unpack[SolveOptions],
    ) -> SolveBody:
        """Find lights and materials from a picture or from strokes. See `AsyncBake.solve`."""
        call = self._bake.solve(
            {} if look is None else look, reference=reference, fit_exposure=fit_exposure, view=view, **options
        )
        return self._thread.run(call)

    def submit(
        self, looks: Looks, image_format: str, *, view: str | None = None, **options: Unpack[RenderOptions]
    ) -> Render:
        """Queue exact images of looks, and do not wait. See `AsyncBake.submit`."""
        return Render(self._thread, self._thread.run(self._bake.submit(looks, image_format, view=view, **options)))

    def contact_sheet(
        self,
        looks: Looks,
        out: str | os.PathLike[str],
        *,
        view: str | None = None,
        progress: Progress = False,
        timeout: float | None = None,
        **options: Unpack[RenderOptions],
    ) -> Path:
        """Render looks into one PNG with their names. See `AsyncBake.contact_sheet`."""
        call = self._bake.contact_sheet(looks, out, view=view, progress=progress, timeout=timeout, **options)
        return self._thread.run(call)

    def images(
        self, looks: Looks, *, view: str | None = None, timeout: float | None = None, **options: Unpack[RenderOptions]
    ) -> list[NDArray[np.uint8]]:
        """Exact images of looks as arrays. See `AsyncBake.images`."""
        return self._thread.run(self._bake.images(looks, view=view, timeout=timeout, **options))

    def models(self) -> list[ModelBody]:
        """BRDF terms with their parameters and ranges."""
        return self._thread.run(self._bake.models())

    def delete(self) -> None:
        """Delete the bake in any state."""
        self._thread.run(self._bake.delete())


class Render(_Job[RenderBody]):
    """A batch of images."""

    def __init__(self, thread: LoopThread, render: AsyncRender) -> None:
        super().__init__(thread, render)
        self._render = render

    def save(self, target: str | os.PathLike[str]) -> list[Path]:
        """Download all images. See `AsyncRender.save`."""
        return self._thread.run(self._render.save(Path(target)))

    def save_named(self, folder: str | os.PathLike[str]) -> list[Path]:
        """Download all images into a folder, with the names of the render."""
        return self._thread.run(self._render.save_named(folder))

    def delete(self) -> None:
        """Delete the render and its images."""
        self._thread.run(self._render.delete())


class Session:
    """One view of a bake, open for edits. See `AsyncSession`."""

    def __init__(self, thread: LoopThread, session: AsyncSession) -> None:
        self._thread, self._session = thread, session

    def __enter__(self) -> Self:
        self._thread.run(self._session.__aenter__())
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Leave the session; it has ended if its client is closed."""
        if self._thread.close.alive:
            self._thread.run(self._session.close())

    def __getitem__(self, name: str) -> Any:
        """A material or light of the look by name."""
        return self.look[name]

    def _ipython_key_completions_(self) -> list[str]:
        return self.look._ipython_key_completions_()

    @property
    def look(self) -> Look:
        """The complete look; its edits are sent at once."""
        return self._session.look

    @property
    def hello(self) -> HelloMessage:
        """The server's first message."""
        return self._session.hello

    @property
    def view(self) -> ViewInfo:
        """The view that is shown."""
        return self._session.view

    @property
    def status(self) -> str:
        """State of the image: `exact` or a lower fidelity; `connecting` while there is no connection."""
        return self._session.status

    @overload
    def frame(
        self, *, exact: bool = ..., linear: Literal[False] = ..., timeout: float | None = ...
    ) -> NDArray[np.uint8]:
        """See `AsyncSession.frame`."""

    @overload
    def frame(self, *, exact: bool = ..., linear: Literal[True], timeout: float | None = ...) -> NDArray[np.float32]:
        """See `AsyncSession.frame`."""

    def frame(self, *, exact: bool = True, linear: bool = False, timeout: float | None = None) -> NDArray[Any]:
        """Image of the look with all edits so far. See `AsyncSession.frame`."""
        return self._thread.run(self._session.frame(exact=exact, linear=linear, timeout=timeout))

    def move_camera(
        self, to_world: ArrayLike, *, yfov: float | None = None, size: Sequence[int] | None = None, near: float = 0.0
    ) -> None:
        """Move a free camera. See `AsyncSession.move_camera`."""
        self._thread.call(lambda: self._session.move_camera(to_world, yfov=yfov, size=size, near=near))

    def set_encoding(self, encoding: Encoding) -> None:
        """Choose the pixels of frames. See `AsyncSession.set_encoding`."""
        self._thread.call(lambda: self._session.set_encoding(encoding))

    def refresh(self) -> None:
        """Ask for the whole image again."""
        self._thread.call(self._session.refresh)

    def subscribe(self, listener: FrameListener) -> Callable[[], None]:
        """Call a function with each frame, in the background thread. See `AsyncSession.subscribe`."""
        return self._session.subscribe(listener)
