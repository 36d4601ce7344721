"""How far long work is where there is no terminal: a line now and then, told by a clock of its own."""

from __future__ import annotations

import pytest

from relume_cli.backup.transfer_bar import transfer_bar
from relume_cli.terminal.printing import is_quiet
from relume_cli.terminal.progress import MAX_INTERVAL_S, ProgressLines, progress, report_part


class Clock:
    """Seconds that a test lets pass."""

    def __init__(self) -> None:
        self.now = 0.0

    def __call__(self) -> float:
        return self.now


def lines_of(shares: list[tuple[float, float]]) -> list[str]:
    """What is said where work is so far at such seconds."""
    clock, said = Clock(), list[str]()
    tell = ProgressLines("bake", said.append, clock)
    for at_s, share in shares:
        clock.now = at_s
        tell(share, "tracing")
    return said


def test_there_is_a_line_for_each_tenth() -> None:
    said = lines_of([(10.0 * k, k / 20) for k in range(21)])
    assert said == [f"bake: {10 * k}%, tracing" for k in range(1, 11)]


def test_slow_work_is_heard_of_all_the_same() -> None:
    said = lines_of([(float(second), second / 100_000) for second in range(int(4 * MAX_INTERVAL_S) + 1)])
    assert said == ["bake: 0%, tracing"] * 4


def test_quick_work_says_nothing() -> None:
    assert lines_of([(k / 100, k / 100) for k in range(101)]) == []


def test_work_that_begins_anew_is_followed_again() -> None:
    assert lines_of([(10, 0.95), (20, 0.05), (30, 0.15)]) == ["bake: 95%, tracing", "bake: 15%, tracing"]


def test_parts_of_work_are_shares_of_all() -> None:
    reports: list[tuple[float, str]] = []

    def tell(share: float, detail: str = "") -> None:
        reports.append((share, detail))

    report_part(tell, 1, 4, "sun")(0.5)
    assert reports == [(0.375, "sun")]


@pytest.fixture
def hurried(monkeypatch: pytest.MonkeyPatch) -> None:
    """No line waits for the one before."""
    monkeypatch.setattr("relume_cli.terminal.progress.MIN_INTERVAL_S", 0.0)


@pytest.mark.usefixtures("hurried")
def test_lines_go_to_stderr_and_quiet_has_none(capsys: pytest.CaptureFixture[str]) -> None:
    with progress("render") as tell:
        tell(0.5, "sun")
    assert capsys.readouterr() == ("", "render: 50%, sun\n")
    token = is_quiet.set(True)
    try:
        with progress("render") as tell:
            tell(0.5, "sun")
    finally:
        is_quiet.reset(token)
    assert capsys.readouterr() == ("", "")


@pytest.mark.usefixtures("hurried")
def test_a_copy_says_how_much_is_there(capsys: pytest.CaptureFixture[str]) -> None:
    with transfer_bar("backing up") as begin:
        advance = begin(4_000_000)
        advance(1_000_000)
        advance(2_000_000)
    assert capsys.readouterr().err.splitlines() == [
        "backing up: 25%, 1 MB of 4 MB",
        "backing up: 75%, 3 MB of 4 MB",
    ]
