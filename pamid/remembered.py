"""A cache of values that are needed repeatedly while one of many parameters moves, limited in number or size."""

from collections import OrderedDict
from collections.abc import Callable, Hashable
from typing import Generic, TypeVar

V = TypeVar("V")


class Remembered(Generic[V]):
    """The values used last, `most` of them, or of that total `size`."""

    def __init__(self, most: int, size: Callable[[V], int] | None = None) -> None:
        self.most, self.size, self._whole = most, size, 0
        self._kept: OrderedDict[Hashable, V] = OrderedDict()

    def clear(self) -> None:
        """Forget everything."""
        self._kept.clear()
        self._whole = 0

    def get(self, key: Hashable, make: Callable[[], V]) -> V:
        """Return the value of a key, made if missing; it is shared, so never changed."""
        if key in self._kept:
            self._kept.move_to_end(key)
            return self._kept[key]
        found = make()
        self._kept[key] = found
        self._whole += self._size_of(found)
        while self._whole > self.most and len(self._kept) > 1:
            self._whole -= self._size_of(self._kept.popitem(last=False)[1])
        return found

    def _size_of(self, value: V) -> int:
        return 1 if self.size is None else self.size(value)
