"""The one cache for everything computed from bakes (operators, images, lights), under one memory budget.

It has two pools. *Persistent* entries are displayed. *Transient* entries, such as images of a light position during a
drag or of a view that nobody watches, are evicted first and may displace only a fraction of the persistent entries.
"""

from __future__ import annotations

import copy
import re
import threading
from collections import Counter, OrderedDict
from collections.abc import Callable, Collection, Hashable, Mapping
from dataclasses import dataclass
from functools import wraps
from pathlib import Path
from typing import Any, NamedTuple, ParamSpec, Protocol, TypeVar
from weakref import WeakValueDictionary

from relume.core.errors import MemoryBudgetError
from relume.core.memory_usage import live_bytes

_WORD_START = re.compile(r"(?<=[a-z])(?=[A-Z])")
_ASSETS_BYTES = 1 << 30  # budget of a cache that holds only assets
TRANSIENT_BUDGET_DIVISOR = 8  # transient entries evict persistent ones until they hold budget / this

ASSETS = "assets"  # owner of entries computed from files that looks of any bake name: see `asset_cached`

Key = tuple[Hashable, ...]


class Sized(Protocol):
    """An entry that knows its size."""

    @property
    def num_bytes(self) -> int:
        """Memory it holds, in bytes."""
        ...


Entry = TypeVar("Entry", bound=Sized)
Value = TypeVar("Value")
Arguments = ParamSpec("Arguments")


class CacheOwner(NamedTuple):
    """Owner of cached bytes.

    Attributes:
        kind: type of entry, e.g. "linear operator" or "lights". bake: name of the bake's store; "" if bakes share it.
    """

    kind: str
    bake: str


@dataclass(frozen=True)
class _CachedValue:
    """A value that does not report its own size, with its size."""

    value: Any
    kind: str
    num_bytes: int


class _Computation:
    """Lock for the computation of one key; it lives while a thread computes the value or waits for it.

    Attributes:
        uncached: a value too large to cache, for the threads that wait: each would compute it again.
    """

    def __init__(self) -> None:
        self.lock = threading.Lock()
        self.uncached: _CachedValue | None = None


class _LruPool(OrderedDict[Hashable, Sized]):
    """Entries, least recently used first."""

    used_bytes = 0

    def add(self, key: Hashable, entry: Sized) -> None:
        if key in self:
            self.drop(key)
        self[key] = entry
        self.used_bytes += entry.num_bytes

    def drop(self, key: Hashable) -> int:
        """Remove an entry and return its size in bytes."""
        num_bytes = self.pop(key).num_bytes
        self.used_bytes -= num_bytes
        return num_bytes


class _CacheState:
    """State shared by all handles on a cache; use it only under its lock."""

    def __init__(self, budget_bytes: int) -> None:
        self.budget_bytes = budget_bytes
        self.lock = threading.Lock()
        # weak values: an entry lives while threads compute or wait, so all threads that want a key share it
        self.computations: WeakValueDictionary[Hashable, _Computation] = WeakValueDictionary()
        self.persistent, self.transient = _LruPool(), _LruPool()
        self.reserved_bytes = 0

    @property
    def used_bytes(self) -> int:
        return self.persistent.used_bytes + self.transient.used_bytes + self.reserved_bytes

    def make_space(self, num_bytes: int, *, is_transient: bool) -> bool:
        """Evict least recently used entries until `num_bytes` are free; False if nothing more may be evicted.

        Transient entries go first. A transient request evicts only transient entries once they would exceed their
        fraction of the budget.
        """
        transient_limit = self.budget_bytes // TRANSIENT_BUDGET_DIVISOR
        while self.used_bytes + num_bytes > self.budget_bytes:
            takes_more = self.transient.used_bytes + num_bytes > transient_limit
            from_persistent = not takes_more if is_transient else not self.transient
            pool = self.persistent if from_persistent else self.transient
            if not pool:
                return False
            pool.drop(next(iter(pool)))
        return True


