"""Scenes, bakes and renders of a server, for programs with an event loop."""

from __future__ import annotations

import asyncio
import base64
import contextlib
import os
import sys
import time
import warnings
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, Generic, Self, TypeVar, Unpack, cast
from urllib.parse import quote

import numpy as np
from numpy.typing import NDArray

from relume_client.async_session import AsyncSession
from relume_client.bodies import (
    BakeBody,
    BakeOptions,
    ImportOptions,
    LookDocument,
    LookEntry,
    ModelBody,
    RenderBody,
    RenderOptions,
    SceneBody,
    SolveBody,
    SolveOptions,
)
from relume_client.errors import JobFailedError
from relume_client.images import decode_displayed
from relume_client.looks import Look, to_json
from relume_client.transport import Transport, normalize_url

AnyLook = LookDocument | Mapping[str, Any] | Look
Looks = AnyLook | Sequence[AnyLook]
Body = TypeVar("Body", BakeBody, RenderBody)
Progress = bool | Callable[[BakeBody | RenderBody], object]
_POLL_S = 0.2, 2.0
_MAX_COMPANIONS = 900


class AsyncClient:
    """A relume server.

    Args:
        url: its address, with the path of a proxy if there is one; default: RELUME_URL, or http://127.0.0.1:8420.
        token: access token; default: RELUME_TOKEN. Servers without login need none.
        timeout: seconds that one call may take, an upload included.
        retry_seconds: time for which a server that is away or busy is tried again.
    """

    def __init__(
        self, url: str | None = None, token: str | None = None, *, timeout: float = 600.0, retry_seconds: float = 10.0
    ) -> None:
        token = token or os.environ.get("RELUME_TOKEN") or None
        self._transport = Transport(normalize_url(url), token, timeout=timeout, retry_seconds=retry_seconds)

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        await self.close()

    async def close(self) -> None:
        """Close all connections."""
        await self._transport.close()

    async def import_scene(
        self,
        file: str | os.PathLike[str],
        *,
        environment: str | os.PathLike[str] | None = None,
        companions: Sequence[str | os.PathLike[str]] = (),
        **options: Unpack[ImportOptions],
    ) -> AsyncScene:
        """Import a scene file. The same file with the same name is the same scene.

        Args:
            file: .glb, .gltf, .obj, .ply, .stl, .usd, or a .zip with one and its files.
            environment: .hdr or .exr; by default the built-in studio.
            companions: files that the scene names, or folders with them; their names are relative to its folder.
            options: `name`, `up`, `unit`, `recenter`, `light_unit`, `scene_name`, `ground`.
        Raises:
            FileNotFoundError: a file is not there. ProblemError: the server rejects the scene; the message lists why.
        """
        scene_file = Path(file)
        with contextlib.ExitStack() as opened:
            parts = [("scene", (scene_file.name, opened.enter_context(scene_file.open("rb"))))]
            if environment is not None:
                path = Path(environment)
                parts.append(("environment", (path.name, opened.enter_context(path.open("rb")))))
            for name, path in _companions(scene_file, companions):
                parts.append(("companions", (name, opened.enter_context(path.open("rb")))))
            body = await self._transport.json("POST", "/api/scenes", data=to_json(options), files=parts)
        return AsyncScene(self._transport, body)

    async def import_environment(self, file: str | os.PathLike[str], *, name: str = "") -> str:
        """Import an environment, .hdr or .exr; returns its name for `environment.map` of looks."""
        path = Path(file)
        with path.open("rb") as opened:
            parts = [("environment", (path.name, opened))]
            body = await self._transport.json("POST", "/api/environments", data={"name": name}, files=parts)
        return str(body["map"])

    async def saved_looks(self) -> list[LookEntry]:
        """Names and versions of the saved looks, newest first."""
        return cast("list[LookEntry]", await self._transport.json("GET", "/api/looks"))

    async def saved_look(self, name: str) -> LookDocument:
        """A saved look by its name."""
        return cast(LookDocument, await self._transport.json("GET", f"/api/looks/{quote(name, '')}"))

    async def shared_look(self, id: str) -> LookDocument:  # noqa: A002
        """The look of a share link by the id in its address, `/?share=<id>`."""
        return cast(LookDocument, (await self._transport.json("GET", f"/api/shares/{quote(id, '')}"))["look"])

    async def example(self, name: str) -> AsyncScene:
        """A built-in scene by name, such as `still_life`."""
        return AsyncScene(self._transport, await self._transport.json("POST", f"/api/example-scenes/{quote(name, '')}"))

    async def scenes(self) -> list[AsyncScene]:
        """All scenes of the server."""
        return [AsyncScene(self._transport, body) for body in await self._transport.json("GET", "/api/scenes")]

    async def scene(self, id: str) -> AsyncScene:  # noqa: A002
        """A scene by its id."""
        return AsyncScene(self._transport, await self._transport.json("GET", f"/api/scenes/{quote(id, '')}"))

    async def render(self, id: str) -> AsyncRender:  # noqa: A002
        """A render by its id."""
        return AsyncRender(self._transport, await self._transport.json("GET", f"/api/renders/{quote(id, '')}"))

    async def bake(self, id: str) -> AsyncBake:  # noqa: A002
        """A bake by its id."""
        return AsyncBake(self._transport, await self._transport.json("GET", f"/api/bakes/{quote(id, '')}"))


