"""A server that fails to start closes everything it has opened."""

from __future__ import annotations

import pytest
from fastapi.testclient import TestClient
from server_fakes import Control
from server_fixtures import open_fake_bakes

from relume_server.app import create_app
from relume_server.settings import Settings


def test_opened_services_are_closed_if_startup_fails(tmp_path):
    closed = []

    def bakes(settings):
        service = open_fake_bakes(settings)
        close = service.close
        service.close = lambda: closed.append(close())
        return service

    def no_batches(settings, library, bakes):
        raise OSError("there is no room for processes")

    control = Control()
    app = create_app(
        Settings(data=tmp_path), open_library=control.open_library, open_bakes=bakes, open_steps=no_batches
    )
    with pytest.raises(OSError, match="no room for processes"), TestClient(app):
        pass
    assert closed == [None]