class Cache:
    """Keyed entries within one memory budget.

    Safe to use from several threads; two threads never compute the same key at once. Keys of entries that belong to a
    bake begin with the path of its store.
    """

    def __init__(self, budget_bytes: int) -> None:
        self._state = _CacheState(budget_bytes)
        self._is_transient = False

    @property
    def transient(self) -> Cache:
        """A handle on the same cache that adds transient entries; other handles make them persistent on access."""
        handle = copy.copy(self)
        handle._is_transient = True
        return handle

    @property
    def budget_bytes(self) -> int:
        """Maximum size of all entries, in bytes."""
        return self._state.budget_bytes

    @property
    def used_bytes(self) -> int:
        """Current size of all entries, including those that are being computed, in bytes."""
        return self._state.used_bytes

    def bytes_by_owner(self) -> Mapping[CacheOwner, int]:
        """Bytes by owner."""
        totals: Counter[CacheOwner] = Counter()
        with self._state.lock:
            for pool in (self._state.persistent, self._state.transient):
                for key, entry in pool.items():
                    totals[_cache_owner(key, entry)] += entry.num_bytes
        return totals

    def get_cached(self, key: Hashable, kind: type[Entry]) -> Entry | None:
        """The entry, now the most recently used, or None if there is none of that type."""
        state = self._state
        with state.lock:
            if key in state.transient and not self._is_transient:
                moved_entry = state.transient[key]
                state.transient.drop(key)
                state.persistent.add(key, moved_entry)
            pool = state.transient if key in state.transient else state.persistent
            if key in pool:
                pool.move_to_end(key)
            entry = pool.get(key)
            return entry if isinstance(entry, kind) else None

    def contains(self, key: Hashable) -> bool:
        """True if the key is cached; does not count as a use."""
        with self._state.lock:
            return key in self._state.transient or key in self._state.persistent

    def evict(self, key: Hashable) -> None:
        """Remove an entry that is no longer useful, if it exists."""
        with self._state.lock:
            for pool in (self._state.transient, self._state.persistent):
                if key in pool:
                    pool.drop(key)

    def check(self, num_bytes: int) -> None:
        """Raise MemoryBudgetError if an entry of `num_bytes` is larger than the budget."""
        if num_bytes > self.budget_bytes:
            raise MemoryBudgetError(
                "the result", num_bytes, self.budget_bytes, "bake a smaller image or raise the cache budget"
            )

    def get(self, key: Hashable, kind: type[Entry], num_bytes: int, compute: Callable[[], Entry]) -> Entry:
        """Return the entry, or compute it after making space for `num_bytes`.

        Transient results are not cached if persistent entries fill the cache.

        Args:
            key: identifies the entry. kind: class of the entry.
        Raises:
            MemoryBudgetError: the entry alone is larger than the budget.
        """
        self.check(num_bytes)
        computation = self._get_computation(key)
        with computation.lock:
            cached = self.get_cached(key, kind)
            return cached if cached is not None else self._insert(key, num_bytes, compute)

    def get_value(self, key: Key, compute: Callable[[], Value]) -> Value:
        """Return the value of `compute`, cached if it fits.

        For values that an image requires however small the budget is. A value larger than the budget is not cached, but
        threads that wait for it share it. Callers must not modify the value.

        Args:
            key: (path of the store or an owner such as `ASSETS`, kind, distinguishing values…).
        """
        computation = self._get_computation(key)
        with computation.lock:
            cached = self.get_cached(key, _CachedValue) or computation.uncached
            if cached is not None:
                cached_value: Value = cached.value
                return cached_value
            value = compute()
            entry = _CachedValue(value, str(key[1]), live_bytes(value))
            if entry.num_bytes <= self.budget_bytes:
                self._insert(key, entry.num_bytes, lambda: entry)
            else:
                computation.uncached = entry
            return value

    def _get_computation(self, key: Hashable) -> _Computation:
        with self._state.lock:
            return self._state.computations.setdefault(key, _Computation())

    def _insert(self, key: Hashable, num_bytes: int, compute: Callable[[], Entry]) -> Entry:
        state, is_cached = self._state, True
        with state.lock:
            if not state.make_space(num_bytes, is_transient=self._is_transient) and self._is_transient:
                num_bytes, is_cached = 0, False
            state.reserved_bytes += num_bytes  # so that two concurrent computations stay within the budget together
        try:
            entry = compute()
        except BaseException:
            with state.lock:
                state.reserved_bytes -= num_bytes
            raise
        with state.lock:
            state.reserved_bytes -= num_bytes
            if is_cached:
                (state.transient if self._is_transient else state.persistent).add(key, entry)
        return entry

    def trim(self, floor_bytes: int, bakes: Collection[str]) -> None:
        """Evict entries of all bakes except `bakes`, least recently used first, until they hold at most `floor_bytes`.

        Operators and images remain below that floor, because they open a bake at once; other values of those bakes
        always go. Assets stay as long as `bakes` is not empty.

        Args:
            bakes: paths of stores whose entries stay.
        """
        state, used = self._state, {*bakes, ASSETS} if bakes else set()
        with state.lock:
            pools = state.transient, state.persistent
            unused = [(pool, key) for pool in pools for key in pool if not _belongs_to(_key_owner(key), used)]
            for pool, key in unused:
                if isinstance(pool[key], _CachedValue) and _key_owner(key) != ASSETS:
                    pool.drop(key)
            remaining = [(pool, key) for pool, key in unused if key in pool]
            remaining_bytes = sum(pool[key].num_bytes for pool, key in remaining)
            for pool, key in remaining:
                if remaining_bytes <= floor_bytes:
                    return
                remaining_bytes -= pool.drop(key)


