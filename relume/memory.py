"""The one memory of all that is made from bakes and may be made again: operators, images, lights; a budget for all.

Two parts. What *lasts* is what somebody looks at. What is made in *passing*, for a place that a light only moves
through or for a picture that nobody watches, goes first, and takes no more than a share of the budget from the other.
"""

from __future__ import annotations

import copy
import threading
from collections import Counter, OrderedDict
from collections.abc import Callable, Collection, Hashable, Mapping
from dataclasses import dataclass
from functools import wraps
from pathlib import Path
from typing import Any, NamedTuple, ParamSpec, Protocol, TypeVar
from weakref import WeakValueDictionary

from relume.errors import MemoryBudgetError
from relume.resident import held_bytes

_ASSETS_BYTES = 1 << 30  # of a memory for assets alone
PASSING_SHARE = 8  # what is made in passing pushes out what lasts up to the budget over this

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


class Holder(NamedTuple):
    """Who holds memory.

    Attributes:
        kind: what it is, e.g. "Frozen" or "lights". bake: the name of its store; "" where several share it.
    """

    kind: str
    bake: str


@dataclass(frozen=True)
class _Kept:
    """Something that does not tell its size itself."""

    value: Any
    kind: str
    num_bytes: int


class _Making:
    """Of one key, as long as somebody makes it or waits for that.

    Attributes:
        too_large: what was made and is not kept, for those who wait: each would make it again.
    """

    def __init__(self) -> None:
        self.lock = threading.Lock()
        self.too_large: _Kept | None = None


class _Part(OrderedDict[Hashable, Sized]):
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


class _Room:
    """What all handles on a memory share; only to be used under its lock."""

    def __init__(self, budget_bytes: int) -> None:
        self.budget_bytes = budget_bytes
        self.lock = threading.Lock()
        # one lives as long as somebody makes or waits: all who want a key share it
        self.making: WeakValueDictionary[Hashable, _Making] = WeakValueDictionary()
        self.lasting, self.passing = _Part(), _Part()
        self.reserved_bytes = 0

    @property
    def used_bytes(self) -> int:
        return self.lasting.used_bytes + self.passing.used_bytes + self.reserved_bytes

    def make(self, num_bytes: int, *, is_passing: bool) -> bool:
        """Drop what was used longest ago until there are so many bytes; False where nothing more may be dropped.

        What was made in passing goes first; for such it is all that goes, once it would hold more than its share.
        """
        share = self.budget_bytes // PASSING_SHARE
        while self.used_bytes + num_bytes > self.budget_bytes:
            takes_more = self.passing.used_bytes + num_bytes > share
            from_lasting = not takes_more if is_passing else not self.passing
            part = self.lasting if from_lasting else self.passing
            if not part:
                return False
            part.drop(next(iter(part)))
        return True


