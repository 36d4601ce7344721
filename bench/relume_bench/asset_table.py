"""The table of files in docs/accuracy-assets.md, from the figures of `relume_bench.assets` in docs/accuracy.json.

`relume_bench.table` writes it. The last column says why a file is past a target: it is written by hand, and kept.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

BEGIN, END = "<!-- files, written by relume_bench.asset_table -->", "<!-- end of files -->"
PAGE = "accuracy-assets.md"
_HEAD = ["| file | RMSE | bias | HDR-FLIP | p99 | why |", "|---|---|---|---|---|---|"]
_WHY = 5  # column


def fill_page(docs: Path, figures: Iterable[Mapping[str, Any]]) -> None:
    """Write the table into the page, if there is one, from the context of `assets.rmse_median`.

    Args:
        docs: folder of the pages. figures: entries of accuracy.json.
    """
    for by_file in (f["context"]["by_file"] for f in figures if f["name"] == "assets.rmse_median"):
        page = docs / PAGE
        page.write_text(filled(page.read_text(encoding="utf-8"), by_file), encoding="utf-8")


def filled(text: str, by_file: Mapping[str, Mapping[str, Any]]) -> str:
    """The text with a table of these files, the worst first; failures come last.

    Args:
        text: of the page. by_file: results of `relume_bench.assets.compared` by name.
    """
    before, _, rest = text.partition(BEGIN)
    old, _, after = rest.partition(END)
    cells = [[cell.strip() for cell in line.split("|")[1:-1]] for line in old.splitlines() if line.startswith("| `")]
    reasons = {row[0].strip("`"): row[_WHY] for row in cells}
    names = sorted(by_file, key=lambda name: -by_file[name].get("rmse", -1.0))
    rows = [_row(name, by_file[name], reasons.get(name, "")) for name in names]
    return "\n".join([before + BEGIN, *_HEAD, *rows, END]) + after


def _row(name: str, result: Mapping[str, Any], why: str) -> str:
    if "error" in result:
        return f"| `{name}` |  |  |  |  | failed: {result['error'].replace('|', '/')} |"
    percent = [f"{100 * result[key]:.1f} %" for key in ("rmse", "bias")]
    return f"| `{name}` | {percent[0]} | {percent[1]} | {result['flip']:.3f} | {result['p99']:.3f} | {why} |"
