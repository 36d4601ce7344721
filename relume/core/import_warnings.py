"""What an importer has to say about a file, told apart by what it does to the picture."""

from __future__ import annotations

from typing import Any, Literal, get_args

Severity = Literal["unsupported", "approximated", "ignored"]
SEVERITIES: tuple[Severity, ...] = get_args(Severity)


class ImporterWarning(str):
    """A sentence, and what the thing it tells of does to the picture; without that, a plain string.

    Attributes:
        severity: "unsupported": something is missing, or looks other than the file says. "approximated": it looks much
            the same, but not quite. "ignored": the picture is the same without it.
    """

    severity: Severity

    def __new__(cls, sentence: str, severity: Severity) -> ImporterWarning:
        warning = super().__new__(cls, sentence)
        warning.severity = severity
        return warning

    def __getnewargs__(self) -> tuple[Any, ...]:
        return str(self), self.severity

    def document(self) -> dict[str, str]:
        """As JSON."""
        return {"text": str(self), "severity": self.severity}


def unsupported(sentence: str) -> ImporterWarning:
    """Something is missing in the picture, or looks other than the file says."""
    return ImporterWarning(sentence, "unsupported")


def approximated(sentence: str) -> ImporterWarning:
    """Something looks much the same as the file says, but not quite."""
    return ImporterWarning(sentence, "approximated")


def ignored(sentence: str) -> ImporterWarning:
    """Something is not used, and the picture is the same without it."""
    return ImporterWarning(sentence, "ignored")


def warning_of(document: object) -> ImporterWarning:
    """Read what `ImportRemark.document` wrote; plain sentences, of older scenes, may be anything."""
    if isinstance(document, dict) and document.get("severity") in SEVERITIES:
        return ImporterWarning(str(document["text"]), document["severity"])
    return unsupported(str(document))
