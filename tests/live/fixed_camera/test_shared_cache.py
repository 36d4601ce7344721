"""Lights, images and operators of a bake are all in the cache it was opened with, for sessions and renders."""

from __future__ import annotations

from pathlib import Path

import pytest
from picture_edits import open_exact_picture
from session_edits import BUDGET, make_look

from relume.core.cache import Cache
from relume.core.memory_usage import live_bytes
from relume.live.opened.openers import open_transfer
from relume.output.render_image import render_image

POINT_LIGHT = {"kind": "point", "position": [0.3, 1.0, 0.4]}
CURVE = "/materials/Floor/terms/1/curves/theta_h"


def lit(number):
    """Another environment, blur, light position and reflectance."""

    def change(document):
        document["environment"].update(rotation=10.0 * number, map=("sunset", "overcast")[number % 2])
        document["background"] = {"kind": "blurred", "blur": 5.0 + number}
        document["lights"] = {"lamp": {**POINT_LIGHT, "position": [0.3, 1.0, 0.1 * number]}}
        document["materials"]["Red"]["terms"][0]["color"] = [0.1 * number, 0.2, 0.2]

    return change


def test_all_growing_data_is_in_the_cache(gathered):
    memory = Cache(BUDGET)
    transfer = open_transfer(Path(gathered.key), memory)
    render_image(transfer, "front", make_look(transfer, lit(0)))
    outside, inside = live_bytes(transfer), memory.used_bytes
    for number in range(1, 6):
        render_image(transfer, "front", make_look(transfer, lit(number)))
    assert live_bytes(transfer) == outside
    assert memory.used_bytes > inside
    kinds = {holder.kind for holder in memory.bytes_by_owner()}
    lights = {"lights", "environment on patches", "light on patches", "local light", "indirect light", "reflectance"}
    assert lights | {"shaded term", "shadow cache", "neighbor filter", "background", "blurred environment"} <= kinds
    entries = [*memory._state.persistent.values(), *memory._state.transient.values()]
    sizes = [entry.num_bytes for entry in entries]  # the widths of lights are computed later, one number each
    assert [live_bytes(getattr(entry, "value", entry)) for entry in entries] == pytest.approx(sizes, rel=0.05)
    assert {holder.bake for holder in memory.bytes_by_owner()} == {Path(gathered.key).stem, ""}


def test_renders_do_not_evict_data_of_sessions(gathered):
    path = Path(gathered.key)
    whole = Cache(BUDGET)
    open_exact_picture(open_transfer(path, whole), CURVE, cache=whole)

    memory = Cache(whole.used_bytes + whole.used_bytes // 4)
    picture = open_exact_picture(open_transfer(path, memory), CURVE, cache=memory)
    before = dict(memory.bytes_by_owner())
    for_renders = open_transfer(path, memory.transient)
    for number in range(1, 6):
        render_image(for_renders, "front", make_look(for_renders, lit(number)))
    assert memory.used_bytes <= memory.budget_bytes
    after = memory.bytes_by_owner()
    frozen = {holder: num_bytes for holder, num_bytes in before.items() if holder.kind == "linear operator"}
    assert frozen
    assert {holder: after[holder] for holder in frozen} == frozen
    material, term = picture._images.material_term(picture._prepared_pointer)
    assert picture._images.operator(material, term) is not None