class Memory:
    """Named entries, all of them together within a budget.

    Safe to use from several threads; two never make the same thing at once. Keys of what belongs to a bake begin with
    the path of its store.
    """

    def __init__(self, budget_bytes: int) -> None:
        self._room = _Room(budget_bytes)
        self._is_passing = False

    @property
    def passing(self) -> Memory:
        """The same memory, for who makes things in passing; what others find there lasts from then on."""
        found = copy.copy(self)
        found._is_passing = True
        return found

    @property
    def budget_bytes(self) -> int:
        """What the entries hold at most."""
        return self._room.budget_bytes

    @property
    def used_bytes(self) -> int:
        """What the entries hold now, and those that are being made."""
        return self._room.used_bytes

    def held(self) -> Mapping[Holder, int]:
        """Bytes by who holds them."""
        found: Counter[Holder] = Counter()
        with self._room.lock:
            for part in (self._room.lasting, self._room.passing):
                for key, entry in part.items():
                    found[_holder(key, entry)] += entry.num_bytes
        return found

    def find(self, key: Hashable, kind: type[Entry]) -> Entry | None:
        """The entry, now the most recently used, or None where there is none of that kind."""
        room = self._room
        with room.lock:
            if key in room.passing and not self._is_passing:
                entry = room.passing[key]
                room.passing.drop(key)
                room.lasting.add(key, entry)
            part = room.passing if key in room.passing else room.lasting
            if key in part:
                part.move_to_end(key)
            found = part.get(key)
            return found if isinstance(found, kind) else None

    def holds(self, key: Hashable) -> bool:
        """Whether there is an entry of that name; it is used no more recently for that."""
        with self._room.lock:
            return key in self._room.passing or key in self._room.lasting

    def forget(self, key: Hashable) -> None:
        """Drop an entry that is of no use any more, where there is one."""
        with self._room.lock:
            for part in (self._room.passing, self._room.lasting):
                if key in part:
                    part.drop(key)

    def check(self, num_bytes: int) -> None:
        """Raises MemoryBudgetError where an entry of so many bytes is larger than the budget."""
        if num_bytes > self.budget_bytes:
            raise MemoryBudgetError(
                "making this", num_bytes, self.budget_bytes, "bake a smaller picture or raise the cache budget"
            )

    def get(self, key: Hashable, kind: type[Entry], num_bytes: int, make: Callable[[], Entry]) -> Entry:
        """The entry; made by `make` where there is none, room for its `num_bytes` being made first.

        What is made in passing is not kept where all room is taken by what lasts.

        Args:
            key: names it among all that is kept. kind: its class.
        Raises:
            MemoryBudgetError: it alone is larger than the budget.
        """
        self.check(num_bytes)
        making = self._making(key)
        with making.lock:
            found = self.find(key, kind)
            return found if found is not None else self._insert(key, num_bytes, make)

    def keep(self, key: Key, make: Callable[[], Value]) -> Value:
        """What `make` makes, made once while there is room for it; larger than the budget, it is not kept, and those
        who wait for it at the same time get the same.

        For what a picture cannot do without, however small the budget. Nobody may write to what is kept.

        Args:
            key: the path of a store or a word for what is no bake's; in words what it is; what tells it from others.
        """
        making = self._making(key)
        with making.lock:
            found = self.find(key, _Kept) or making.too_large
            if found is not None:
                known: Value = found.value
                return known
            made = make()
            kept = _Kept(made, str(key[1]), held_bytes(made))
            if kept.num_bytes <= self.budget_bytes:
                self._insert(key, kept.num_bytes, lambda: kept)
            else:
                making.too_large = kept
            return made

    def _making(self, key: Hashable) -> _Making:
        with self._room.lock:
            return self._room.making.setdefault(key, _Making())

    def _insert(self, key: Hashable, num_bytes: int, make: Callable[[], Entry]) -> Entry:
        room, is_kept = self._room, True
        with room.lock:
            if not room.make(num_bytes, is_passing=self._is_passing) and self._is_passing:
                num_bytes, is_kept = 0, False
            room.reserved_bytes += num_bytes  # so that two freezes at once stay under the budget together
        try:
            made = make()
        except BaseException:
            with room.lock:
                room.reserved_bytes -= num_bytes
            raise
        with room.lock:
            room.reserved_bytes -= num_bytes
            if is_kept:
                (room.passing if self._is_passing else room.lasting).add(key, made)
        return made

    def shrink(self, floor_bytes: int, bakes: Collection[str]) -> None:
        """Drop entries of all but some bakes, least recently used first, until those left hold at most a floor.

        Under it are operators and images, which open a bake at once; lights and the like go with the bake. Assets stay
        as long as any bake does.

        Args:
            bakes: paths of stores whose entries stay.
        """
        room, used = self._room, {*bakes, ASSETS} if bakes else set()
        with room.lock:
            parts = room.passing, room.lasting
            unused = [(part, key) for part in parts for key in part if _owner(key) not in used]
            for part, key in unused:
                if isinstance(part[key], _Kept) and _owner(key) != ASSETS:
                    part.drop(key)
            others = [(part, key) for part, key in unused if key in part]
            held = sum(part[key].num_bytes for part, key in others)
            for part, key in others:
                if held <= floor_bytes:
                    return
                held -= part.drop(key)


def _owner(key: Hashable) -> Hashable:
    return key[0] if isinstance(key, tuple) and key else None


def _holder(key: Hashable, entry: Sized) -> Holder:
    owner = _owner(key)
    kind = entry.kind if isinstance(entry, _Kept) else type(entry).__name__.lower()
    path = Path(owner) if isinstance(owner, str) else Path()
    stores = (folder.stem for folder in (path, *path.parents) if folder.suffix == ".zarr")
    return Holder(kind, next(stores, ""))


class _Assets:
    """The memory of what is made of files that looks name: its own, until a process opens bakes with one."""

    memory = Memory(_ASSETS_BYTES)


def use_for_assets(memory: Memory) -> None:
    """Store in this memory from now on what is made of files that looks name: BTFs, images, measured materials."""
    _Assets.memory = memory


def stored(kind: str) -> Callable[[Callable[Arguments, Value]], Callable[Arguments, Value]]:
    """Have what a function makes of such files stored by its arguments, as long as there is room for it.

    People have as many and as large ones as they like, so that no fixed number of them fits.

    Args:
        kind: names it among all that is stored, e.g. "BTF file"; one for each function.
    """

    def decorate(make: Callable[Arguments, Value]) -> Callable[Arguments, Value]:
        @wraps(make)
        def found(*args: Arguments.args, **named: Arguments.kwargs) -> Value:
            return stored_as(kind, args, lambda: make(*args, **named))

        return found

    return decorate


def stored_as(kind: str, key: tuple[Any, ...], make: Callable[[], Value]) -> Value:
    """What `make` makes, stored under a key as `stored` does by arguments.

    Args:
        kind: as of `stored`. key: tells it from others of its kind. make: called where it is not there.
    """
    return _Assets.memory.keep((ASSETS, kind, *key), make)


def is_stored(kind: str, *args: Hashable) -> bool:
    """Whether what a function of that kind makes of these arguments is there now."""
    return _Assets.memory.holds((ASSETS, kind, *args))
