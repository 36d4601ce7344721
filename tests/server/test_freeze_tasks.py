"""The freeze of a session: status messages, handover, cancellation and cleanup."""

import asyncio
import gc
import threading
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, Literal

import pytest
from coroutines import run_in_thread
from server_fakes import Control, fake_job

from relume.core.errors import ProtocolError, StoreError
from relume_server.runtime.executors import Threads
from relume_server.session.frames.precompute import Precomputer
from relume_server.telemetry.metrics import Metrics


class Recorder:
    """A socket that records messages."""

    def __init__(self) -> None:
        self.states: list[str] = []

    async def send(self, message: Any) -> None:
        self.states.append(message.state)


def fail(progress: Any, is_canceled: Any) -> str:
    """The work of a job that fails."""
    raise StoreError("damaged; bake again")


class DisconnectedClient(Recorder):
    """A client that has disconnected."""

    async def send(self, message: Any) -> None:
        raise ProtocolError("nothing was read; reload the page", 4408)


def run(scenario: Any, recorder: Recorder | None = None) -> tuple[list[str], list[str]]:
    """Run scenario(freezer, control, news) in an event loop; return the sent states and the unretrieved errors."""
    unhandled_errors: list[str] = []
    recorder = recorder or Recorder()

    async def main() -> None:
        asyncio.get_running_loop().set_exception_handler(lambda _, context: unhandled_errors.append(context["message"]))
        threads, news = Threads(), asyncio.Event()
        try:
            await scenario(Precomputer(recorder, threads, Metrics(), None, news), Control(), news)  # type: ignore[arg-type]
        finally:
            threads.close()
        gc.collect()

    run_in_thread(main())
    return recorder.states, unhandled_errors


@pytest.mark.parametrize("state", ["precomputing", "shading"])
def test_freeze_sends_its_state_and_is_ready_after_handover(state: Literal["precomputing", "shading"]) -> None:
    recorder = Recorder()

    async def scenario(freezer: Precomputer, control: Control, news: asyncio.Event) -> None:
        view: Any = SimpleNamespace(name="front")
        freezer.start(view, fake_job(control, "/curves/theta_d", state=state))
        assert await asyncio.to_thread(control.freeze_started.wait, 60)
        assert not freezer.is_done
        control.freeze_gate.set()
        await asyncio.wait_for(news.wait(), 60)
        assert freezer.is_done
        taken = await freezer.take()
        assert taken is not None
        assert (taken[0], taken[2]) == (view, "/curves/theta_d")
        assert freezer.running is None
        assert set(recorder.states) == {state}
        await freezer.send_ready(taken[0], taken[1])

    states, unhandled_errors = run(scenario, recorder)
    assert states[-1] == "ready"
    assert unhandled_errors == []


def test_canceled_freeze_gives_nothing() -> None:
    async def scenario(freezer: Precomputer, control: Control, news: asyncio.Event) -> None:
        view: Any = SimpleNamespace(name="front")
        freezer.start(view, fake_job(control, "/curves/theta_d"))
        assert await asyncio.to_thread(control.freeze_started.wait, 60)
        freezer.cancel()
        await asyncio.wait_for(news.wait(), 60)
        assert await freezer.take() is None

    assert run(scenario)[1] == []


def test_failed_freeze_reports_its_reason() -> None:
    async def scenario(freezer: Precomputer, control: Control, news: asyncio.Event) -> None:
        view: Any = SimpleNamespace(name="front")
        freezer.start(view, replace(fake_job(control, "/curves/theta_d"), run=fail))
        await asyncio.wait_for(news.wait(), 60)
        with pytest.raises(StoreError):
            await freezer.take()

    assert run(scenario)[1] == []


def test_disconnect_ends_the_freeze() -> None:
    async def scenario(freezer: Precomputer, control: Control, news: asyncio.Event) -> None:
        view: Any = SimpleNamespace(name="front")
        freezer.start(view, fake_job(control, "/curves/theta_d"))
        await asyncio.wait_for(news.wait(), 60)
        with pytest.raises(ProtocolError):
            await freezer.take()
        await freezer.end()
        assert control.num_cancelled == 1

    assert run(scenario, DisconnectedClient())[1] == []


def test_session_end_during_a_freeze_leaves_no_thread_and_no_error() -> None:
    async def scenario(freezer: Precomputer, control: Control, news: asyncio.Event) -> None:
        view: Any = SimpleNamespace(name="front")
        freezer.start(view, fake_job(control, "/curves/theta_d"))
        assert await asyncio.to_thread(control.freeze_started.wait, 60)
        await freezer.end()
        assert control.num_cancelled == 1

    assert run(scenario)[1] == []
    assert not [thread for thread in threading.enumerate() if thread.name.startswith("relume-long")]


def test_canceled_session_end_leaves_no_error() -> None:
    async def scenario(freezer: Precomputer, control: Control, news: asyncio.Event) -> None:
        view: Any = SimpleNamespace(name="front")
        freezer.start(view, fake_job(control, "/curves/theta_d"))
        running = freezer._running
        assert running is not None
        assert await asyncio.to_thread(control.freeze_started.wait, 60)
        ending = asyncio.create_task(freezer.end())
        await asyncio.sleep(0)
        ending.cancel()
        await asyncio.wait({ending, running.future})
        assert ending.cancelled()
        del ending, running

    assert run(scenario)[1] == []