def _key_owner(key: Hashable) -> Hashable:
    return key[0] if isinstance(key, tuple) and key else None


def _belongs_to(owner: Hashable, owners: Collection[str]) -> bool:
    """True for one of some owners, and for what is derived of a store: a path below the store's."""
    return owner in owners or (isinstance(owner, str) and any(owner.startswith(f"{store}/") for store in owners))


def _cache_owner(key: Hashable, entry: Sized) -> CacheOwner:
    owner = _key_owner(key)
    kind = entry.kind if isinstance(entry, _CachedValue) else _WORD_START.sub(" ", type(entry).__name__).lower()
    path = Path(owner) if isinstance(owner, str) else Path()
    stores = (folder.stem for folder in (path, *path.parents) if folder.suffix == ".zarr")
    return CacheOwner(kind, next(stores, ""))


class _AssetCache:
    """The cache of assets that looks name: its own, until a process opens bakes with one cache."""

    cache = Cache(_ASSETS_BYTES)


def use_for_assets(cache: Cache) -> None:
    """Use this cache from now on for assets that looks name: BTFs, images, measured materials."""
    _AssetCache.cache = cache


def check_assets(label: str, num_bytes: int, remedy: str) -> None:
    """Check that assets that are used together fit the cache.

    Args:
        label: the assets, for users. num_bytes: their memory. remedy: what users can do.
    Raises:
        MemoryBudgetError: they are larger than the budget.
    """
    if num_bytes > _AssetCache.cache.budget_bytes:
        raise MemoryBudgetError(label, num_bytes, _AssetCache.cache.budget_bytes, remedy)


def asset_cached(kind: str) -> Callable[[Callable[Arguments, Value]], Callable[Arguments, Value]]:
    """Decorator: cache the results of a function of asset files by its arguments.

    The cache is bounded by bytes, because users have any number of assets of any size.

    Args:
        kind: unique name of the function's results, e.g. "BTF file".
    """

    def decorate(compute: Callable[Arguments, Value]) -> Callable[Arguments, Value]:
        @wraps(compute)
        def wrapper(*args: Arguments.args, **kwargs: Arguments.kwargs) -> Value:
            return get_asset(kind, args, lambda: compute(*args, **kwargs))

        return wrapper

    return decorate


def get_asset(kind: str, key: tuple[Any, ...], compute: Callable[[], Value]) -> Value:
    """Return the cached result of `compute`.

    Args:
        kind: as in `asset_cached`. key: distinguishes results of a kind. compute: called if the result is not cached.
    """
    return _AssetCache.cache.get_value((ASSETS, kind, *key), compute)


def is_asset_cached(kind: str, *args: Hashable) -> bool:
    """True if the result of the function of this kind for these arguments is cached."""
    return _AssetCache.cache.contains((ASSETS, kind, *args))
