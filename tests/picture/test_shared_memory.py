"""A bake's lights, images and operators are all in the memory that it was opened with, sessions' and renders' alike."""

from __future__ import annotations

from pathlib import Path

import pytest
from pictures import opened
from sessions import BUDGET, look_of

from relume.memory import Memory
from relume.methods.registry import open_transfer
from relume.render.image import render_image
from relume.resident import held_bytes

LAMP = {"kind": "point", "position": [0.3, 1.0, 0.4]}
CURVE = "/materials/Floor/terms/1/curves/theta_h"


def lit(number):
    """Another environment, another blur, another place of the lamp, another reflectance."""

    def change(document):
        document["environment"].update(rotation=10.0 * number, map=("sunset", "overcast")[number % 2])
        document["background"] = {"kind": "blurred", "blur": 5.0 + number}
        document["lights"] = {"lamp": {**LAMP, "position": [0.3, 1.0, 0.1 * number]}}
        document["materials"]["Red"]["terms"][0]["color"] = [0.1 * number, 0.2, 0.2]

    return change


def test_nothing_that_grows_is_outside(gathered):
    memory = Memory(BUDGET)
    transfer = open_transfer(Path(gathered.key), memory)
    render_image(transfer, "front", look_of(transfer, lit(0)))
    outside, inside = held_bytes(transfer), memory.used_bytes
    for number in range(1, 6):
        render_image(transfer, "front", look_of(transfer, lit(number)))
    assert held_bytes(transfer) == outside
    assert memory.used_bytes > inside
    kinds = {holder.kind for holder in memory.held()}
    lights = {"lights", "environment on cells", "light on cells", "local light", "reflected light", "reflectance"}
    assert lights | {"shaded", "shadows", "sharing", "behind surfaces", "blurred environment"} <= kinds
    entries = [*memory._room.lasting.values(), *memory._room.passing.values()]
    told = [entry.num_bytes for entry in entries]  # lights find out later how wide they are, a number each
    assert [held_bytes(getattr(entry, "value", entry)) for entry in entries] == pytest.approx(told, rel=0.05)
    assert {holder.bake for holder in memory.held()} == {Path(gathered.key).stem, ""}


def test_renders_push_nothing_out_that_a_session_looks_at(gathered):
    path = Path(gathered.key)
    whole = Memory(BUDGET)
    opened(open_transfer(path, whole), CURVE, cache=whole)

    memory = Memory(whole.used_bytes + whole.used_bytes // 4)
    picture = opened(open_transfer(path, memory), CURVE, cache=memory)
    before = dict(memory.held())
    for_renders = open_transfer(path, memory.passing)
    for number in range(1, 6):
        render_image(for_renders, "front", look_of(for_renders, lit(number)))
    assert memory.used_bytes <= memory.budget_bytes
    after = memory.held()
    frozen = {holder: num_bytes for holder, num_bytes in before.items() if holder.kind == "frozen"}
    assert frozen
    assert {holder: after[holder] for holder in frozen} == frozen
    material, term = picture._images.find(picture._touched)
    assert picture._images.operator(material, term) is not None
