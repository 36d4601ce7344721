"""Check of XML before MaterialX reads it: its reader is recursive, and a document must not name other files."""

from __future__ import annotations

from typing import Any
from xml.parsers import expat

from relume.core.errors import MaterialError

MAX_BYTES = 16 << 20
MAX_ELEMENTS = 100_000
MAX_DEPTH = 32
_INCLUDE = "include"


def check_xml(data: bytes) -> list[str]:
    """Check a document's size and depth, and return the files that it includes, which are not read.

    Raises:
        MaterialError: it is not XML, too large, nested too deeply, or defines entities.
    """
    if len(data) > MAX_BYTES:
        raise MaterialError(f"the .mtlx file has more than {MAX_BYTES >> 20} MB; remove what the materials don't need")
    scan = _Scan()
    try:
        scan.parser.Parse(data, True)
    except MaterialError:
        raise
    except expat.ExpatError as error:
        reason = expat.errors.messages.get(error.code, "damaged")
        raise MaterialError(f"line {error.lineno} of the .mtlx file is not XML ({reason}); export it again") from None
    except (ValueError, LookupError, UnicodeError):  # unknown encodings
        raise MaterialError("the .mtlx file has an unknown text encoding; save it as UTF-8") from None
    if scan.root != "materialx":
        raise MaterialError("the file is XML, but not MaterialX; give a .mtlx file, or a .zip with one and its images")
    return scan.includes


class _Scan:
    """Counts elements, and stops at the limits."""

    def __init__(self) -> None:
        self.parser = expat.ParserCreate(namespace_separator=" ")
        self.parser.StartElementHandler = self._start
        self.parser.EndElementHandler = self._end
        self.parser.EntityDeclHandler = self._entity
        self.root, self.includes = "", list[str]()
        self._num_elements = self._depth = 0

    def _start(self, name: str, attributes: dict[str, str]) -> None:
        self.root = self.root or name
        self._num_elements += 1
        self._depth += 1
        if self._num_elements > MAX_ELEMENTS:
            raise MaterialError(f"the .mtlx file has more than {MAX_ELEMENTS:,} elements; split it")
        if self._depth > MAX_DEPTH:
            raise MaterialError(f"the .mtlx file is nested deeper than {MAX_DEPTH} elements; export it again")
        if name.rpartition(" ")[2] == _INCLUDE:
            self.includes.append(attributes.get("href", ""))

    def _end(self, _: str) -> None:
        self._depth -= 1

    def _entity(self, *_: Any) -> None:
        raise MaterialError("the .mtlx file defines entities, which are not read; export it again")
