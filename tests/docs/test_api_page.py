"""docs/api.md lists only existing calls, messages and problems, and all messages and problems."""

from __future__ import annotations

import re
from pathlib import Path
from typing import get_args

import pytest

from relume_server import errors
from relume_server.app import create_app
from relume_server.schemas.protocol import SUBPROTOCOL, ClientMessage, ServerMessage
from relume_server.settings import Settings

PAGE = (Path(__file__).resolve().parents[2] / "docs" / "api.md").read_text(encoding="utf-8")
MESSAGES = [
    message.model_fields["type"] for message in (*get_args(get_args(ClientMessage)[0]), *get_args(ServerMessage))
]


@pytest.fixture(scope="module")
def addresses(tmp_path_factory: pytest.TempPathFactory) -> set[str]:
    """Addresses of all calls, with {} for each parameter."""
    app = create_app(Settings(data=tmp_path_factory.mktemp("addresses")))
    return {re.sub(r"{[^}]*}", "{}", path) for path in app.openapi()["paths"]} | {"/api/bakes/{}/session"}


def test_addresses_on_the_page_exist(addresses: set[str]) -> None:
    written = set(re.findall(r"/api/[\w{}/.-]*[\w}]", re.sub(r"```.*?```", "", PAGE, flags=re.DOTALL)))
    generated = {"/api/openapi.json"}
    assert len(written) > 40
    assert {re.sub(r"{[^}]*}", "{}", address) for address in written} - addresses == generated


@pytest.mark.parametrize("message", sorted({get_args(field.annotation)[0] for field in MESSAGES}))
def test_every_message_is_on_the_page(message: str) -> None:
    assert f'"type":"{message}"' in PAGE or f"| `{message}` |" in PAGE
    assert SUBPROTOCOL in PAGE


def test_every_problem_is_on_the_page() -> None:
    table = PAGE.split("### Errors")[1].split("\n## ")[0]
    kinds = {mapping.slug for _, mapping in errors.TABLE} | {errors.DEFECT.slug}
    assert kinds <= set(re.findall(r"`([a-z-]+)`", table))


def test_every_close_code_is_on_the_page() -> None:
    table = PAGE.split("### Close codes")[1]
    codes = {value for name, value in vars(errors).items() if name.startswith("CLOSE_")}
    assert {str(code) for code in codes} <= set(re.findall(r"\b\d{4}\b", table))
