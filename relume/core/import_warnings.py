"""Warnings of importers about a file, classified by their effect on the image."""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Any, Literal, get_args

Severity = Literal["unsupported", "approximated", "ignored"]
SEVERITIES: tuple[Severity, ...] = get_args(Severity)

LOCATIONS = tuple(
    re.compile(pattern)
    for pattern in (
        r"(?:mesh|material|light|node|camera|primitive) “[^”]*”",
        r"(?:image|texture) “[^”]*”",
        r"line [\d,]+",
        r"“[^”]+\.\w{2,5}”",
        r"the (?:\.\w+|material) file|the mesh",
    )
)
"""The part of a file that a sentence is about, the most telling first."""
UNREADABLE = re.compile(r"[\x00-\x1f\x7f-\x9f\u2028-\u202e\u2066-\u2069\ud800-\udfff]")


def quote(name: str) -> str:
    """Quote a name from a file for a message, without unreadable characters."""
    return f"“{UNREADABLE.sub('', name[:80])}”"


class ImporterWarning(str):
    """A sentence with a severity; otherwise a plain string.

    Attributes:
        severity: "unsupported": something is missing or looks different from the file. "approximated": it looks almost
            the same. "ignored": the image is the same without it.
    """

    severity: Severity

    def __new__(cls, sentence: str, severity: Severity) -> ImporterWarning:
        warning = super().__new__(cls, sentence)
        warning.severity = severity
        return warning

    def __getnewargs__(self) -> tuple[Any, ...]:
        return str(self), self.severity

    @property
    def location(self) -> str:
        """The part of the file that the sentence names, such as a material; empty if none."""
        return next((match[0] for pattern in LOCATIONS if (match := pattern.search(self))), "")

    def document(self) -> dict[str, str]:
        """Convert to JSON."""
        return {"text": str(self), "severity": self.severity, "where": self.location}


def with_subject(subject: str, predicates: Iterable[ImporterWarning]) -> list[ImporterWarning]:
    """Make sentences of warnings without a subject, as readers of pixels return them.

    Args:
        subject: what they are about, such as a quoted name. predicates: the rest of each sentence.
    """
    return [ImporterWarning(f"{subject} {predicate}", predicate.severity) for predicate in predicates]


def by_severity(warnings: Iterable[ImporterWarning]) -> list[ImporterWarning]:
    """Sort warnings, the most severe first."""
    return sorted(warnings, key=lambda warning: SEVERITIES.index(warning.severity))


def unsupported(sentence: str) -> ImporterWarning:
    """Make a warning for a feature that is missing in the image or looks different from the file."""
    return ImporterWarning(sentence, "unsupported")


def approximated(sentence: str) -> ImporterWarning:
    """Make a warning for a feature that looks almost as in the file."""
    return ImporterWarning(sentence, "approximated")


def ignored(sentence: str) -> ImporterWarning:
    """Make a warning for a feature that is not used and does not change the image."""
    return ImporterWarning(sentence, "ignored")


def warning_of(document: object) -> ImporterWarning:
    """Read the output of `ImporterWarning.document`; a plain string of an older scene counts as unsupported."""
    if isinstance(document, dict) and document.get("severity") in SEVERITIES:
        return ImporterWarning(str(document["text"]), document["severity"])
    return unsupported(str(document))
