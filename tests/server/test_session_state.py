"""Parts of a session without pictures or network."""

import asyncio
from collections.abc import Collection
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from coroutines import run_in_thread

from relume.core.errors import ParameterError, ProtocolError, StoreError
from relume_server.client_state.flow_control import FrameWindow
from relume_server.client_state.look_state import LookState
from relume_server.client_state.pointers import check_active_pointer, check_parameter, find_curve
from relume_server.client_state.resume import MAX_SAVED, ResumeStore
from relume_server.client_state.visible_views import VisibleViews
from relume_server.runtime.bake_pool import MAX_IDLE, TransferPool
from relume_server.session.frames.bake_updates import POLL_S, BakeUpdates
from relume_server.session.frames.coefficient_budget import (
    MAX_COEFFICIENTS,
    MIN_COEFFICIENTS,
    TARGET_MS,
    CoefficientBudget,
)
from relume_worker.status import BakeStatus

DOCUMENT: dict[str, Any] = {
    "materials": {"a/b": {"terms": [{"model": "lambert"}, {"model": "cook_torrance"}, {"model": "ashikhmin_shirley"}]}}
}
ALONE = VisibleViews(["front"], "front")
TERM = "/materials/a~1b/terms"


def test_acknowledgement_opens_the_window_for_all_earlier_frames() -> None:
    window = FrameWindow(ack_seconds=10)
    for _ in range(2):
        assert window.has_room("front", ALONE)
        window.on_sent("front", 100, now_s=1.0)
    assert not window.has_room("front", ALONE)
    window.on_acknowledged(2, now_s=1.1)
    window.on_sent("front", 100, now_s=1.2)
    assert window.has_room("front", ALONE)
    assert window.next_frame == 4


def test_focused_view_has_its_own_slot_and_others_share_one() -> None:
    window, shown = FrameWindow(ack_seconds=10), VisibleViews(["front", "left", "top"], "left")
    assert all(window.has_room(name, shown) for name in shown.names)
    window.on_sent("top", 100, now_s=1.0)
    assert [window.has_room(name, shown) for name in shown.names] == [False, True, False]
    window.on_sent("left", 100, now_s=1.0)
    assert not any(window.has_room(name, shown) for name in shown.names)
    window.on_acknowledged(1, now_s=1.1)
    assert [window.has_room(name, shown) for name in shown.names] == [True, False, True]


def test_shown_views_keep_the_focus_if_possible() -> None:
    shown = VisibleViews(["front"], "front")
    shown.show(["left", "front", "left"])
    assert (shown.names, shown.focus) == (("left", "front"), "front")
    shown.set_focus("left")
    with pytest.raises(ParameterError, match="one of the displayed views: "):
        shown.set_focus("top")
    shown.hide("left")
    assert (shown.names, shown.focus) == (("front",), "front")


def test_window_rejects_unknown_frames_and_times_out() -> None:
    window = FrameWindow(ack_seconds=10)
    window.on_sent("front", 100, now_s=1.0)
    with pytest.raises(ProtocolError, match="never sent"):
        window.on_acknowledged(2, now_s=1.0)
    window.check(10.9)
    with pytest.raises(ProtocolError) as lost:
        window.check(11.1)
    assert lost.value.close_code == 4408


def stream(window: FrameWindow, num_frames: int, num_bytes: int, bytes_per_s: float, start_s: float) -> float:
    """Send frames sequentially over a link with 10 ms round trip; return the end time."""
    now_s = start_s
    for _ in range(num_frames):
        frame = window.next_frame
        window.on_sent("front", num_bytes, now_s)
        now_s += 0.010 + num_bytes / bytes_per_s
        window.on_acknowledged(frame, now_s)
    return now_s


def test_link_is_slow_if_frames_would_stutter_and_recovers() -> None:
    window = FrameWindow(ack_seconds=10)
    assert not window.is_slow_for(1_000_000, was_slow=False)
    now_s = stream(window, 5, 1_000_000, 100e6, 0.0)
    assert not window.is_slow_for(1_000_000, was_slow=False)
    now_s = stream(window, 20, 1_000_000, 5e6, now_s)
    assert window.is_slow_for(1_000_000, was_slow=False)
    almost = 300_000  # takes 60 ms
    assert not window.is_slow_for(almost, was_slow=False)
    assert window.is_slow_for(almost, was_slow=True)  # hysteresis: not fast yet
    stream(window, 20, 1_000_000, 100e6, now_s)
    assert not window.is_slow_for(1_000_000, was_slow=True)


def test_pace_converges_to_the_target_duration() -> None:
    budget = CoefficientBudget()
    ms_per_coefficient = 0.05
    for _ in range(30):
        budget.learn(budget.max_coefficients * ms_per_coefficient, exact=False)
    assert budget.max_coefficients == pytest.approx(TARGET_MS / ms_per_coefficient, rel=0.1)


def test_pace_decreases_if_exact_steps_are_too_slow() -> None:
    budget = CoefficientBudget()
    for _ in range(20):
        budget.learn(0.1, exact=True)
    before = budget.max_coefficients
    budget.learn(2 * TARGET_MS, exact=True)
    assert budget.max_coefficients == before // 2


def test_pace_is_bounded() -> None:
    budget = CoefficientBudget()
    for _ in range(50):
        budget.learn(1000.0, exact=False)
    assert budget.max_coefficients == MIN_COEFFICIENTS
    for _ in range(50):
        budget.learn(0.1, exact=True)
    assert budget.max_coefficients == MAX_COEFFICIENTS


