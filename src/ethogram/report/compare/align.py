"""Items of two sides, A and B, brought together by what names them."""

from collections import Counter
from collections.abc import Callable, Hashable, Iterable
from typing import Literal, TypeVar

Presence = Literal["both", "a", "b"]
T = TypeVar("T")


def align(
    a: Iterable[T], b: Iterable[T], key: Callable[[T], Hashable]
) -> list[tuple[T | None, T | None]]:
    """Every item of either side, beside the one of the same key on the other, or beside None.

    A's order holds; what only B has follows what it follows in B.  Where several have one key,
    the first meets the first, the second the second.
    """
    items_a, items_b = _by_key(a, key), _by_key(b, key)
    order, place = list(items_a), 0
    for name in items_b:
        if name in items_a:
            place = order.index(name) + 1
        else:
            order.insert(place, name)
            place += 1
    return [(items_a.get(name), items_b.get(name)) for name in order]


def presence(a: object | None, b: object | None) -> Presence:
    """Which of the sides has what is None on the other."""
    if a is not None and b is not None:
        return "both"
    return "b" if a is None else "a"


def _by_key(items: Iterable[T], key: Callable[[T], Hashable]) -> dict[tuple[Hashable, int], T]:
    """The items by their key and by how many had it before."""
    before: Counter[Hashable] = Counter()
    keyed = {}
    for item in items:
        name = key(item)
        keyed[name, before[name]] = item
        before[name] += 1
    return keyed
