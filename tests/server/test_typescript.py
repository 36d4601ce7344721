"""The editor's generated types and value ranges agree with the server."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from relume.core.errors import ParameterError
from relume.look import complete, default_look
from relume.look.document import RANGES
from relume.look.light_validation import LIGHT_RANGES, default_light
from relume.scene.model import Material
from relume_server import typescript
from relume_server.schemas import protocol


@pytest.mark.parametrize("path", typescript.TARGETS, ids=lambda path: path.name)
def test_generated_file_is_current(path: Path) -> None:
    assert path.read_text(encoding="utf-8") == typescript.TARGETS[path](), "run python -m relume_server.typescript"


def test_every_message_is_in_its_union() -> None:
    text = typescript.generate_protocol()
    for model in (*typescript.CLIENT_MESSAGES, *typescript.SERVER_MESSAGES):
        assert f"  | {model.__name__}" in text
    declared = {m for m in vars(protocol).values() if isinstance(m, type) and issubclass(m, protocol.Message)}
    with_type = {model for model in declared if "type" in model.model_fields}
    assert with_type == {*typescript.CLIENT_MESSAGES, *typescript.SERVER_MESSAGES}


def test_defaults_are_optional_in_inputs_only() -> None:
    text = typescript.generate_protocol()
    assert "quality?: number;" in text
    assert "  max_degrees: number;" in text


def test_look_type_is_complete() -> None:
    text = typescript.generate_look()
    single = ("Point", "Spot", "Directional", "Rectangle", "Disc", "Sphere", "Tube", "Mesh")
    kinds = (*single, "Points", "Panels", "Directionals", "Surfaces")
    assert f"  lights: Record<string, {' | '.join(f'{kind}Look' for kind in kinds)}>;" in text
    assert "  texture: string | null;" in text
    assert "  shadow_catcher?: boolean;" in text


DEFAULT = default_look([Material("White", ({"model": "lambert", "color": [1.0, 1.0, 1.0]},))])
LIGHTS = [(kind, name) for kind in ("spot", "rectangle") for name in LIGHT_RANGES if name in default_light(kind)]


def first(start: Any, number: float) -> Any:
    """A field with another first number."""
    return [number, *start[1:]] if isinstance(start, list) else number


def every(start: Any, number: float) -> Any:
    """A field with another number everywhere."""
    return [number] * len(start) if isinstance(start, list) else number


def check_bounds(given: Callable[[Any], dict[str, Any]], start: Any, minimum: float, maximum: float) -> None:
    for field in (first(start, minimum), every(start, maximum)):
        complete(given(field), DEFAULT)
    for field in (first(start, minimum - 1), every(start, maximum + 1)):
        with pytest.raises(ParameterError):
            complete(given(field), DEFAULT)


@pytest.mark.parametrize(("section", "name"), [(section, name) for section in RANGES for name in RANGES[section]])
def test_ranges_of_look_values_agree_with_the_editor(section: str, name: str) -> None:
    check_bounds(lambda field: {section: {name: field}}, DEFAULT[section][name], *RANGES[section][name])


@pytest.mark.parametrize(("kind", "name"), LIGHTS)
def test_ranges_of_light_values_agree_with_the_editor(kind: str, name: str) -> None:
    light = default_light(kind)
    check_bounds(lambda field: {"lights": {"L": {**light, name: field}}}, light[name], *LIGHT_RANGES[name])
