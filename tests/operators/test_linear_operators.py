"""Streaming, freezing and caching of linear operators, against NumPy and direct projection."""

from __future__ import annotations

import threading
import time

import numpy as np
import numpy_reference as ref
import pytest
from tiny_scenes import studio

from relume.brdf.curves import curve_bands
from relume.brdf.registry import TERMS
from relume.core.cache import Cache
from relume.core.errors import CancelledError, MemoryBudgetError
from relume.lights.spherical_triangles import tessellate_environment
from relume.math.daubechies import analysis, matrix, synthesis
from relume.operators.edit_basis import CurveBasis, precompute
from relume.operators.linear_operator import LinearOperator, operator_bytes
from relume.operators.update_kernel import changed_columns, stream
from relume.transport.projector import Projector
from relume.transport.term_contraction import contract

RNG = np.random.default_rng(0)


@pytest.mark.parametrize(
    "counts", [(0, 0, 0), (1, 1, 1), (4, 4, 4), (5, 5, 5), (3, 0, 7), (64, 1, 2), (0, 0, 6), (64, 64, 64)]
)
@pytest.mark.parametrize("shape", [(1, 16), (3, 48), (2, 1040)])
def test_streamed_columns_are_the_product(counts, shape):
    tiles, samples = shape
    transport = RNG.normal(size=(tiles, 3, 64, samples)).astype(np.float32)
    image = RNG.normal(size=(tiles, 3, samples)).astype(np.float32)
    change = np.zeros((3, 64))
    for channel, count in enumerate(counts):
        change[channel, RNG.permutation(64)[:count]] = RNG.normal(size=count)
    expected = ref.stream(transport, change, image)
    stream(transport, changed_columns(change), image)
    np.testing.assert_allclose(image, expected, atol=1e-4)


def test_columns_list_only_changes():
    change = np.zeros((3, 16))
    change[0, [3, 9]], change[2, 15] = [1.5, -2], 1e-20
    columns = changed_columns(change)
    assert columns.count.tolist() == [[2, 0, 1]]
    assert columns.index[0, 0, :2].tolist() == [3, 9]
    assert columns.change[0, 0, :2].tolist() == [1.5, -2]
    assert columns.index[0, 2, 0] == 15


@pytest.mark.parametrize("bounds", [[0, 96], [0, 10, 10, 61, 96], [0, 0, 48, 96], [0, 32, 64, 90]])
def test_each_level_has_its_own_columns(bounds):
    transport = RNG.normal(size=(2, 3, 8, 48)).astype(np.float32)
    image = np.zeros((2, 3, 48), np.float32)
    change = RNG.normal(size=(len(bounds) - 1, 3, 8)) * (RNG.random((len(bounds) - 1, 3, 8)) < 0.7)
    stream(transport, changed_columns(change), image, np.array(bounds))
    level = np.searchsorted(bounds, np.arange(96), side="right") - 1
    expected = np.zeros((2, 3, 48))
    for sample in range(bounds[-1]):
        tile, row = divmod(sample, 48)
        expected[tile, :, row] = np.einsum("cj,cj->c", change[level[sample]], transport[tile, :, :, row])
    np.testing.assert_allclose(image, expected, atol=1e-4)


@pytest.fixture(scope="module")
def lights():
    return tessellate_environment(studio(), 120)


def frozen_of(model, active, lights, receivers, **options):
    document = {"model": model, "params": {}}
    bands = {curve.name: curve_bands(document, curve) for curve in TERMS[model].curves}
    progress = options.get("progress", lambda fraction: None)
    is_canceled = options.get("is_canceled", lambda: False)
    basis = CurveBasis.from_curve(TERMS[model].curve(active))
    return bands, precompute(basis, TERMS[model], bands, lights, receivers, progress, is_canceled)


def rows_of(frozen, count):
    """Coefficients of each receiver, in order. (count, 3, J)"""
    tiles, _, num_bands, samples = frozen.transport.shape
    return frozen.transport.transpose(0, 3, 1, 2).reshape(tiles * samples, 3, num_bands)[:count].astype(float)


