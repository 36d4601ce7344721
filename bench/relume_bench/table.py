"""Merge figures into docs/performance.json and docs/accuracy.json, and write the tables of both pages from them.

`relume bench --json | python -m relume_bench.table`. A file has the list that `relume bench --json` prints, with the
context of each figure; figures that a run did not measure keep their entries. Tables are between two marks.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Collection
from typing import Any

from relume_bench import asset_table
from relume_bench.pages import DOCS, PAGES, find_document, value_text
from relume_bench.registry import find_older
from relume_bench.targets import TARGETS, find_peer

BEGIN, END = "<!-- figures, written by relume_bench.table -->", "<!-- end of figures -->"
HEAD = ["| figure | value | target | limit or peer | date |", "|---|---|---|---|---|"]
OLDER = " \\*"  # behind the date of a figure that is older than its code


def row(figure: dict[str, Any], *, is_older: bool = False) -> str:
    """One row of a table. is_older: than the code that it measures"""
    date = str(figure["context"].get("measured_on", "")).partition(",")[0]
    name = figure["name"]
    target = TARGETS.get(name, "") + (" (missed)" if "known_miss" in figure else "")
    return f"| `{name}` | {value_text(figure)} | {target} | {find_peer(name)} | {date}{OLDER * is_older} |"


def merge(stored: list[dict[str, Any]], measured: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Stored figures, replaced by measured ones of the same name, sorted by name; the reasons of known misses stay."""
    figures = {figure["name"]: figure for figure in stored}
    for figure in measured:
        miss = figures.get(figure["name"], {}).get("known_miss")
        figures[figure["name"]] = {**figure, **({} if miss is None else {"known_miss": miss})}
    return [figures[name] for name in sorted(figures)]


def filled(text: str, figures: list[dict[str, Any]], older: Collection[str] = ()) -> str:
    """Fill a page with these figures. Raises ValueError if the page has no marks.

    Args:
        text: of the page. figures: entries of its file. older: names of figures older than the code that they measure.
    """
    before, _, suffix = text.partition(BEGIN)
    _, mark, after = suffix.partition(END)
    if not mark:
        raise ValueError("the page has no table of figures; add the two marks of relume_bench.table")
    return "\n".join([before + BEGIN, *HEAD, *(row(f, is_older=f["name"] in older) for f in figures), END]) + after


def main() -> int:
    """Read the JSON list from standard input and write both files and pages."""
    measured = json.load(sys.stdin)
    for name in PAGES:
        file, page = DOCS / f"{name}.json", DOCS / f"{name}.md"
        mine = [figure for figure in measured if find_document(figure["name"]) == name]
        figures = merge(json.loads(file.read_text()), mine)
        lines = ",".join("\n" + json.dumps(figure, ensure_ascii=False) for figure in figures)
        file.write_text(f"[{lines}\n]\n")
        older = find_older({figure["name"]: figure for figure in figures})
        page.write_text(filled(page.read_text(), figures, older))
        asset_table.fill_page(DOCS, figures)
    return 0


if __name__ == "__main__":
    sys.exit(main())