class AsyncScene:
    """A scene of the server; `info` has its materials, views, lights, variants and warnings."""

    def __init__(self, transport: Transport, info: SceneBody) -> None:
        self._transport, self.info = transport, info

    @property
    def id(self) -> str:
        """Id on the server."""
        return self.info["id"]

    async def bake(self, method: str = "gather", **options: Unpack[BakeOptions]) -> AsyncBake:
        """Queue a bake; the same recipe is the same bake.

        Args:
            method: `direct`, `gather` (with indirect light) or `probes` (free camera).
            options: `size`, `preset`, `views`, `lights`, `probes`, `patches`, `gather_rays`, `relightable`, `aspect`.
        """
        request = to_json({"scene": self.id, "method": method, **options})
        return AsyncBake(self._transport, await self._transport.json("POST", "/api/bakes", body=request))

    async def export(self, out: str | os.PathLike[str], look: AnyLook = {}) -> None:  # noqa: B006 - never changed
        """Write the scene with a look as a file for other programs, as in docs/formats.md.

        Args:
            out: ends in .glb, .usdz, or .zip (MaterialX).
            look: may be partial.
        Raises:
            ValueError: the ending is no format.
        """
        target = Path(out)
        formats = {".glb": "glb", ".usdz": "usd", ".zip": "materialx"}
        if target.suffix.lower() not in formats:
            raise ValueError(f"{target} does not end in .glb, .usdz or .zip")
        request = {"format": formats[target.suffix.lower()], "look": to_json(look)}
        await self._transport.download(f"/api/scenes/{self.id}/exports", target, body=request)

    async def delete(self) -> None:
        """Delete the scene with its bakes."""
        await self._transport.json("DELETE", f"/api/scenes/{self.id}")


class AsyncJob(Generic[Body]):
    """Work of the server; `info` is its last known state."""

    _path: str
    _label: str
    info: Body

    def __init__(self, transport: Transport, info: Body) -> None:
        self._transport, self.info = transport, info

    @property
    def id(self) -> str:
        """Id on the server."""
        return str(self.info["id"])

    async def refresh(self) -> Body:
        """Read the state anew."""
        body: Body = await self._transport.json("GET", f"{self._path}/{self.id}")
        self.info = body
        return body

    async def wait(self, *, progress: Progress = False, timeout: float | None = None) -> Self:
        """Wait until it is ready.

        Args:
            progress: true shows it on stderr; or a function that gets each state.
            timeout: seconds; by default as long as it takes.
        Raises:
            JobFailedError: it failed or was canceled; the message is the server's.
            TimeoutError: it is not ready in time; it goes on.
        """
        report = _progress_line(self._label) if progress is True else progress or (lambda body: None)
        pause_s, longest_s = _POLL_S
        start_s = time.monotonic()
        while True:
            report(self.info)
            if self.info["state"] == "ready":
                return self
            if self.info["state"] in ("failed", "canceled"):
                raise JobFailedError(self.info["problem"] or f"the {self._label} was {self.info['state']}")
            if timeout is not None and time.monotonic() + pause_s - start_s > timeout:
                raise TimeoutError(f"the {self._label} {self.id} is not ready after {timeout:g} s; it goes on")
            await asyncio.sleep(pause_s)
            pause_s = min(longest_s, 1.2 * pause_s)
            await self.refresh()


