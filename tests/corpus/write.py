"""Rewrite the table of outcomes: `python tests/corpus/write.py [FOLDER]`, or `make corpus`.

FOLDER: another corpus, whose table is its own `outcomes.json`; RELUME_CORPUS names it for the test.
"""

from __future__ import annotations

import sys
from pathlib import Path

from corpus_outcomes import SCENES, list_files, outcome_of, peer_reads, suffix_of, summary, write_table

HERE = Path(__file__).resolve().parent
SHARED = HERE.parents[2] / "shared" / "data"


def main() -> None:
    """Open all files, write the table, and print the summary."""
    root = Path(sys.argv[1]) if len(sys.argv) > 1 else SHARED
    target = root / "outcomes.json" if len(sys.argv) > 1 else HERE / "outcomes.json"
    if not root.is_dir():
        sys.exit(f"there is no folder {root}; give the folder of a corpus")
    table = {}
    for name in list_files(root):
        table[name] = outcome_of(root, name)
        if table[name]["outcome"] != "refused" or suffix_of(name) not in SCENES:
            continue
        if peer_reads(root / name):
            table[name]["peer"] = "reads it"
    write_table(target, table)
    sys.stdout.write(summary(table) + "\n")


if __name__ == "__main__":
    main()
