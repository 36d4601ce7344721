"""The rows of a PLY file as columns; a list column has the lengths of its lists and their concatenated values."""

from __future__ import annotations

import re
import warnings
from collections.abc import Collection, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from relume.core.errors import SceneError
from relume.scene_io.obj_ply.text import NAN_TEXT

Lists = tuple[NDArray[np.int64], NDArray[Any]]
Columns = dict[str, NDArray[Any] | Lists]
Layout = list[tuple[str, int]]  # NumPy type and count of each field in a row
NAN_WORD = re.compile(rf"(?<!\S){NAN_TEXT.pattern}(?!\S)", re.IGNORECASE)
SHORT = "the .ply file has fewer rows than its header says; export or download it again"


@dataclass(frozen=True)
class Property:
    """A column of an element; `count` is the type of a list's length, None for a single value."""

    name: str
    type: str
    count: str | None = None


@dataclass(frozen=True)
class Element:
    """A number of rows with the same properties."""

    name: str
    rows: int
    properties: tuple[Property, ...]


class PlyRows(Protocol):
    """The unread rows of a file, as numbers or as bytes."""

    @property
    def remaining(self) -> int:
        """Amount of unread data; a row takes at least one for each property."""

    def take(self, kind: str, count: int) -> NDArray[Any]:
        """Read the next values of one type. Raises SceneError if there are fewer."""

    def table(self, layout: Layout, rows: int) -> list[NDArray[Any]] | None:
        """Peek at the next rows, (rows, count) for each field; None if there are fewer."""

    def skip(self, layout: Layout, rows: int) -> None:
        """Skip rows."""


class TextRows:
    """Rows of a text file as a sequence of numbers."""

    def __init__(self, body: memoryview) -> None:
        try:
            text = bytes(body).decode("ascii")
            text = NAN_WORD.sub("nan", text) if "#" in text or "(" in text else text
            with warnings.catch_warnings():  # NumPy before 2.3 only warns if it stops at text
                warnings.simplefilter("error", DeprecationWarning)
                self._numbers = np.fromstring(text, np.float64, sep=" ")
        except (ValueError, DeprecationWarning):
            raise SceneError("the .ply file has text instead of numbers; export it again") from None
        self._offset = 0

    @property
    def remaining(self) -> int:
        """Number of unread numbers."""
        return len(self._numbers) - self._offset

    def take(self, kind: str, count: int) -> NDArray[Any]:
        """Read the next values, as in `PlyRows`."""
        if count > self.remaining:
            raise TruncatedError(SHORT)
        self._offset += count
        return self._numbers[self._offset - count : self._offset]

    def table(self, layout: Layout, rows: int) -> list[NDArray[Any]] | None:
        """Peek at the next rows, as in `PlyRows`."""
        width = sum(count for _, count in layout)
        if rows * width > self.remaining:
            return None
        values = self._numbers[self._offset : self._offset + rows * width].reshape(rows, width)
        return np.split(values, np.cumsum([count for _, count in layout])[:-1], axis=1)

    def skip(self, layout: Layout, rows: int) -> None:
        """Skip rows, as in `PlyRows`."""
        self._offset += rows * sum(count for _, count in layout)


class BinaryRows:
    """Rows of a binary file in one byte order, "<" or ">"."""

    def __init__(self, body: memoryview, order: str) -> None:
        self._body, self._order, self._offset = body, order, 0

    @property
    def remaining(self) -> int:
        """Number of unread bytes."""
        return len(self._body) - self._offset

    def take(self, kind: str, count: int) -> NDArray[Any]:
        """Read the next values, as in `PlyRows`."""
        dtype = np.dtype(self._order + kind)
        if count * dtype.itemsize > self.remaining:
            raise TruncatedError(SHORT)
        values = np.frombuffer(self._body, dtype, count, self._offset)
        self._offset += count * dtype.itemsize
        return values

    def table(self, layout: Layout, rows: int) -> list[NDArray[Any]] | None:
        """Peek at the next rows, as in `PlyRows`."""
        row_bytes = sum(np.dtype(kind).itemsize * count for kind, count in layout)
        if rows * row_bytes > self.remaining:
            return None
        dtype = np.dtype([(str(k), self._order + kind, (count,)) for k, (kind, count) in enumerate(layout)])
        values = np.frombuffer(self._body, dtype, rows, self._offset)
        return [values[str(k)] for k in range(len(layout))]

    def skip(self, layout: Layout, rows: int) -> None:
        """Skip rows, as in `PlyRows`."""
        self._offset += rows * sum(np.dtype(kind).itemsize * count for kind, count in layout)


