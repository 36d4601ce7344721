"""Responses conform to the OpenAPI document for generated requests."""

from typing import Any

import pytest
import schemathesis
from fastapi.testclient import TestClient
from hypothesis import HealthCheck, Phase, given, settings
from schemathesis.checks import not_a_server_error
from schemathesis.specs.openapi.checks import (
    content_type_conformance,
    response_schema_conformance,
    status_code_conformance,
)

from relume_server.app import create_app
from relume_server.settings import Settings

CHECKS = [not_a_server_error, status_code_conformance, content_type_conformance, response_schema_conformance]
SCHEMA = schemathesis.openapi.from_dict(create_app(Settings()).openapi())
# scene imports start a process each and file forms are streamed: tests/hostile covers them
UPLOADS = ["/api/scenes", "/api/materials/measured", "/api/environments", "/api/images", "/api/materials/imported"]
UPLOADS += ["/api/materials/btf/jobs", "/api/materials/btf/jobs/geometry", "/api/ies", "/api/luts"]
OPERATIONS = [result.ok() for result in SCHEMA.exclude(path=UPLOADS, method="POST").get_all_operations()]


def send(client: TestClient, case: Any) -> Any:
    arguments = case.as_transport_kwargs(base_url="http://testserver")
    arguments.pop("cookies")
    body = arguments.pop("data", None)
    if isinstance(body, str | bytes):
        arguments["content"] = body
    headers = {name: value for name, value in arguments.pop("headers").items() if value is not None}
    return client.request(**arguments, headers=headers)


@pytest.mark.parametrize("operation", OPERATIONS, ids=lambda operation: f"{operation.method} {operation.path}")
def test_responses_conform_to_the_schema(client: TestClient, operation: Any) -> None:
    @given(case=operation.as_strategy())
    @settings(
        max_examples=15,
        derandomize=True,
        database=None,
        deadline=None,
        phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
    )
    def run(case: Any) -> None:
        case.validate_response(send(client, case), checks=CHECKS)

    run()