class AsyncBake(AsyncJob[BakeBody]):
    """A bake of a scene: what looks are shown with."""

    _path, _label = "/api/bakes", "bake"

    def session(self, *, view: str | None = None, timeout: float = 120.0) -> AsyncSession:
        """A live session with this bake, for `async with`.

        Args:
            view: name of the view to show; by default the first.
            timeout: seconds to wait for the connection, and for each frame.
        """
        return AsyncSession(self._transport, self.id, view=view, timeout=timeout)

    async def look(self, changes: AnyLook = {}) -> Look:  # noqa: B006 - never changed
        """The scene's own look with changes, complete, to be edited without a session."""
        request = {"bake": self.id, "looks": [to_json(changes)]}
        body = await self._transport.json("POST", "/api/renders/looks", body=request)
        return Look(body["looks"][0])

    async def with_light_mix(self, look: AnyLook, mix: Mapping[str, Any]) -> Look:
        """A look with brightness and color of the lights of a light mix; what it does not have is a warning.

        Args:
            look: may be partial. mix: as in docs/formats.md.
        """
        request = {"look": to_json(look), "mix": to_json(mix)}
        body = await self._transport.json("POST", f"/api/bakes/{self.id}/light-mix", body=request)
        for warning in body["warnings"]:
            warnings.warn(warning, stacklevel=2)
        return Look(body["look"])

    async def share(self, look: AnyLook = {}, *, view: str | None = None) -> str:  # noqa: B006 - never changed
        """Create a share link of a look; returns its address, with that of the server.

        Args:
            look: may be partial. view: name of a view; by default the first.
        """
        name = self.info["recipe"]["views"][0] if view is None else view
        request = to_json({"bake": self.id, "view": name, "views": [name], "look": look})
        body = await self._transport.json("POST", "/api/shares", body=request)
        return f"{self._transport.url}{body['url']}"

    async def solve(
        self,
        look: AnyLook = {},  # noqa: B006 - never changed
        *,
        reference: str | os.PathLike[str] | None = None,
        fit_exposure: bool = False,
        view: str | None = None,
        **options: Unpack[SolveOptions],
    ) -> SolveBody:
        """Find the lights of a look, and materials by request, from a picture or from strokes.

        Args:
            look: the current look, may be partial. reference: a picture: PNG, JPEG, WebP, HDR or EXR.
            fit_exposure: only its relative brightness counts. view: name of a view; by default the first.
            options: fields of the request, as in docs/inverse-lighting.md: `strokes`, `locked`, `materials`, `change`,
                `rotate`, `camera`, `size`.
        Returns:
            `look`, the given one with the changes; `residual`; what cannot be reached in `shortfalls`.
        """
        name = self.info["recipe"]["views"][0] if view is None else view
        request = {"bake": self.id, "view": name, "look": look, **options}
        if reference is not None:
            image = base64.b64encode(Path(reference).read_bytes()).decode()
            request["reference"] = {"image": image, "fit_exposure": fit_exposure}
        return cast(SolveBody, await self._transport.json("POST", "/api/solve", body=to_json(request)))

    async def submit(
        self, looks: Looks, image_format: str, *, view: str | None = None, **options: Unpack[RenderOptions]
    ) -> AsyncRender:
        """Queue exact images of looks, and do not wait; see `render`.

        Args:
            looks: one or several, or none if there are `saved_looks`; with `frames`, keyframes of an animation.
            image_format: `exr`, `png`, `webp`, `mp4` or `contact_sheet`.
            view: name of a view; by default the first, unless there are `views`.
            options: fields of the request, as in docs/api.md: `saved_looks`, `views`, `file_name`, `priority`,
                `frames`, `path`, `size`, `layers`, `fps` and others.
        """
        documents = [looks] if isinstance(looks, Mapping | Look) else list(looks)
        name = self.info["recipe"]["views"][0] if view is None and not options.get("views") else view
        request = to_json({"bake": self.id, "looks": documents, "format": image_format, "view": name, **options})
        return AsyncRender(self._transport, await self._transport.json("POST", "/api/renders", body=request))

    async def render(
        self,
        looks: Looks,
        out: str | os.PathLike[str],
        *,
        view: str | None = None,
        progress: Progress = False,
        timeout: float | None = None,
        **options: Unpack[RenderOptions],
    ) -> list[Path]:
        """Render exact images of looks into files.

        Args:
            looks: one or several, perhaps partial; with `frames`, keyframes of an animation.
            out: a file, whose ending is the format (.png, .exr, .webp, .mp4); with several images, {} in its name
                becomes their number from 0. With `file_name`, a folder for files of these names, whose format is the
                ending of `file_name`. Folders are made.
            view, options: as in `submit`. progress, timeout: as in `wait`.
        Returns:
            The files, in order.
        Raises:
            ValueError: the file's ending is no format, or several images have one name; before anything is rendered.
        """
        target, template = Path(out), options.get("file_name")
        format_name = _format(target if template is None else Path(template))
        render = await self.submit(looks, format_name, view=view, **options)
        if template is not None:
            await render.wait(progress=progress, timeout=timeout)
            return await render.save_named(target)
        if render.info["total"] > 1 and format_name != "mp4" and "{}" not in str(out):
            await render.delete()
            raise ValueError(f"{render.info['total']} images need {{}} in their name, such as 'image_{{}}.png'")
        await render.wait(progress=progress, timeout=timeout)
        return await render.save(target)

    async def contact_sheet(
        self,
        looks: Looks,
        out: str | os.PathLike[str],
        *,
        view: str | None = None,
        progress: Progress = False,
        timeout: float | None = None,
        **options: Unpack[RenderOptions],
    ) -> Path:
        """Render looks into one PNG with their names.

        Args:
            looks, view, options: as in `submit`. out: the file. progress, timeout: as in `wait`.
        """
        render = await self.submit(looks, "contact_sheet", view=view, **options)
        await render.wait(progress=progress, timeout=timeout)
        return (await render.save(Path(out)))[0]

    async def images(
        self, looks: Looks, *, view: str | None = None, timeout: float | None = None, **options: Unpack[RenderOptions]
    ) -> list[NDArray[np.uint8]]:
        """Exact images of looks as arrays, as displayed. (height, width, 3) uint8 each

        Args:
            looks: one or several, perhaps partial; with `frames`, keyframes of an animation.
            view, options: as in `submit`. timeout: as in `wait`.
        """
        render = await self.submit(looks, "png", view=view, **options)
        await render.wait(timeout=timeout)
        return [decode_displayed(await render.read(index)) for index in range(render.info["total"])]

    async def models(self) -> list[ModelBody]:
        """BRDF terms with their parameters and ranges."""
        return cast("list[ModelBody]", await self._transport.json("GET", "/api/models"))

    async def delete(self) -> None:
        """Delete the bake in any state."""
        await self._transport.json("DELETE", f"{self._path}/{self.id}?delete_files=true")


