"""The words of the field, and a reader of what the project says: see docs/glossary.md.

`python tests/vocabulary.py PATH…` lists what does not hold there.
"""

from __future__ import annotations

import ast
import io
import re
import sys
import tokenize
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

_RETIRED = """
arrived arrives arriving backdrop beams caretaker caught complaint complaints dormant dressed eye eyes finder
glance glances glimpse glimpses guest guests keeper lacking ladder lamp lamps leaning leant mend mended mends oracle
oracles panes parted patience remark remarks rims rung rungs seat seats seen shelf shelves skies sky spokes stills
suns tents thrown told truth truths uncounted unhidden untold untraced wears workshop worn
"""
RETIRED = frozenset(_RETIRED.split())
"""Words of identifiers and of file names that have a standard one."""

RETIRED_PHRASES = re.compile(
    r"\b("
    r"(?:an|the|moving|each|fixed|free) eyes?|eyes|lamps?|the sky|skies|glimpses?|truths?|finder|leant|suns|caretaker"
    r"|shelf|shelves|oracles?|rungs?|ladder|dormant|untold|parted|panes|rims|moving (?:view|picture|image)s?"
    r"|straight light|light between surfaces|at rest|in hand|at hand|passed on|sent on|thrown by|is told|are told"
    r")\b",
    re.IGNORECASE,
)
"""What sentences do not say: docstrings, comments, messages, documents and the editor."""

BRITISH = re.compile(
    r"\b(?!CancelledError)\w*(?:colour|grey|neighbour|centre\b|centred|normalis|initialis|quantis|optimis|recognis|behaviour|favour"
    r"|cancelled|cancelling|labelled|modelled|travell|catalogue|organis|honour|metre\b|metres\b)\w*",
    re.IGNORECASE,
)

_VAGUE = "found told kept seen place what part one of most known chosen both there about"
VAGUE_NAMES = frozenset(_VAGUE.split())
"""Names of locals and parameters that want their neighbors to be understood."""

FIRST_WORDS = re.compile(r"(What|Whether|How|Which|Where|Of|The same)\b")
"""How the first line of a docstring does not begin: it can be read alone."""


class Finding(NamedTuple):
    """One place that the glossary would word otherwise. kind: identifier, vague, prose, spelling or docstring."""

    kind: str
    location: str
    text: str


def words_of(identifier: str) -> list[str]:
    """The words of an identifier, lower case: `sunDisk`, `sun_disk` and `SunDisk` have the same."""
    spaced = re.sub(r"(?<=[a-z0-9])(?=[A-Z])|_", " ", identifier)
    return spaced.lower().split()


def _names(tree: ast.AST) -> Iterator[tuple[str, int, bool]]:
    """Names that a module gives: name, line, whether of a local or a parameter."""
    for node in ast.walk(tree):
        if isinstance(node, ast.arg):
            yield node.arg, node.lineno, True
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            yield node.id, node.lineno, True
        elif isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            yield node.name, node.lineno, False
        elif isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store):
            yield node.attr, node.lineno, False


def _prose(text: str, location: str) -> Iterator[Finding]:
    for offset, line in enumerate(text.splitlines()):
        for pattern, kind in ((RETIRED_PHRASES, "prose"), (BRITISH, "spelling")):
            if match := pattern.search(line):
                yield Finding(
                    kind, location if not offset else f"{location}+{offset}", f"{match[0]}: {line.strip()[:110]}"
                )


def read_python(path: Path) -> Iterator[Finding]:
    """What a Python file says otherwise than the glossary."""
    source = path.read_text(encoding="utf-8")
    tree = ast.parse(source)
    for name, line, is_local in _names(tree):
        if retired := RETIRED.intersection(words_of(name)):
            yield Finding("identifier", f"{path}:{line}", f"{name} ({', '.join(sorted(retired))})")
        if is_local and name in VAGUE_NAMES:
            yield Finding("vague", f"{path}:{line}", name)
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            first_line = (ast.get_docstring(node) or "").partition("\n")[0]
            if FIRST_WORDS.match(first_line):
                yield Finding("docstring", f"{path}:{getattr(node, 'lineno', 1)}", first_line[:110])
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and " " in node.value:
            yield from _prose(node.value, f"{path}:{node.lineno}")
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type == tokenize.COMMENT:
            yield from _prose(token.string, f"{path}:{token.start[0]}")


def read_script(path: Path) -> Iterator[Finding]:
    """What a TypeScript, CSS or HTML file says otherwise: names that it gives, comments and strings."""
    for line, text in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
        if re.match(r"\s*(import|export \{)", text):
            continue
        code = re.sub(r"//.*|/\*.*?\*/|^\s*\*.*|\"[^\"]*\"|`[^`]*`", " ", text)
        for name in set(re.findall(r"[A-Za-z_]\w*", code)):
            if retired := RETIRED.intersection(words_of(name)):
                yield Finding("identifier", f"{path}:{line}", f"{name} ({', '.join(sorted(retired))})")
        for name in re.findall(r"\b(?:const|let|function)\s+(\w+)", text):
            if name in VAGUE_NAMES:
                yield Finding("vague", f"{path}:{line}", name)
        yield from _prose(text, f"{path}:{line}")


def read_document(path: Path) -> Iterator[Finding]:
    """What a page of Markdown says otherwise."""
    yield from _prose(path.read_text(encoding="utf-8"), f"{path}:1")


READERS = {
    ".py": read_python, ".ts": read_script, ".tsx": read_script, ".css": read_script, ".html": read_script,
    ".md": read_document,
}  # fmt: skip


def read(paths: list[Path]) -> Iterator[Finding]:
    """All that files and folders say otherwise, file names included."""
    for path in paths:
        for file in sorted(path.rglob("*")) if path.is_dir() else [path]:
            if file.suffix not in READERS or {"node_modules", "dist", ".venv", "revisions"} & set(file.parts):
                continue
            if retired := RETIRED.intersection(words_of(file.stem.replace("-", "_"))):
                yield Finding("identifier", str(file), f"file name ({', '.join(sorted(retired))})")
            yield from READERS[file.suffix](file)


if __name__ == "__main__":
    for finding in read([Path(argument) for argument in sys.argv[1:]]):
        sys.stdout.write(f"{finding.kind:10} {finding.location}  {finding.text}\n")
