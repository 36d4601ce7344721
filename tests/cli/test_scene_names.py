"""Names as users type them."""

from __future__ import annotations

import pytest

from relume.core.errors import NotFoundError
from relume_cli.name_lookup import match_name, pick

KNOWN = [("aaaa1111", "Still life"), ("bbbb2222", "still-life 2"), ("cccc3333", "Box"), ("dddd4444", "box")]


@pytest.mark.parametrize(
    ("given", "identity"),
    [
        ("still_life", "aaaa1111"),
        ("STILL LIFE", "aaaa1111"),
        ("Still-Life", "aaaa1111"),
        (" still  life ", "aaaa1111"),
        ("\uff33till life", "aaaa1111"),  # a full-width S
        ("still life 2", "bbbb2222"),
        ("aaaa", "aaaa1111"),
        ("cccc3333", "cccc3333"),
        ("Box", "cccc3333"),
        ("box", "dddd4444"),
    ],
)
def test_entries_match_by_id_name_and_spelling_variants(given: str, identity: str) -> None:
    assert pick("scene", given, KNOWN, "import one") == identity


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ("BOX", "'BOX' names 2 scenes; give one of cccc3333 \\(Box\\), dddd4444 \\(box\\)"),
        ("aaa", "there is no scene 'aaa'; choose from aaaa1111 \\(Still life\\), .*; import one"),
        ("", "there is no scene ''"),
    ],
)
def test_ambiguous_names_are_reported(given: str, said: str) -> None:
    with pytest.raises(NotFoundError, match=said):
        pick("scene", given, KNOWN, "import one")


def test_spelling_variant_resolves_only_if_unique() -> None:
    assert match_name("FRONT", ["front", "back"]) == "front"
    assert match_name("Front", ["front", "Front"]) == "Front"
    assert match_name("FRONT", ["front", "Front"]) == "FRONT"
    assert match_name("top", ["front"]) == "top"
