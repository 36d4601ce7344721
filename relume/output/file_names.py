"""Names of rendered files: portable characters, and templates with fields such as `{look}.{frame:04}`."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Sequence
from typing import NamedTuple

from relume.core.errors import Description, ParameterError

TEXT_FIELDS = ("scene", "bake", "view", "look")
SUFFIXES = (".exr", ".png", ".webp", ".mp4")
MAX_NAME_BYTES = 240  # file systems allow 255
_MAX_VALUE_BYTES = 120
_MAX_DIGITS = 9
_FIELD = re.compile(r"\{([^{}]*)\}")
_NUMBER = re.compile(r"frame(?::0?([1-9])d?)?")
_PLAIN = re.compile(r"[\w.-]*")


def safe_stem(text: str) -> str:
    """Replace all characters except letters, digits, dots, dashes and underscores by dashes."""
    plain = re.sub(r"[^\w.-]+", "-", text).encode()[:_MAX_VALUE_BYTES].decode(errors="ignore")
    return plain.strip(".-") or "picture"


class FileFields(NamedTuple):
    """Values of a template's fields for one file. `frame`: its number, at least 0."""

    scene: str
    bake: str
    view: str
    look: str
    frame: int


class FileTemplate(NamedTuple):
    """A file name with fields.

    Attributes:
        option: parameter that has the template, for messages. text: as given.
        parts: literal texts and fields by turns, a literal first and last.
    """

    option: str
    text: str
    parts: tuple[str, ...]

    def has_field(self, name: str) -> bool:
        """True if a field is in the template."""
        return any(field.partition(":")[0] == name for field in self.parts[1::2])

    def file_name(self, fields: FileFields) -> str:
        """Return the name of a file. Raises ParameterError if it is too long."""
        name = self.parts[0]
        for field, literal in zip(self.parts[1::2], self.parts[2::2], strict=True):
            name += _value(field, fields) + literal
        if len(name.encode()) > MAX_NAME_BYTES:
            raise ParameterError(self.option, name, f"a shorter name, of at most {MAX_NAME_BYTES} bytes")
        return name


def _value(field: str, fields: FileFields) -> str:
    if (match := _NUMBER.fullmatch(field)) is not None:
        return f"{fields.frame:0{match[1] or 1}}"
    return safe_stem(str(getattr(fields, field)))


def parse_template(option: str, text: str) -> FileTemplate:
    """Parse a file name with fields; it has no folder.

    Args:
        option: parameter that has the template, for messages. text: such as "{scene}_{look}.{frame:04}.exr".
    Raises:
        ParameterError: a field is unknown, or a brace has no partner.
    """
    parts = _FIELD.split(text)
    known = ", ".join(f"{{{name}}}" for name in TEXT_FIELDS)
    allowed = f"the fields {known}, {{frame}} and {{frame:04}}, with 1 to {_MAX_DIGITS} digits"
    for field in parts[1::2]:
        if field not in TEXT_FIELDS and _NUMBER.fullmatch(field) is None:
            raise ParameterError(option, f"{{{field}}}", allowed)
    if any(set("{}") & set(literal) for literal in parts[::2]):
        raise ParameterError(option, text, allowed)
    return FileTemplate(option, text, tuple(parts))


def parse_portable_template(option: str, text: str, suffix: str) -> FileTemplate:
    """Parse a file name with fields for any file system.

    Args:
        option: parameter that has the template, for messages. text: with or without the suffix.
        suffix: of the files, such as ".exr".
    Raises:
        ParameterError: it has a folder, other characters than letters, digits, dots, dashes and underscores, another
            suffix, or unknown fields.
    """
    if text.lower().endswith(suffix):
        text = text[: -len(suffix)]
    elif text.lower().endswith(SUFFIXES):
        raise ParameterError(option, text, f"a name that ends in {suffix}, the format of the images")
    template = parse_template(option, text + suffix)
    if text.startswith((".", "-")) or not text or not all(map(_PLAIN.fullmatch, template.parts[::2])):
        allowed = "letters, digits, dots, dashes, underscores and fields, without folders, and no dot or dash first"
        raise ParameterError(option, text, allowed)
    return template


def file_names(template: FileTemplate, files: Sequence[FileFields]) -> list[str]:
    """Return the name of each file.

    Names that differ only by upper and lower case clash, because some file systems do not tell them apart.

    Raises:
        ParameterError: two files would have the same name, or a name is too long.
    """
    names = [template.file_name(fields) for fields in files]
    first_index: dict[str, int] = {}
    for index, name in enumerate(names):
        other = first_index.setdefault(unicodedata.normalize("NFC", name).casefold(), index)
        if other != index:
            value = Description(f"{template.text[:80]!r}, so that images {other} and {index} would both be {name!r}")
            raise ParameterError(template.option, value, _distinction(files[other], files[index], template))
    return names


def _distinction(first: FileFields, second: FileFields, template: FileTemplate) -> str:
    """Name fields in which two files differ and that the template does not have."""
    differing = [name for name in FileFields._fields if getattr(first, name) != getattr(second, name)]
    if missing := [f"{{{name}}}" for name in differing if not template.has_field(name)]:
        return f"a name with {' or '.join(missing)}"
    return f"other names: they differ only in characters that file names do not have ({', '.join(differing)})"
