"""The table of roles lists every route and every message, and nothing else."""

from __future__ import annotations

from typing import get_args

from fastapi.routing import APIRoute, APIWebSocketRoute

from relume_server.app import ROUTE_GROUPS, create_app
from relume_server.auth.roles import Role
from relume_server.auth.rules import MESSAGES, RULES, SOCKET, is_change, required_role
from relume_server.schemas import protocol
from relume_server.settings import Settings


def operations() -> set[tuple[str, str]]:
    """Operations of the OpenAPI document and live sessions, which it does not describe."""
    paths = create_app(Settings()).openapi()["paths"]
    documented = {(method.upper(), path) for path, each in paths.items() for method in each}
    routes = [route for group in ROUTE_GROUPS for route in group.router.routes]
    assert all(isinstance(route, APIRoute | APIWebSocketRoute) for route in routes), "a kind of route without roles"
    hidden = {
        (method, route.path) for route in routes if isinstance(route, APIRoute) for method in route.methods
    } - documented
    assert hidden == set(), "routes that the document hides"
    return documented | {(SOCKET, route.path) for route in routes if isinstance(route, APIWebSocketRoute)}


def test_every_route_has_a_role_and_every_role_a_route() -> None:
    document = {("GET", "/api/openapi.json")}
    assert operations() | document == {(method, path) for path, roles in RULES.items() for method in roles}


def test_every_message_has_a_role() -> None:
    messages = get_args(get_args(protocol.ClientMessage)[0])
    types = {get_args(kind.model_fields["type"].annotation)[0] for kind in messages}
    assert types | {"edit_local", "prepare_parameter"} == set(MESSAGES)


def test_unlisted_calls_need_an_admin() -> None:
    assert required_role("GET", "/api/secrets") is Role.ADMIN
    assert required_role("PATCH", "/api/scenes") is Role.ADMIN
    assert required_role("POST", "/elsewhere") is Role.ADMIN
    assert required_role("GET", "/assets/index.js") is Role.ANYONE


def test_strictest_matching_rule_applies() -> None:
    assert required_role("GET", "/api/materials/measured/0123456789abcdef/thumbnail.png") is Role.VIEW
    assert required_role("DELETE", "/api/scenes/0123456789abcdef") is Role.EDIT
    assert required_role("POST", "/api/scenes/0123456789abcdef/viewport") is Role.VIEW


def test_status_200_means_no_change() -> None:
    """The audit log depends on it: each call that changes something returns another status."""
    paths = create_app(Settings()).openapi()["paths"]
    for path, each in paths.items():
        for method, operation in each.items():
            if is_change(method.upper(), path):
                assert {"201", "202", "204"} & set(operation["responses"]), (method, path)


def test_queries_and_logins_are_not_changes() -> None:
    assert is_change("PUT", "/api/looks/Red")
    assert not is_change("POST", "/api/models/albedo")
    assert not is_change("POST", "/api/scenes/x/ball")
    assert not is_change("GET", "/api/audit")
    assert not is_change("POST", "/api/login")
