"""The one memory of all that is made from bakes and may be made again: operators, images, lights; a budget for all.

Two parts. What *lasts* is what somebody looks at. What is made in *passing*, for a place that a light only moves
through or for a picture that nobody watches, goes first, and takes no more than a share of the budget from the other.
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
_ASSETS_BYTES = 1 << 30  # of a memory for assets alone
TRANSIENT_BUDGET_DIVISOR = 8  # what is made in passing pushes out what lasts up to the budget over this

ASSETS = "assets"  # owner of what is made of files that looks of any bake name: see `stored`

Key = tuple[Hashable, ...]


class Sized(Protocol):
    """What the memory may hold."""

    @property
    def num_bytes(self) -> int:
        """Memory it holds."""
        ...


Entry = TypeVar("Entry", bound=Sized)
Value = TypeVar("Value")
Arguments = ParamSpec("Arguments")


class CacheOwner(NamedTuple):
    """Who holds memory.

    Attributes:
        kind: what it is, e.g. "linear operator" or "lights". bake: the name of its store; "" where several share it.
    """

    kind: str
    bake: str


@dataclass(frozen=True)
class _CachedValue:
    """Something that does not tell its size itself."""

    value: Any
    kind: str
    num_bytes: int


class _Computation:
    """Of one key, as long as somebody makes it or waits for that.

    Attributes:
        uncached: what was made and is not kept, for those who wait: each would make it again.
    """

    def __init__(self) -> None:
        self.lock = threading.Lock()
        self.uncached: _CachedValue | None = None


class _LruPool(OrderedDict[Hashable, Sized]):
    """Entries, the one that was used longest ago first."""

    used_bytes = 0

    def add(self, key: Hashable, entry: Sized) -> None:
        if key in self:
            self.drop(key)
        self[key] = entry
        self.used_bytes += entry.num_bytes

    def drop(self, key: Hashable) -> int:
        """Returns its bytes."""
        num_bytes = self.pop(key).num_bytes
        self.used_bytes -= num_bytes
        return num_bytes


class _CacheState:
    """What all handles on a memory share; only to be used under its lock."""

    def __init__(self, budget_bytes: int) -> None:
        self.budget_bytes = budget_bytes
        self.lock = threading.Lock()
        # one lives as long as somebody makes or waits: all who want a key share it
        self.computations: WeakValueDictionary[Hashable, _Computation] = WeakValueDictionary()
        self.persistent, self.transient = _LruPool(), _LruPool()
        self.reserved_bytes = 0

    @property
    def used_bytes(self) -> int:
        return self.persistent.used_bytes + self.transient.used_bytes + self.reserved_bytes

    def make_space(self, num_bytes: int, *, is_transient: bool) -> bool:
        """Drop what was used longest ago until there are so many bytes; False where nothing more may be dropped.

        What was made in passing goes first; for such it is all that goes, once it would hold more than its share.
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
    """Named entries, all of them together within a budget.

    Safe to use from several threads; two never make the same thing at once. Keys of what belongs to a bake begin with
    the path of its store.
    """

    def __init__(self, budget_bytes: int) -> None:
        self._state = _CacheState(budget_bytes)
        self._is_transient = False

    @property
    def transient(self) -> Cache:
        """The same memory, for who makes things in passing; what others find there lasts from then on."""
        handle = copy.copy(self)
        handle._is_transient = True
        return handle

    @property
    def budget_bytes(self) -> int:
        """What the entries hold at most."""
        return self._state.budget_bytes

    @property
    def used_bytes(self) -> int:
        """What the entries hold now, and those that are being made."""
        return self._state.used_bytes

    def bytes_by_owner(self) -> Mapping[CacheOwner, int]:
        """Bytes by who holds them."""
        totals: Counter[CacheOwner] = Counter()
        with self._state.lock:
            for pool in (self._state.persistent, self._state.transient):
                for key, entry in pool.items():
                    totals[_cache_owner(key, entry)] += entry.num_bytes
        return totals

    def get_cached(self, key: Hashable, kind: type[Entry]) -> Entry | None:
        """The entry, now the most recently used, or None where there is none of that kind."""
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
        """Whether there is an entry of that name; it is used no more recently for that."""
        with self._state.lock:
            return key in self._state.transient or key in self._state.persistent

    def evict(self, key: Hashable) -> None:
        """Drop an entry that is of no use any more, where there is one."""
        with self._state.lock:
            for pool in (self._state.transient, self._state.persistent):
                if key in pool:
                    pool.drop(key)

    def check(self, num_bytes: int) -> None:
        """Raises MemoryBudgetError where an entry of so many bytes is larger than the budget."""
        if num_bytes > self.budget_bytes:
            raise MemoryBudgetError(
                "making this", num_bytes, self.budget_bytes, "bake a smaller picture or raise the cache budget"
            )

    def get(self, key: Hashable, kind: type[Entry], num_bytes: int, compute: Callable[[], Entry]) -> Entry:
        """The entry; made by `compute` where there is none, room for its `num_bytes` being made first.

        What is made in passing is not kept where all room is taken by what lasts.

        Args:
            key: names it among all that is kept. kind: its class.
        Raises:
            MemoryBudgetError: it alone is larger than the budget.
        """
        self.check(num_bytes)
        computation = self._get_computation(key)
        with computation.lock:
            cached = self.get_cached(key, kind)
            return cached if cached is not None else self._insert(key, num_bytes, compute)

    def get_value(self, key: Key, compute: Callable[[], Value]) -> Value:
        """What `compute` makes, made once while there is room for it; larger than the budget, it is not kept, and those
        who wait for it at the same time get the same.

        For what a picture cannot do without, however small the budget. Nobody may write to what is kept.

        Args:
            key: the path of a store or a word for what is no bake's; in words what it is; what tells it from others.
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
            state.reserved_bytes += num_bytes  # so that two freezes at once stay under the budget together
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
        """Drop entries of all but some bakes, least recently used first, until those left hold at most a floor.

        Under it are operators and images, which open a bake at once; lights and the like go with the bake. Assets stay
        as long as any bake does.

        Args:
            bakes: paths of stores whose entries stay.
        """
        state, used = self._state, {*bakes, ASSETS} if bakes else set()
        with state.lock:
            pools = state.transient, state.persistent
            unused = [(pool, key) for pool in pools for key in pool if _key_owner(key) not in used]
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


def _cache_owner(key: Hashable, entry: Sized) -> CacheOwner:
    owner = _key_owner(key)
    kind = entry.kind if isinstance(entry, _CachedValue) else _WORD_START.sub(" ", type(entry).__name__).lower()
    path = Path(owner) if isinstance(owner, str) else Path()
    stores = (folder.stem for folder in (path, *path.parents) if folder.suffix == ".zarr")
    return CacheOwner(kind, next(stores, ""))


class _AssetCache:
    """The memory of what is made of files that looks name: its own, until a process opens bakes with one."""

    cache = Cache(_ASSETS_BYTES)


def use_for_assets(cache: Cache) -> None:
    """Store in this memory from now on what is made of files that looks name: BTFs, images, measured materials."""
    _AssetCache.cache = cache


def asset_cached(kind: str) -> Callable[[Callable[Arguments, Value]], Callable[Arguments, Value]]:
    """Have what a function makes of such files stored by its arguments, as long as there is room for it.

    People have as many and as large ones as they like, so that no fixed number of them fits.

    Args:
        kind: names it among all that is stored, e.g. "BTF file"; one for each function.
    """

    def decorate(compute: Callable[Arguments, Value]) -> Callable[Arguments, Value]:
        @wraps(compute)
        def wrapper(*args: Arguments.args, **kwargs: Arguments.kwargs) -> Value:
            return get_asset(kind, args, lambda: compute(*args, **kwargs))

        return wrapper

    return decorate


def get_asset(kind: str, key: tuple[Any, ...], compute: Callable[[], Value]) -> Value:
    """What `compute` makes, stored under a key as `asset_cached` does by arguments.

    Args:
        kind: as of `asset_cached`. key: tells it from others of its kind. compute: called where it is not there.
    """
    return _AssetCache.cache.get_value((ASSETS, kind, *key), compute)


def is_asset_cached(kind: str, *args: Hashable) -> bool:
    """Whether what a function of that kind makes of these arguments is there now."""
    return _AssetCache.cache.contains((ASSETS, kind, *args))
