"""A session's message and the log when its storage fails: one sentence and one line."""

import errno
import logging
import os

import pytest
from fastapi.testclient import TestClient
from server_fakes import FakePicture
from session_client import SIGMA, Baked, open_session


def fails_with(monkeypatch: pytest.MonkeyPatch, error: Exception) -> None:
    """Make every picture fail from now on."""

    def advance(*_: object) -> None:
        raise error

    monkeypatch.setattr(FakePicture, "advance", advance)


@pytest.mark.parametrize(
    ("error", "code", "sentence"),
    [
        (OSError(errno.ENOSPC, os.strerror(errno.ENOSPC)), 1011, "the disk is full; free some space"),
        (OSError(errno.EIO, os.strerror(errno.EIO)), 1011, "Input/output error; free some space"),
    ],
)
def test_disk_failure_is_one_log_line_and_one_sentence(
    client: TestClient,
    baked: Baked,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
    error: Exception,
    code: int,
    sentence: str,
) -> None:
    with open_session(client, baked.bake) as session:
        session.exact(0)
        fails_with(monkeypatch, error)
        caplog.clear()
        session.edit(1, SIGMA, 0.3)
        with pytest.raises(ConnectionError) as ended:
            session.text("never")
    assert ended.value.args[0] == code
    assert ended.value.args[1].startswith(sentence)
    (line,) = [record for record in caplog.records if record.name.startswith("relume_server.session")]
    assert line.levelno == logging.ERROR
    assert not line.exc_info
    assert "\n" not in line.getMessage()