class AsyncRender(AsyncJob[RenderBody]):
    """A batch of images."""

    _path, _label = "/api/renders", "render"

    async def read(self, index: int) -> bytes:
        """The file of one image."""
        return await self._transport.read(self._frame_path(index))

    def _frame_path(self, index: int) -> str:
        return f"{self._path}/{self.id}/frames/{index}"

    async def save(self, target: Path) -> list[Path]:
        """Download all images; {} in the name of the target becomes their number. Videos and sheets are one file."""
        if single := {"mp4": "video.mp4", "contact_sheet": "contact-sheet.png"}.get(self.info["format"]):
            return [await self._transport.download(f"{self._path}/{self.id}/{single}", target)]
        files = [Path(str(target).replace("{}", f"{index:04}")) for index in range(self.info["total"])]
        return [await self._transport.download(self._frame_path(index), file) for index, file in enumerate(files)]

    async def save_named(self, folder: str | os.PathLike[str]) -> list[Path]:
        """Download all images into a folder, with the names of the render."""
        paths = map(self._frame_path, range(self.info["total"]))
        return [await self._transport.download(path, None, Path(folder)) for path in paths]

    async def delete(self) -> None:
        """Delete the render and its images."""
        await self._transport.json("DELETE", f"{self._path}/{self.id}")


def _format(target: Path) -> str:
    """Format of a file by its ending."""
    ending = target.suffix.lower().removeprefix(".")
    if ending not in ("png", "exr", "webp", "mp4"):
        raise ValueError(f"{target} does not end in .png, .exr, .webp or .mp4")
    return ending


def _companions(scene: Path, companions: Sequence[str | os.PathLike[str]]) -> list[tuple[str, Path]]:
    """Companion files with their names relative to the scene's folder; folders stand for all files in them."""
    paths = [Path(companion).resolve() for companion in companions]
    files = [file for path in paths for file in (sorted(path.rglob("*")) if path.is_dir() else [path])]
    files = [file for file in files if not file.is_dir() and file != scene.resolve()]
    if len(files) > _MAX_COMPANIONS:
        raise ValueError(f"{len(files)} companions are more than {_MAX_COMPANIONS}; send a .zip of the scene")
    folder = scene.resolve().parent
    return [(path.relative_to(folder).as_posix() if path.is_relative_to(folder) else path.name, path) for path in files]


def _progress_line(label: str) -> Callable[[BakeBody | RenderBody], None]:
    """A function that shows progress in one line of stderr."""

    def report(body: BakeBody | RenderBody) -> None:
        left_s = body["seconds_left"]
        left = "" if left_s is None else f", {left_s:.0f} s left"
        end = "\n" if body["state"] not in ("queued", "running") else ""
        sys.stderr.write(f"\r{label}: {body['state']} {100 * body['progress']:3.0f} %{left:16}{end}")
        sys.stderr.flush()

    return report