@pytest.mark.parametrize("count", [1, 15, 16, 17, 513, 1500])
@pytest.mark.parametrize(
    ("model", "active"), [("lambert", "theta_i"), ("cook_torrance", "theta_h"), ("ggx", "theta_d")]
)
def test_frozen_transport_is_the_projection_times_the_wavelet_matrix(count, model, active, lights):
    receivers = ref.only_above(ref.make_random_receivers(count, lights.num_lights, seed=count), lights)
    bands, frozen = frozen_of(model, active, lights, receivers)
    term = TERMS[model]
    boxes = Projector(term, contract(term, bands, active), lights, receivers).project(0, count).astype(float)
    expected = np.einsum("kj,njc->nck", matrix(boxes.shape[1]).astype(float), boxes)
    scale = np.abs(expected).max()
    np.testing.assert_allclose(rows_of(frozen, count), expected, atol=2e-6 * scale)
    padding = frozen.transport.transpose(0, 3, 1, 2).reshape(-1, 3, boxes.shape[1])[count:]
    assert not padding.any()
    np.testing.assert_allclose(
        frozen.importance, np.sqrt((expected**2).sum(axis=0)), atol=1e-4 * np.sqrt(count) * scale
    )
    assert frozen.num_bytes == operator_bytes(count, boxes.shape[1])
    assert frozen.transport.flags.c_contiguous


def test_more_samples_than_a_tile_holds(monkeypatch, lights):
    monkeypatch.setattr("relume.operators.linear_operator.TILE_SAMPLES", 128)
    receivers = ref.only_above(ref.make_random_receivers(700, lights.num_lights, seed=9), lights)
    bands, frozen = frozen_of("blinn_phong", "theta_h", lights, receivers)
    assert len(frozen.transport) > 1
    term = TERMS["blinn_phong"]
    boxes = Projector(term, contract(term, bands, "theta_h"), lights, receivers).project(0, 700)
    expected = analysis(boxes.transpose(0, 2, 1).astype(float))
    np.testing.assert_allclose(rows_of(frozen, 700), expected, atol=2e-6 * np.abs(expected).max())


def test_wavelet_product_is_the_product_in_bands(lights):
    receivers = ref.only_above(ref.make_random_receivers(50, lights.num_lights, seed=3), lights)
    bands, frozen = frozen_of("cook_torrance", "theta_h", lights, receivers)
    image = np.zeros((1, 3, frozen.transport.shape[3]), np.float32)
    stream(frozen.transport, changed_columns(analysis(bands["theta_h"])), image)
    boxes = synthesis(rows_of(frozen, 50))
    expected = np.einsum("ncj,cj->cn", boxes, bands["theta_h"])
    np.testing.assert_allclose(image[0, :, :50], expected, rtol=2e-5, atol=1e-6 * expected.max())


def test_progress_rises_to_one_and_cancelling_stops(lights):
    receivers = ref.only_above(ref.make_random_receivers(3000, lights.num_lights, seed=4), lights)
    fractions = []
    frozen_of("lambert", "theta_i", lights, receivers, progress=fractions.append)
    assert max(fractions) == pytest.approx(1.0)
    assert min(fractions) > 0
    with pytest.raises(CancelledError):
        frozen_of("lambert", "theta_i", lights, receivers, is_canceled=lambda: True)


