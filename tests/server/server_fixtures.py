"""An app with a fake library and real bakes of a fake method, in the test's folder."""

import asyncio
import math
import shutil
import threading
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from fastapi.testclient import TestClient
from server_fakes import SIZE, Control, FakeMethod, InThreadSteps, tiny_scene
from session_client import Baked
from sqlalchemy import Engine, event

from relume.store.bake_protocol import Recipe
from relume_server.app import create_app
from relume_server.settings import Settings
from relume_worker.database import open_database
from relume_worker.scenes import register_scene
from relume_worker.service import BakeService

impatient = pytest.mark.parametrize("ack_seconds", [1.5])  # for tests of unacknowledged frames


@pytest.fixture
def control() -> Control:
    return Control()


@pytest.fixture
def ack_seconds() -> float:
    """Time before unacknowledged frames close a session: longer than any test; `impatient` shortens it."""
    return 600.0


@pytest.fixture(scope="session")
def empty_ledger(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An empty ledger to copy: ten times as fast as creating the tables."""
    path = tmp_path_factory.mktemp("ledger") / "relume.db"
    open_database(f"sqlite:///{path}").dispose()
    return path


@pytest.fixture
def settings(tmp_path: Path, ack_seconds: float, empty_ledger: Path) -> Settings:
    data = tmp_path / "data"
    data.mkdir()
    shutil.copy(empty_ledger, data)
    return Settings(
        data=data,
        client=tmp_path / "dist",
        allowed_hosts=["testserver"],
        max_body_bytes=2 * 1024**2,
        max_upload_bytes=4 * 1024**2,
        max_sessions=3,
        preload_importer=False,
        ack_seconds=ack_seconds,
    )


def open_fake_bakes(settings: Settings) -> BakeService:
    return BakeService(
        settings.data,
        settings.database_url,
        methods={name: FakeMethod() for name in ("direct", "gather")},
        client_weights=settings.fair_shares,
    )


@contextmanager
def no_database_on_the_loop() -> Iterator[None]:
    """Fail if an event loop of a server, and with it all sessions, waits for the database."""
    blocking_statements: list[str] = []

    def check_statement(connection: object, cursor: object, statement: str, *_: object) -> None:
        if asyncio._get_running_loop() is None or threading.current_thread() is threading.main_thread():
            return
        calls = traceback.extract_stack()[:-1]
        if not any("/tests/" in call.filename for call in calls):  # queries of tests are allowed
            own_calls = [call for call in calls if "/site-packages/" not in call.filename]
            blocking_statements.append(
                f"{statement.splitlines()[0]}\n" + "".join(traceback.format_list(own_calls[-6:]))
            )

    event.listen(Engine, "before_cursor_execute", check_statement)
    try:
        yield
    finally:
        event.remove(Engine, "before_cursor_execute", check_statement)
    assert not blocking_statements, "\n".join(blocking_statements)


@pytest.fixture
def client(settings: Settings, control: Control, monkeypatch: pytest.MonkeyPatch) -> Iterator[TestClient]:
    monkeypatch.setattr("relume_server.client_state.flow_control.SLOW_S", math.inf)  # a busy machine is not a slow link
    # and it does not take more steps
    monkeypatch.setattr("relume_server.session.frames.coefficient_budget.MIN_COEFFICIENTS", 512)
    app = create_app(settings, open_library=control.open_library, open_steps=InThreadSteps, open_bakes=open_fake_bakes)
    with no_database_on_the_loop(), TestClient(app, raise_server_exceptions=False) as client:
        yield client


@pytest.fixture
def baked(client: TestClient) -> Baked:
    """A scene and a finished bake of it."""
    bakes: BakeService = client.app.state.services.bakes
    scene = register_scene(bakes.data_dir, bakes.ledger, tiny_scene())
    bake = bakes.submit(scene, Recipe("direct", ("front", "left"), SIZE, 10))
    with bakes.subscribe(bake) as changes:
        assert list(changes)[-1].state == "ready"
    return Baked(scene, bake)
