"""`relume token` and `relume audit`: their output, and the tokens that another process reads."""

from __future__ import annotations

import json
from datetime import UTC, datetime
from pathlib import Path

import pytest

from relume_cli.main import main
from relume_cli.tokens import open_access
from relume_server.auth.roles import Role


def run(capsys: pytest.CaptureFixture[str], data: Path, *words: str) -> tuple[int, str, str]:
    code = main([*words, "--data", str(data)])
    return code, *capsys.readouterr()


def test_token_is_printed_once_listed_revoked_and_audited(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, text, _ = run(capsys, tmp_path, "token", "add", "Ann", "--role", "edit", "--days", "30")
    assert code == 0
    identity = open_access(tmp_path).tokens.authenticate(text.strip())
    assert identity is not None
    assert (identity.name, identity.role) == ("Ann", Role.EDIT)
    _, listed, _ = run(capsys, tmp_path, "token", "list")
    assert listed.split()[:3] == [identity.id, "edit", "valid"]
    assert "until 20" in listed
    assert text.strip().split("_", 2)[2] not in listed
    assert run(capsys, tmp_path, "token", "revoke", "Ann")[0] == 0
    assert open_access(tmp_path).tokens.authenticate(text.strip()) is None
    assert "revoked" in run(capsys, tmp_path, "token", "list")[1]
    _, audit, _ = run(capsys, tmp_path, "audit", "--json")
    lines = [json.loads(line) for line in audit.splitlines()]
    assert [(line["what"], line["object"]) for line in lines] == [
        ("token add --role edit", "Ann"),
        ("token revoke", "Ann"),
    ]
    assert all(line["who"].endswith("(shell)") for line in lines)
    assert "token revoke  Ann" in run(capsys, tmp_path, "audit", "--last", "1")[1]


def test_tokens_are_printed_as_json(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    made = json.loads(run(capsys, tmp_path, "token", "add", "Ann", "--role", "edit", "--json")[1])
    identity = open_access(tmp_path).tokens.authenticate(made["token"])
    assert identity is not None
    assert json.loads(run(capsys, tmp_path, "token", "list", "--json")[1]) == {
        "id": identity.id,
        "name": "Ann",
        "role": "edit",
        "state": "valid",
        "created": datetime.fromtimestamp(identity.created, UTC).isoformat(),
        "expires": None,
    }


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["add", "Ann", "--role", "boss"], "relume: --role is 'boss'; give one of view, edit, admin\n"),
        (["add", " Ann"], "relume: name is ' Ann'; give 1 to 80 printable characters\n"),
        (["revoke", "Eve"], "relume: there is no valid token 'Eve'; relume token list shows them\n"),
    ],
)
def test_invalid_arguments_print_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], words: list[str], sentence: str
) -> None:
    code, text, said = run(capsys, tmp_path, "token", *words)
    assert (code, text, said) == (1, "", sentence)


@pytest.mark.parametrize("command", [["audit"], ["token", "list"]])
def test_unused_folder_is_reported(tmp_path: Path, capsys: pytest.CaptureFixture[str], command: list[str]) -> None:
    code, out, err = run(capsys, tmp_path / "mistyped", *command)
    assert (code, out) == (1, "")
    assert "a directory that relume has used" in err
    assert not (tmp_path / "mistyped" / "relume.db").exists()