def operator(num_bytes):
    transport = np.ones((1, 3, 4, num_bytes // 48), np.float32)
    return LinearOperator(transport, np.ones((3, 4)))


def test_cache_drops_the_least_recently_used_and_keeps_its_budget():
    cache = Cache(4800)
    for key in "abc":
        cache.get(key, LinearOperator, 1440, lambda: operator(1440))
    assert cache.used_bytes == 4320
    cache.get_cached("a", LinearOperator)
    cache.get("d", LinearOperator, 1440, lambda: operator(1440))
    assert [cache.get_cached(key, LinearOperator) is not None for key in "abcd"] == [True, False, True, True]
    assert cache.used_bytes == 4320 <= cache.budget_bytes
    cache.get("all", LinearOperator, 4800, lambda: operator(4800))
    assert cache.used_bytes == 4800
    assert [cache.get_cached(key, LinearOperator) for key in "abcd"] == [None] * 4


def test_cache_returns_what_it_has():
    cache = Cache(10_000)
    first = cache.get("k", LinearOperator, 480, lambda: operator(480))
    assert cache.get("k", LinearOperator, 480, lambda: pytest.fail("made twice")) is first
    assert cache.get_cached("k", LinearOperator) is first
    assert cache.get_cached("other", LinearOperator) is None


def test_operators_larger_than_the_budget_are_rejected_before_any_work():
    cache = Cache(1000)
    small = cache.get("small", LinearOperator, 480, lambda: operator(480))
    with pytest.raises(MemoryBudgetError) as rejected:
        cache.get("large", LinearOperator, 1001, lambda: pytest.fail("made"))
    assert (rejected.value.needed_bytes, rejected.value.allowed_bytes) == (1001, 1000)
    assert cache.get_cached("small", LinearOperator) is small


@pytest.mark.parametrize("problem", [CancelledError("canceled"), MemoryError(), KeyboardInterrupt()])
def test_an_interrupted_freeze_leaves_nothing(problem):
    cache = Cache(1000)

    def fails():
        raise problem

    for _ in range(5):
        with pytest.raises(type(problem)):
            cache.get("k", LinearOperator, 960, fails)
        assert cache.used_bytes == 0
        assert cache.get_cached("k", LinearOperator) is None
    assert cache.get("k", LinearOperator, 960, lambda: operator(960)) is cache.get_cached("k", LinearOperator)


def test_concurrent_requests_compute_once():
    cache, made, start = Cache(100_000), [], threading.Barrier(8)

    def make():
        made.append(1)
        time.sleep(0.05)
        return operator(480)

    operators = []

    def want():
        start.wait()
        operators.append(cache.get("k", LinearOperator, 480, make))

    threads = [threading.Thread(target=want) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(made) == 1
    assert len({id(built) for built in operators}) == 1
    assert cache.used_bytes == operators[0].num_bytes


def test_a_cancelled_request_lets_the_others_compute_once():
    """The first stops while a second waits; a third arrives during the second: computed once for both."""
    cache, made, outcome = Cache(100_000), [], []
    first_runs, go_on, second_runs = threading.Event(), threading.Event(), threading.Event()

    def give_up_midway():
        first_runs.set()
        go_on.wait(60)
        raise CancelledError("canceled")

    def make():
        made.append(1)
        second_runs.set()
        time.sleep(0.1)
        return operator(480)

    def give_up():
        with pytest.raises(CancelledError):
            cache.get("k", LinearOperator, 480, give_up_midway)

    def want():
        outcome.append(cache.get("k", LinearOperator, 480, make))

    first, second, third = (threading.Thread(target=target) for target in (give_up, want, want))
    first.start()
    assert first_runs.wait(60)
    second.start()
    time.sleep(0.05)  # until it waits
    go_on.set()
    first.join()
    assert second_runs.wait(60)
    third.start()
    second.join()
    third.join()
    assert len(made) == 1
    assert outcome[0] is outcome[1]
    assert cache.used_bytes == 480


def test_many_threads_and_keys_keep_the_count():
    cache, errors = Cache(5000), []

    def work(seed):
        rng = np.random.default_rng(seed)
        for _ in range(60):
            key, size = int(rng.integers(12)), 480 * int(rng.integers(1, 5))
            try:
                if rng.random() < 0.2:
                    with pytest.raises(CancelledError):
                        cache.get(
                            ("never", key), LinearOperator, size, lambda: (_ for _ in ()).throw(CancelledError("no"))
                        )
                else:
                    cache.get((key, size), LinearOperator, size, lambda size=size: operator(size))
            except Exception as error:
                errors.append(error)

    threads = [threading.Thread(target=work, args=(seed,)) for seed in range(6)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not errors
    keys = [(key, size) for key in range(12) for size in range(480, 2401, 480)]
    held = sum(entry.num_bytes for key in keys if (entry := cache.get_cached(key, LinearOperator)) is not None)
    assert cache.used_bytes == held
    assert held > 0
