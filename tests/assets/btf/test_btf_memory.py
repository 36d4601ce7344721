"""Memory of BTFs: what is stated is what they take, and looks that cannot fit are refused before anything is loaded."""

import pytest

from relume.assets.btf.btf_memory import check_btfs_fit, memory_bytes
from relume.assets.btf.btf_store import load_btf
from relume.core import cache as caches
from relume.core.cache import Cache
from relume.core.errors import MemoryBudgetError
from relume.core.memory_usage import live_bytes
from relume.live.free_camera.texel_brdf.texel_tables import compute_texel_tables


def stated_bytes(record):
    return memory_bytes(record.size, record.directions, record.clusters, record.components)


def test_stated_memory_is_what_a_btf_takes(small_btf):
    whole = load_btf(small_btf.record.data)
    stored = whole.cluster.nbytes + whole.weight.nbytes + whole.eigen.nbytes + whole.mean.nbytes
    actual = stored + whole.tables().nbytes + live_bytes(compute_texel_tables(whole))
    assert stated_bytes(small_btf.record) == pytest.approx(actual, rel=0.05)


def test_looks_whose_btfs_exceed_the_budget_are_refused_in_a_sentence(small_btf, monkeypatch):
    needed = stated_bytes(small_btf.record)
    terms = [{"model": "lambert"}, *small_btf.record.terms(), *small_btf.record.terms()]
    monkeypatch.setattr(caches._AssetCache, "cache", Cache(needed))
    check_btfs_fit(terms)  # one BTF on two materials takes its memory once
    monkeypatch.setattr(caches._AssetCache, "cache", Cache(needed - 1))
    check_btfs_fit(terms[:1])
    with pytest.raises(MemoryBudgetError, match=r"1 measured texture \(BTF\) needs .*; use fewer or smaller ones"):
        check_btfs_fit(terms)


def test_memory_of_five_large_btfs_is_stated_before_they_are_used():
    """512 × 512 texels and 81 directions, as compressed to 5 %."""
    assert 5 * memory_bytes((512, 512), 81, 16, 16) == pytest.approx(6.1e9, rel=0.05)
