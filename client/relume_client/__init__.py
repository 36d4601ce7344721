"""Python client of a relume server: scenes, bakes, live sessions, renders. See docs/python.md.

`Client` waits for each result; `AsyncClient` is for programs with an event loop. Images are NumPy arrays.
"""

from relume_client.async_client import AsyncBake, AsyncClient, AsyncRender, AsyncScene
from relume_client.async_session import AsyncSession
from relume_client.cameras import look_at
from relume_client.client import Bake, Client, Render, Scene, Session
from relume_client.errors import (
    AccessError,
    EditRejectedError,
    JobFailedError,
    ProblemError,
    RelumeClientError,
    ServerUnavailableError,
    ServerVersionError,
)
from relume_client.looks import Look

__all__ = [
    "AccessError",
    "AsyncBake",
    "AsyncClient",
    "AsyncRender",
    "AsyncScene",
    "AsyncSession",
    "Bake",
    "Client",
    "EditRejectedError",
    "JobFailedError",
    "Look",
    "ProblemError",
    "RelumeClientError",
    "Render",
    "Scene",
    "ServerUnavailableError",
    "ServerVersionError",
    "Session",
    "look_at",
]
