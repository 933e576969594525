"""A cache of arrays that are needed repeatedly while one of many parameters moves, limited in size."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable

import numpy as np

MOST_BYTES = 64 * 2**20
"""Size of what is remembered: a few dozen memories of a log of ordinary length."""


class Remembered:
    """The arrays used last.

    Parameters
    ----------
    most_bytes : int
        Their total size.

    Examples
    --------
    >>> import numpy as np
    >>> from pamid.gap.residuals.remembered import Remembered
    >>> kept = Remembered()
    >>> kept.get("ones", lambda: np.ones(2)) is kept.get("ones", lambda: np.zeros(2))
    True
    """

    def __init__(self, most_bytes: int = MOST_BYTES) -> None:
        self.most_bytes, self._size = most_bytes, 0
        self._kept: OrderedDict[Hashable, np.ndarray] = OrderedDict()

    def clear(self) -> None:
        """Forget everything."""
        self._kept.clear()
        self._size = 0

    def get(self, key: Hashable, make: Callable[[], np.ndarray]) -> np.ndarray:
        """Return the array of a key, made if missing; it is shared, so never written to."""
        if key in self._kept:
            self._kept.move_to_end(key)
            return self._kept[key]
        found = make()
        self._kept[key] = found
        self._size += found.nbytes
        while self._size > self.most_bytes and len(self._kept) > 1:
            self._size -= self._kept.popitem(last=False)[1].nbytes
        return found