class TruncatedError(SceneError):
    """The file ends before its rows."""


def read_element(rows: PlyRows, element: Element) -> Columns:
    """Read the columns of the next element, with fewer rows than in the header if the file ends early.

    Raises:
        SceneError: a list has an invalid length.
    """
    if element.rows == 0 or not element.properties:
        return {}
    return _uniform(rows, element) or _row_by_row(rows, element)


def _uniform(rows: PlyRows, element: Element) -> Columns | None:
    """Read all rows at once if the lists of each property have equal lengths; otherwise return None."""
    layout: Layout = []
    for p in element.properties:
        if p.count is not None:
            layout.append((p.count, 1))
            first = rows.table([*layout, (p.type, 0)], 1)
            if first is None:
                return None
            layout.append((p.type, max(_length(first[len(layout) - 1][0, 0]), 0)))
        else:
            layout.append((p.type, 1))
    blocks = rows.table(layout, element.rows)
    if blocks is None:
        return None
    columns: Columns = {}
    block_iterator = iter(zip(blocks, layout, strict=True))
    for p in element.properties:
        values, _ = next(block_iterator)
        if p.count is None:
            columns[p.name] = values[:, 0]
            continue
        items, (_, count) = next(block_iterator)
        if not (values == count).all():
            return None
        columns[p.name] = (np.full(element.rows, count, np.int64), items.reshape(-1))
    rows.skip(layout, element.rows)
    return columns


def _row_by_row(rows: PlyRows, element: Element) -> Columns:
    single: dict[str, list[float]] = {p.name: [] for p in element.properties if p.count is None}
    lists: dict[str, list[NDArray[Any]]] = {p.name: [] for p in element.properties if p.count is not None}
    num_rows = 0
    with suppress(TruncatedError):
        for _ in range(min(element.rows, rows.remaining // len(element.properties))):
            for p in element.properties:
                if p.count is None:
                    single[p.name].append(float(rows.take(p.type, 1)[0]))
                else:
                    lists[p.name].append(rows.take(p.type, _length(rows.take(p.count, 1)[0])))
            num_rows += 1
    columns: Columns = {name: np.array(values[:num_rows]) for name, values in single.items()}
    for name, values in lists.items():
        lengths = np.array([len(row) for row in values[:num_rows]], np.int64)
        columns[name] = (lengths, np.concatenate([np.zeros(0), *values[:num_rows]]))
    return columns


def _length(value: float) -> int:
    if not 0 <= value < 2**31 or value != int(value):
        raise SceneError("a list of the .ply file has an invalid length; export it again")
    return int(value)


def whole_numbers(values: NDArray[Any]) -> NDArray[np.int64]:
    """Indices; a value that is no integer or too large becomes -2, which is always out of range."""
    is_whole = (
        (np.abs(values) < 2**40) & (values == np.rint(values))
        if values.dtype.kind == "f"
        else np.ones(values.shape, np.bool_)
    )
    return np.where(is_whole, values, -2).astype(np.int64)


def read_body(rows: PlyRows, elements: Sequence[Element], needed: Collection[str]) -> dict[str, Columns]:
    """Read the columns of all elements by name, up to the last of those needed. Raises SceneError.

    Args:
        rows: the body. elements: of the header. needed: names of elements; later ones are ignored.
    """
    names = [element.name for element in elements]
    if any(a == b for a, b in pairwise(sorted(names))):
        raise SceneError("the .ply file has two elements with the same name; export it again")
    last = max((k for k, name in enumerate(names) if name in needed), default=-1)
    return {element.name: read_element(rows, element) for element in elements[: last + 1]}


def count_rows(columns: Columns) -> int:
    """Number of rows that were read."""
    return max((len(column[0] if isinstance(column, tuple) else column) for column in columns.values()), default=0)
