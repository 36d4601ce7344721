"""Progress without a terminal: occasional lines, timed by a separate clock."""

from __future__ import annotations

import pytest

from relume_cli.backup.transfer_bar import transfer_bar
from relume_cli.terminal.printing import is_quiet
from relume_cli.terminal.progress import MAX_INTERVAL_S, ProgressLines, progress, report_part


class Clock:
    """A clock that the test advances."""

    def __init__(self) -> None:
        self.now = 0.0

    def __call__(self) -> float:
        return self.now


def lines_of(shares: list[tuple[float, float]]) -> list[str]:
    """Lines printed for progress at given seconds."""
    clock, said = Clock(), list[str]()
    report = ProgressLines("bake", said.append, clock)
    for at_s, share in shares:
        clock.now = at_s
        report(share, "tracing")
    return said


def test_each_tenth_prints_a_line() -> None:
    said = lines_of([(10.0 * k, k / 20) for k in range(21)])
    assert said == [f"bake: {10 * k}%, tracing" for k in range(1, 11)]


def test_slow_work_prints_lines_between_tenths() -> None:
    said = lines_of([(float(second), second / 100_000) for second in range(int(4 * MAX_INTERVAL_S) + 1)])
    assert said == ["bake: 0%, tracing"] * 4


def test_quick_work_prints_nothing() -> None:
    assert lines_of([(k / 100, k / 100) for k in range(101)]) == []


def test_restarted_work_is_reported_again() -> None:
    assert lines_of([(10, 0.95), (20, 0.05), (30, 0.15)]) == ["bake: 95%, tracing", "bake: 15%, tracing"]


def test_progress_of_parts_maps_to_fractions_of_the_whole() -> None:
    reports: list[tuple[float, str]] = []

    def report(share: float, detail: str = "") -> None:
        reports.append((share, detail))

    report_part(report, 1, 4, "sun")(0.5)
    assert reports == [(0.375, "sun")]


@pytest.fixture
def no_line_interval(monkeypatch: pytest.MonkeyPatch) -> None:
    """Lines have no minimum interval."""
    monkeypatch.setattr("relume_cli.terminal.progress.MIN_INTERVAL_S", 0.0)


@pytest.mark.usefixtures("no_line_interval")
def test_lines_go_to_stderr_and_quiet_has_none(capsys: pytest.CaptureFixture[str]) -> None:
    with progress("render") as report:
        report(0.5, "sun")
    assert capsys.readouterr() == ("", "render: 50%, sun\n")
    token = is_quiet.set(True)
    try:
        with progress("render") as report:
            report(0.5, "sun")
    finally:
        is_quiet.reset(token)
    assert capsys.readouterr() == ("", "")


@pytest.mark.usefixtures("no_line_interval")
def test_copies_print_their_progress(capsys: pytest.CaptureFixture[str]) -> None:
    with transfer_bar("backing up") as begin:
        advance = begin(4_000_000)
        advance(1_000_000)
        advance(2_000_000)
    assert capsys.readouterr().err.splitlines() == [
        "backing up: 25%, 1 MB of 4 MB",
        "backing up: 75%, 3 MB of 4 MB",
    ]
