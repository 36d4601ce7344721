"""File names by templates: values, padding, and everything that must not become a path."""

from __future__ import annotations

import pytest

from relume.core.errors import ParameterError
from relume.output.file_names import FileFields, file_names, parse_portable_template, parse_template, safe_stem

FIELDS = FileFields("Still life", "0123456789abcdef", "front", "Red night", 7)


def name_of(text: str, fields: FileFields = FIELDS, suffix: str = ".exr") -> str:
    return parse_portable_template("file_name", text, suffix).file_name(fields)


def test_fields_have_their_values_and_numbers_their_padding() -> None:
    assert name_of("{scene}_{view}_{look}.{frame:04}.exr") == "Still-life_front_Red-night.0007.exr"
    assert name_of("{frame}") == "7.exr"
    assert name_of("{frame:4}.EXR") == "0007.exr"
    assert name_of("a{frame:04d}") == "a0007.exr"
    assert name_of("x.{frame:02}", FIELDS._replace(frame=12345)) == "x.12345.exr"
    assert name_of("{bake}-{look}.v2") == "0123456789abcdef-Red-night.v2.exr"


@pytest.mark.parametrize(
    ("value", "name"),
    [
        ("../../etc/passwd", "x-etc-passwd.exr"),
        ("..", "x-picture.exr"),
        ("", "x-picture.exr"),
        ("a\"b'c", "x-a-b-c.exr"),
        ("🍎🍏", "x-picture.exr"),
        ("a\\b\r\nc", "x-a-b-c.exr"),
        ("{look}", "x-look.exr"),
        ("n" * 300, f"x-{'n' * 120}.exr"),
        ("灯" * 300, f"x-{'灯' * 40}.exr"),
    ],
)
def test_values_become_portable(value: str, name: str) -> None:
    assert name_of("x-{look}", FIELDS._replace(look=value)) == name


@pytest.mark.parametrize(
    "text",
    [
        "../{look}", "a/{look}", "a\\b", "/etc/x", "..", ".hidden", "-rf", "a b", "a:b", 'a"b', "🍎", "a\nb", "a\0b",
        ".exr", "{frame:0}", "{frame:12}", "{frame!r}", "{user}", "{}", "{look.__class__}", "{0}", "{look", "look}",
        "{{look}}", "{look}.png", "{look:9}",
    ],
)  # fmt: skip
def test_other_templates_are_rejected(text: str) -> None:
    with pytest.raises(ParameterError, match="file_name is"):
        name_of(text)


def test_long_names_are_rejected_and_nothing_is_cut_silently() -> None:
    with pytest.raises(ParameterError, match="at most 240 bytes"):
        name_of("{look}{scene}{view}.{frame:04}", FileFields("s" * 200, "b", "v" * 200, "l" * 200, 1))


def test_clashes_name_the_images_and_the_missing_field() -> None:
    def names(text: str, *looks: str) -> list[str]:
        template = parse_portable_template("file_name", text, ".png")
        return file_names(template, [FIELDS._replace(look=look, frame=index) for index, look in enumerate(looks)])

    assert names("{look}", "a", "b") == ["a.png", "b.png"]
    with pytest.raises(ParameterError, match=r"images 0 and 1 would both be 'front.png'; give .*{look} or {frame}"):
        names("{view}", "a", "b")
    with pytest.raises(ParameterError, match=r"images 0 and 2 would both be 'a-b.png'; give a name with {frame}"):
        names("{look}", "a/b", "c", "a?b")
    with pytest.raises(ParameterError, match="images 0 and 1"):
        names("{look}", "Day", "day")
    with pytest.raises(ParameterError, match="images 0 and 1"):
        names("{look}", "caf\u00e9", "cafe\u0301".replace("e\u0301", "\u00e9").upper())
    assert names("{look}.{frame}", "a/b", "a?b") == ["a-b.0.png", "a-b.1.png"]


def test_own_paths_keep_their_characters() -> None:
    assert parse_template("--output", "my (1) {look}.png").file_name(FIELDS) == "my (1) Red-night.png"
    assert safe_stem("-a b-") == "a-b"
