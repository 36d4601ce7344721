"""Text and numbers of OBJ, MTL and PLY files, as the programs of four decades write them."""

from __future__ import annotations

import codecs
import re

from relume.core.errors import count_text
from relume.core.import_warnings import UNREADABLE, ImporterWarning, unsupported
from relume.scene_io.text_encoding import to_utf8

NAN_TEXT = re.compile(r"[+-]?(?:nan(?:\(\w*\))?|\d\.#\w*)", re.IGNORECASE)
"""Numbers that are none, as the C libraries of several systems write them: `-nan(ind)`, `1.#QNAN`, `-1.#IND00`."""
MAX_EXAMPLES = 3


def number(token: str | bytes) -> float:
    """Parse a number; NaN for the texts of C libraries. Raises ValueError."""
    try:
        return float(token)
    except ValueError:
        if NAN_TEXT.fullmatch(token if isinstance(token, str) else token.decode("ascii", "replace")):
            return float("nan")
        raise


def plain_lines(data: bytes) -> bytes:
    """Remove the byte order mark, end all lines with a line feed, and join those that a backslash continues."""
    data = to_utf8(data).removeprefix(codecs.BOM_UTF8)
    if b"\r" in data:
        data = data.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    return data.replace(b"\\\n", b" ") if b"\\\n" in data else data


def decode_text(data: bytes) -> str:
    """Decode UTF-8, or else Windows's extension of Latin-1, which older programs write."""
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError:
        return data.decode("cp1252", "replace")


def before_comment(tokens: list[bytes]) -> list[bytes]:
    """The words of a line before the first that begins with "#", as `1.#QNAN` does not."""
    first = next((k for k, token in enumerate(tokens) if token.startswith(b"#")), len(tokens))
    return tokens[:first]


def strip_comment(text: str) -> str:
    """Remove a comment: "#" between spaces. Names such as "Material #25" have none."""
    return re.split(r"(?:^|\s)#(?:\s|$)", text, maxsplit=1)[0].strip()


def counted(number: int, noun: str) -> str:
    """A number with its noun: "1 face", "2 faces"."""
    return count_text(number, noun, f"{noun}s")


class Faults:
    """Faults of one kind in a file, for one warning."""

    def __init__(self) -> None:
        self.count = 0
        self._examples: list[str] = []

    def add(self, location: str, content: str) -> None:
        """Add a fault: its location, and its text in the file."""
        self.count += 1
        if len(self._examples) < MAX_EXAMPLES:
            self._examples.append(f"{location} (“{UNREADABLE.sub('', content.strip()[:40])}”)")

    def warnings(self, sentence: str) -> list[ImporterWarning]:
        """One warning with the first faults, or none: `sentence` ends before them."""
        if not self.count:
            return []
        suffix = f" and {self.count - len(self._examples):,} more" if self.count > len(self._examples) else ""
        return [unsupported(f"{sentence} {', '.join(self._examples)}{suffix}.")]
