"""The editor's types are those of the server."""

from server import protocol, typescript


def test_generated_file_is_up_to_date() -> None:
    assert typescript.TARGET.read_text(encoding="utf-8") == typescript.generate(), "run python -m server.typescript"


def test_every_message_is_in_its_union() -> None:
    text = typescript.generate()
    for model in (*typescript.CLIENT_MESSAGES, *typescript.SERVER_MESSAGES):
        assert f"  | {model.__name__}" in text
    declared = {m for m in vars(protocol).values() if isinstance(m, type) and issubclass(m, protocol.Message)}
    with_type = {model for model in declared if "type" in model.model_fields}
    assert with_type == {*typescript.CLIENT_MESSAGES, *typescript.SERVER_MESSAGES}


def test_defaults_are_optional_in_inputs_only() -> None:
    text = typescript.generate()
    assert "quality?: number;" in text
    assert "  max_degrees: number;" in text
