"""Invalid files and ids of measured materials."""

from __future__ import annotations

import struct
from typing import Any

import pytest
from fastapi.testclient import TestClient

URL = "/api/materials/measured"


@pytest.mark.parametrize(
    "data", [b"", struct.pack("<3i", 90, 90, 180), struct.pack("<3i", 10**9, 10**9, 10**9) + b"\0" * 8000]
)
def test_invalid_measured_material_is_refused(client: TestClient, settings: Any, data: bytes) -> None:
    response = client.post(URL, files={"material": ("../../x.binary", data)})
    assert response.status_code == 422
    assert response.json()["type"] == "urn:relume:problem:material"
    assert client.get(URL).json() == []
    assert list(settings.data.glob("upload-*")) == []


def test_oversized_measured_material_is_413(client: TestClient) -> None:
    response = client.post(URL, files={"material": ("x.binary", b"\0" * 36_000_000)})
    assert response.status_code == 413
    assert response.json()["type"] == "urn:relume:problem:too-large"


@pytest.mark.parametrize("identity", ["%2e%2e", "0123456789abcdef", "x" * 16, "0" * 400])
def test_unknown_measured_material_is_not_found(client: TestClient, identity: str) -> None:
    for method in ("GET", "DELETE"):
        response = client.request(method, f"{URL}/{identity}")
        assert response.status_code in (404, 405, 422)
        assert response.headers["Content-Type"] == "application/problem+json"
