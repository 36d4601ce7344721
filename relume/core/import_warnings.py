"""What an importer has to say about a file, told apart by what it does to the picture."""

from __future__ import annotations

from typing import Any, Literal, get_args

Effect = Literal["wrong", "simplified", "unused"]
EFFECTS: tuple[Effect, ...] = get_args(Effect)


class ImportRemark(str):
    """A sentence, and what the thing it tells of does to the picture; without that, a plain string.

    Attributes:
        effect: "wrong": something is missing, or looks other than the file says. "simplified": it looks much the same,
            but not quite. "unused": the picture is the same without it.
    """

    effect: Effect

    def __new__(cls, sentence: str, effect: Effect) -> ImportRemark:
        remark = super().__new__(cls, sentence)
        remark.effect = effect
        return remark

    def __getnewargs__(self) -> tuple[Any, ...]:
        return str(self), self.effect

    def document(self) -> dict[str, str]:
        """As JSON."""
        return {"text": str(self), "effect": self.effect}


def unsupported(sentence: str) -> ImportRemark:
    """Something is missing in the picture, or looks other than the file says."""
    return ImportRemark(sentence, "wrong")


def approximated(sentence: str) -> ImportRemark:
    """Something looks much the same as the file says, but not quite."""
    return ImportRemark(sentence, "simplified")


def ignored(sentence: str) -> ImportRemark:
    """Something is not used, and the picture is the same without it."""
    return ImportRemark(sentence, "unused")


def warning_of(document: object) -> ImportRemark:
    """Read what `ImportRemark.document` wrote; plain sentences, of older scenes, may be anything."""
    if isinstance(document, dict) and document.get("effect") in EFFECTS:
        return ImportRemark(str(document["text"]), document["effect"])
    return unsupported(str(document))
