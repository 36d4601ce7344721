"""Goes once through a running service: import, bake, one edit in a live session. `python smoke.py [URL]`

Runs inside the image, so it needs nothing on the host. Prints one line per step; exits non-zero where one fails.
"""

from __future__ import annotations

import asyncio
import json
import struct
import sys
import time
import urllib.error
import urllib.request
import uuid
from typing import Any, NoReturn

import smoke_scene
import websockets

BAKE_TIMEOUT_S = 300.0
FRAME_TIMEOUT_S = 60.0


def main() -> None:
    """All steps in order."""
    url = sys.argv[1] if len(sys.argv) > 1 else "http://127.0.0.1:8420"
    scene = import_scene(url)
    say(f"imported scene {scene['id']}: materials {[material['name'] for material in scene['materials']]}")
    bake = bake_scene(url, scene["id"])
    say(f"baked {bake['id']}: {bake['bytes']:,} bytes")
    asyncio.run(edit_once(url.replace("http", "ws", 1), bake["id"]))


def import_scene(url: str) -> dict[str, Any]:
    """POST /api/scenes; the scene's body."""
    boundary = uuid.uuid4().hex
    body = b""
    for field, filename, content in (
        ("scene", "smoke.glb", smoke_scene.glb()),
        ("environment", "smoke.hdr", smoke_scene.hdr()),
    ):
        head = f'--{boundary}\r\nContent-Disposition: form-data; name="{field}"; filename="{filename}"\r\n\r\n'
        body += head.encode() + content + b"\r\n"
    body += f"--{boundary}--\r\n".encode()
    return call(f"{url}/api/scenes", body, f"multipart/form-data; boundary={boundary}")


def bake_scene(url: str, scene_id: str) -> dict[str, Any]:
    """POST /api/bakes and follow it until it is ready; the bake's body."""
    recipe = json.dumps({"scene": scene_id, "method": "direct", "size": [400, 300], "lights": 1000}).encode()
    bake = call(f"{url}/api/bakes", recipe, "application/json")
    deadline = time.monotonic() + BAKE_TIMEOUT_S
    while bake["state"] in ("queued", "running"):
        if time.monotonic() > deadline:
            fail(f"the bake is still {bake['state']} after {BAKE_TIMEOUT_S:.0f} s")
        time.sleep(0.5)
        bake = call(f"{url}/api/bakes/{bake['id']}")
    if bake["state"] != "ready":
        fail(f"the bake is {bake['state']}: {bake['problem']}")
    return bake


async def edit_once(url: str, bake_id: str) -> None:
    """Open a session, wait for its first exact frame, sharpen the ball's highlight, wait for the frame of that edit."""
    address = f"{url}/api/bakes/{bake_id}/session"
    async with websockets.connect(address, subprotocols=[websockets.Subprotocol("relume.v2")], max_size=None) as socket:
        await socket.send(json.dumps({"type": "open"}))
        before = await exact_frame(socket, 0)
        patch = [{"op": "replace", "path": "/materials/Ball/terms/1/params/roughness", "value": 0.15}]
        start = time.monotonic()
        await socket.send(json.dumps({"type": "edit", "revision": 1, "patch": patch}))
        after = await exact_frame(socket, 1)
        say(f"edited the roughness: exact frame after {1000 * (time.monotonic() - start):.0f} ms, freezing included")
        if before == after:
            fail("the picture did not change")


async def exact_frame(socket: websockets.ClientConnection, revision: int) -> bytes:
    """The payload of the next exact picture at that revision or a later one; every frame is acknowledged."""
    deadline = time.monotonic() + FRAME_TIMEOUT_S
    while True:
        message = await asyncio.wait_for(socket.recv(), deadline - time.monotonic())
        if isinstance(message, str):
            if json.loads(message)["type"] == "problem":
                fail(message)
            continue
        (head_length,) = struct.unpack_from("<I", message)
        header = json.loads(message[4 : 4 + head_length])
        await socket.send(json.dumps({"type": "ack", "frame": header["frame"]}))
        if header["exact"] and header["revision"] >= revision:
            return message[4 + head_length :]


def call(url: str, body: bytes | None = None, content_type: str = "") -> dict[str, Any]:
    """One REST call; exits with the server's words where it is refused."""
    request = urllib.request.Request(url, body, {"Content-Type": content_type} if content_type else {})  # noqa: S310
    try:
        with urllib.request.urlopen(request, timeout=120.0) as answer:  # noqa: S310
            document: dict[str, Any] = json.load(answer)
            return document
    except urllib.error.HTTPError as problem:
        fail(f"{url} answered {problem.code}: {problem.read().decode(errors='replace')}")


def say(text: str) -> None:
    """One line of progress."""
    sys.stdout.write(f"smoke: {text}\n")
    sys.stdout.flush()


def fail(text: str) -> NoReturn:
    """One line on stderr and exit 1."""
    sys.exit(f"smoke: {text}")


if __name__ == "__main__":
    main()
