"""A server that a proxy publishes at a path such as /relume."""

from __future__ import annotations

from pathlib import Path

import pytest
from fastapi.testclient import TestClient
from pydantic import ValidationError
from starlette.websockets import WebSocketDisconnect

from relume_server.settings import Settings, parse_root_path

LOOK: dict[str, object] = {}


@pytest.fixture
def page(settings: Settings) -> Path:
    settings.client.mkdir(parents=True)
    (settings.client / "index.html").write_text("<title>editor</title>")
    return settings.client


@pytest.mark.parametrize(
    ("text", "prefix"),
    [
        ("", ""),
        ("/", ""),
        ("/relume/", "/relume"),
        ("/user/ann@example.org/proxy/8420", "/user/ann@example.org/proxy/8420"),
        ("/user/ann%40example.org", "/user/ann%40example.org"),
        ("/api/relume", "/api/relume"),
    ],
)
def test_prefix_has_no_slash_at_its_end(text: str, prefix: str) -> None:
    assert parse_root_path(text) == prefix


@pytest.mark.parametrize(
    "text",
    ["relume", "//other.example", "/a//b", "/a/../b", "/.", "/a?b", "/a b", "/a\n", "/api", "/assets/", "/a" * 200],
)
def test_prefix_is_a_path_of_plain_segments(text: str) -> None:
    with pytest.raises(ValidationError, match="a path such as /relume"):
        Settings(root_path=text)


class TestSetting:
    @pytest.fixture
    def settings(self, settings: Settings) -> Settings:
        settings.root_path = "/relume"
        return settings

    @pytest.mark.parametrize("prefix", ["/relume", ""])
    def test_proxies_may_keep_or_remove_the_prefix(self, client: TestClient, page: Path, prefix: str) -> None:
        assert client.get(f"{prefix}/").text == "<title>editor</title>"
        assert client.get(f"{prefix}/api/looks").json() == []
        assert client.get(f"{prefix}/api/none").status_code == 404

    def test_other_paths_with_the_same_beginning_are_not_below_it(self, client: TestClient, page: Path) -> None:
        assert client.get("/relumed/api/looks", follow_redirects=False).headers["location"] == "../../"

    def test_address_without_a_slash_leads_to_the_page(self, client: TestClient, page: Path) -> None:
        answer = client.get("/relume?scene=a%20b", follow_redirects=False)
        assert (answer.status_code, answer.headers["location"]) == (308, "/relume/?scene=a%20b")

    def test_location_and_link_have_the_prefix(self, client: TestClient) -> None:
        answer = client.put("/relume/api/looks/Red/", json=LOOK, follow_redirects=False)
        assert (answer.status_code, answer.headers["location"]) == (307, "/relume/api/looks/Red")
        assert client.put("/relume/api/looks/Red", json=LOOK).status_code == 201
        (look,) = client.get("/relume/api/looks").json()
        assert look["name"] == "Red"
        assert client.put("/relume/api/looks/Blue", json=LOOK).status_code == 201
        link = client.get("/relume/api/looks?limit=1").headers["link"]
        assert link.startswith("</relume/api/looks?limit=1&after=")

    def test_openapi_names_the_prefix(self, client: TestClient) -> None:
        assert client.get("/relume/api/openapi.json").json()["servers"] == [{"url": "/relume"}]

    def test_unknown_session_is_closed(self, client: TestClient) -> None:
        with pytest.raises(WebSocketDisconnect) as closed, client.websocket_connect("/relume/api/none"):
            pass
        assert closed.value.code == 1008


def test_unknown_paths_lead_to_the_page_below_any_prefix(client: TestClient, page: Path) -> None:
    answer = client.get("/scenes/0123?view=a", follow_redirects=False)
    assert (answer.status_code, answer.headers["location"]) == (307, "../?view=a")
    assert client.get("/scenes", follow_redirects=False).headers["location"] == "./"