def test_resume_is_limited_in_number_and_time_and_to_its_bake() -> None:
    store = ResumeStore(resume_seconds=600)
    tokens = [store.open("bake", LookState({}, {"k": k}, k), ALONE) for k in range(MAX_SAVED + 5)]
    assert len(set(tokens)) == len(tokens)
    for token in tokens:
        store.close(token, now_s=0.0)
    assert store.take(tokens[4], "bake", 1.0) is None
    assert store.take(tokens[5], "other", 1.0) is None
    resumed = store.take(tokens[5], "bake", 1.0)
    assert resumed is not None
    assert (resumed.revision, resumed.document) == (5, {"k": 5})
    assert store.take(tokens[5], "bake", 1.0) is None
    assert store.take(tokens[6], "bake", 601.0) is None


def test_session_that_seems_alive_can_be_resumed_once() -> None:
    store = ResumeStore(resume_seconds=600)
    token = store.open("bake", LookState({}, {"k": 1}, 3), ALONE)
    resumed = store.take(token, "bake", 0.0)
    assert resumed is not None
    assert resumed.revision == 3
    store.close(token, 1.0)
    assert store.take(token, "bake", 2.0) is None


def test_curve_pointers_are_resolved_or_rejected() -> None:
    term, curve = find_curve(f"{TERM}/2/curves/alpha", DOCUMENT)
    assert (term["model"], curve.name) == ("ashikhmin_shirley", "alpha")
    for pointer in (f"{TERM}/0/curves/theta_h", f"{TERM}/3/curves/alpha", f"{TERM}/02/curves/alpha", "/x"):
        with pytest.raises(ParameterError):
            find_curve(pointer, DOCUMENT)


def test_active_control_must_be_in_the_look() -> None:
    document = {**DOCUMENT, "lights": {"Desk / bulb": {}}}
    for pointer in (f"{TERM}/2/params/nu", "/lights/Desk ~1 bulb", "/environment/intensity"):
        check_parameter(pointer, document)
    for pointer in (f"{TERM}/2/curves/alpha", f"{TERM}/2/params/sigma", "/lights/Desk", "/environment/size"):
        with pytest.raises(ParameterError):
            check_parameter(pointer, document)


def test_active_control_is_a_curve_or_a_draggable_value() -> None:
    document = {**DOCUMENT, "lights": {"Lamp": {}}}
    for pointer in (f"{TERM}/2/curves/alpha", f"{TERM}/2/params/nu", "/lights/Lamp", "/environment/rotation"):
        check_active_pointer(pointer, document)
    for pointer in (f"{TERM}/2/curves/theta_h", f"{TERM}/2/params/sigma", "/lights/Desk", "/display/exposure"):
        with pytest.raises(ParameterError):
            check_active_pointer(pointer, document)


def test_shadow_catcher_has_no_active_controls() -> None:
    for is_catcher in (False, True):
        document = {"materials": {"a/b": {**DOCUMENT["materials"]["a/b"], "shadow_catcher": is_catcher}}}
        for find, pointer in ((find_curve, f"{TERM}/1/curves/theta_h"), (check_parameter, f"{TERM}/1/params/sigma")):
            if is_catcher:
                with pytest.raises(ParameterError):
                    find(pointer, document)
            else:
                find(pointer, document)


def test_transfers_are_opened_once_kept_while_used_and_retried_after_a_failure() -> None:
    opened: list[str] = []

    def open_transfer(path: Path) -> Any:
        opened.append(path.name)
        if opened == ["broken"]:
            raise StoreError("broken; bake again")
        return path

    async def run() -> None:
        with ThreadPoolExecutor(2) as executor:
            pool = TransferPool(open_transfer, executor, 60.0, lambda: 0.0)
            with pytest.raises(StoreError):
                async with pool.acquire("broken", Path("broken")):
                    pass
            async with (
                pool.acquire("broken", Path("broken")) as transfer,
                pool.acquire("broken", Path("broken")) as again,
            ):
                assert transfer is again
                for k in range(MAX_IDLE + 2):
                    async with pool.acquire(f"b{k}", Path(f"b{k}")):
                        pass
                async with pool.acquire("b0", Path("b0")):
                    pass
            async with pool.acquire("broken", Path("broken")):
                pass

    run_in_thread(run())
    assert opened == ["broken", "broken", "b0", "b1", "b2", "b3", "b0"]


def test_sessions_of_one_scene_share_ledger_queries() -> None:
    asked: list[set[str]] = []

    def bakes(scenes: Collection[str]) -> dict[str, list[BakeStatus]]:
        asked.append(set(scenes))
        return {}

    async def scenario() -> None:
        news = BakeUpdates(bakes, asking)
        socket: Any = SimpleNamespace()
        telling = [
            asyncio.create_task(news.send_updates(socket, "b", scene)) for scene in ("one", "one", "other", "one")
        ]
        await asyncio.sleep(0.1)
        telling[0].cancel()  # cancellation of the first caller does not affect others
        await asyncio.sleep(3.2 * POLL_S)
        assert not any(task.done() for task in telling[1:])
        for task in telling:
            task.cancel()

    with ThreadPoolExecutor(1) as asking:
        run_in_thread(scenario())
    assert all(scenes == {"one", "other"} for scenes in asked)
    assert 2 <= len(asked) <= 5
