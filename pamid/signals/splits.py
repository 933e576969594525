"""Splits by whole runs, by kinds of runs and by muscles, as scikit-learn's searches use them."""

from abc import abstractmethod
from collections.abc import Callable, Iterator, Mapping
from typing import Any, ClassVar

import numpy as np
from sklearn.model_selection import BaseCrossValidator
from sklearn.utils import check_random_state

from pamid.errors import MissingTrajectoryError, ParameterError, ShapeError, TooFewTrajectoriesError, TrajectoryError


def trajectories_of(X: Any, groups: Any = None, *, needed_by: str = "The split") -> np.ndarray:
    """Return the run of each row."""
    if groups is None and "trajectory" in getattr(X, "columns", ()):
        groups = X["trajectory"]
    if groups is None:
        raise MissingTrajectoryError(
            f"{needed_by} needs to know which rows form a run.",
            "groups, or a column 'trajectory' in X",
            "Pass groups=log['trajectory'] (with metadata routing on, in params={'groups': ...}).",
        )
    names = np.asarray(groups, dtype=object).ravel()
    n = X.shape[0] if hasattr(X, "shape") else (len(X) if X is not None else len(names))
    if len(names) != n:
        raise ShapeError(
            f"groups has {len(names)} entries for {n} rows.", "one per row", "Pass one group for each row."
        )
    return names


class _TrajectorySplitter(BaseCrossValidator):
    """Base of the splits: subclasses assign each run to a fold."""

    __metadata_request__split: ClassVar[dict[str, bool]] = {"groups": True}

    @abstractmethod
    def _folds(self, X: Any, names: np.ndarray) -> np.ndarray:
        """Return the fold of each row, numbered from 0."""

    def split(self, X: Any, y: Any = None, groups: Any = None) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Yield the rows to train on and to test on, fold by fold; `groups` or a column ``trajectory`` of X names the
        runs.
        """
        folds = self._folds(X, self._names(X, groups))
        for fold in range(int(folds.max()) + 1):
            yield np.flatnonzero(folds != fold), np.flatnonzero(folds == fold)

    def get_n_splits(self, X: Any = None, y: Any = None, groups: Any = None) -> int:
        """Return the number of folds of a table and its runs."""
        return int(self._folds(X, self._names(X, groups)).max()) + 1

    def _names(self, X: Any, groups: Any) -> np.ndarray:
        return trajectories_of(X, groups, needed_by=type(self).__name__)


def _number(keys: np.ndarray) -> tuple[list[Any], np.ndarray]:
    """Distinct keys in order of appearance, and the number of each row's key."""
    order: dict[Any, int] = {}
    codes = np.fromiter((order.setdefault(k, len(order)) for k in keys), dtype=np.int64, count=len(keys))
    return list(order), codes


class TrajectoryKFold(_TrajectorySplitter):
    """K folds of whole runs, with about the same number of rows in each.

    Parameters
    ----------
    n_splits : int, default=5
        Number of folds.
    shuffle : bool, default=False
        Whether runs of similar length are assigned at random.
    random_state : int, RandomState instance or None, default=None
        Seed of the shuffle.

    Notes
    -----
    Runs go one by one, the longest first, into the fold with the fewest rows. A shuffled split orders runs at random
    where their lengths differ by up to a quarter.

    Examples
    --------
    >>> import numpy as np
    >>> from pamid.signals import TrajectoryKFold
    >>> groups = np.repeat(["a", "b", "c", "d"], [4, 3, 2, 1])
    >>> [sorted(set(groups[test].tolist())) for _, test in TrajectoryKFold(2).split(np.zeros((10, 1)), groups=groups)]
    [['a', 'd'], ['b', 'c']]
    """

    def __init__(self, n_splits: int = 5, *, shuffle: bool = False, random_state: Any = None) -> None:
        self.n_splits = n_splits
        self.shuffle = shuffle
        self.random_state = random_state

    def _folds(self, X: Any, names: np.ndarray) -> np.ndarray:
        self._check()
        keys, codes = _number(names)
        if len(keys) < self.n_splits:
            raise TooFewTrajectoriesError(
                f"There {'is' if len(keys) == 1 else 'are'} {len(keys)} run{'' if len(keys) == 1 else 's'} "
                f"for {self.n_splits} folds.",
                "at least one run per fold",
                "Lower n_splits, or record more runs.",
            )
        sizes = np.bincount(codes)
        order = np.argsort(-sizes, kind="stable")
        if self.shuffle:
            chance = check_random_state(self.random_state).permutation(len(keys))
            order = chance[np.argsort(-np.round(4 * np.log2(sizes[chance])), kind="stable")]
        load = np.zeros(self.n_splits, dtype=np.int64)
        count = np.zeros(self.n_splits, dtype=np.int64)
        fold_of = np.empty(len(keys), dtype=np.int64)
        for key in order:
            fold = np.lexsort((count, load))[0]
            fold_of[key] = fold
            load[fold] += sizes[key]
            count[fold] += 1
        return fold_of[codes]

    def _check(self) -> None:
        if not isinstance(self.n_splits, int | np.integer) or isinstance(self.n_splits, bool) or self.n_splits < 2:
            raise ParameterError(f"n_splits is {self.n_splits!r}.", "a whole number, 2 or more", "Correct it.")

    def get_n_splits(self, X: Any = None, y: Any = None, groups: Any = None) -> int:
        """Count the folds; neither the table nor its runs are needed."""
        self._check()
        return int(self.n_splits)


def kind_of(trajectory: Any) -> str:
    """Return the kind of a run: its name up to the first ``-``, such as "step" for "step-0--15"."""
    return str(trajectory).split("-", 1)[0].split("@", 1)[0]


class LeaveOneKindOut(_TrajectorySplitter):
    """One fold for each kind of run: train on sines, test on steps.

    Parameters
    ----------
    kind : callable or None, default=None
        Takes a run's name and returns its kind; None: the first part of the name (`kind_of`).

    Examples
    --------
    >>> import numpy as np
    >>> from pamid.signals import LeaveOneKindOut
    >>> groups = np.array(["sine-1", "sine-2", "step-1"])
    >>> [test.tolist() for _, test in LeaveOneKindOut().split(np.zeros((3, 1)), groups=groups)]
    [[0, 1], [2]]
    """

    def __init__(self, kind: Callable[[Any], Any] | None = None) -> None:
        self.kind = kind

    def _folds(self, X: Any, names: np.ndarray) -> np.ndarray:
        keys, codes = _number(names)
        if self.kind is None and not all(isinstance(k, str) for k in keys):
            raise TrajectoryError(
                f"Runs are named by {type(keys[0]).__name__} ({keys[0]!r}), which gives no kind.",
                "names such as 'sine-1-10', or kind= as a function of what groups holds",
                "Pass the names as groups, or kind=.",
            )
        kinds, kind_codes = _number(np.array([(self.kind or kind_of)(k) for k in keys], dtype=object))
        return _at_least_two(kinds, kind_codes[codes], "kind", "Use TrajectoryKFold, or give kind=.")


class LeaveOneMuscleOut(_TrajectorySplitter):
    """One fold for each muscle: train on one muscle, test on another.

    Parameters
    ----------
    muscle : mapping, callable or None, default=None
        The muscle of each run, by name; None: a column ``muscle`` of X.

    Examples
    --------
    >>> import numpy as np
    >>> from pamid.signals import LeaveOneMuscleOut
    >>> groups = np.array(["a1", "a2", "b1"])
    >>> split = LeaveOneMuscleOut(muscle=lambda name: name[0])
    >>> [test.tolist() for _, test in split.split(np.zeros((3, 1)), groups=groups)]
    [[0, 1], [2]]
    """

    def __init__(self, muscle: Mapping[Any, Any] | Callable[[Any], Any] | None = None) -> None:
        self.muscle = muscle

    def _names(self, X: Any, groups: Any) -> np.ndarray:
        """A column of muscles needs no names of runs."""
        own = self.muscle is None and "muscle" in getattr(X, "columns", ())
        return super()._names(X, X["muscle"] if own else groups)

    def _folds(self, X: Any, names: np.ndarray) -> np.ndarray:
        keys, codes = _number(names)
        if self.muscle is None:
            if "muscle" not in getattr(X, "columns", ()):
                raise TrajectoryError(
                    "Nothing says which muscle a run belongs to.",
                    "a column 'muscle' in X, or muscle= as a mapping or function of the run's name",
                    "Give one of them.",
                )
            muscles, muscle_codes = keys, np.arange(len(keys))
        else:
            try:
                told = [self.muscle[k] if isinstance(self.muscle, Mapping) else self.muscle(k) for k in keys]
            except KeyError as error:
                raise TrajectoryError(
                    f"muscle= does not name the muscle of the run {error}.", "all of them", "Add it."
                ) from None
            muscles, muscle_codes = _number(np.array(told, dtype=object))
        return _at_least_two(muscles, muscle_codes[codes], "muscle", "Use TrajectoryKFold within one muscle.")


def _at_least_two(keys: list[Any], folds: np.ndarray, what: str, remedy: str) -> np.ndarray:
    if len(keys) < 2:
        raise TooFewTrajectoriesError(
            f"All runs are of one {what} ({keys[0] if keys else 'none'}).", f"at least two {what}s", remedy
        )
    return folds


def split_trajectories(
    X: Any, groups: Any = None, *, test_size: float = 0.25, random_state: Any = None
) -> tuple[np.ndarray, np.ndarray]:
    """Split rows into training and test by whole runs.

    Parameters
    ----------
    X : DataFrame or array_like, shape (n_samples, n_features)
        The table.
    groups : array_like, shape (n_samples,), optional
        Run of each row; a column ``trajectory`` of X serves as well.
    test_size : float, default=0.25
        Wanted share of the rows to test on; at least one run is on either side.
    random_state : int, RandomState instance or None, default=None
        Seed.

    Returns
    -------
    train : ndarray of int
        Rows to train on.
    test : ndarray of int
        Rows to test on.

    Raises
    ------
    TooFewTrajectoriesError
        If there is only one run.

    Examples
    --------
    >>> import numpy as np
    >>> from pamid.signals import split_trajectories
    >>> train, test = split_trajectories(np.zeros((100, 1)), np.repeat(np.arange(10), 10), random_state=0)
    >>> len(train), len(test)
    (70, 30)
    """
    if not 0.0 < test_size < 1.0:
        raise ParameterError(f"test_size is {test_size}.", "a share between 0 and 1", "Correct it.")
    keys, codes = _number(trajectories_of(X, groups))
    if len(keys) < 2:
        raise TooFewTrajectoriesError("There is only one run.", "at least two", "Record more, or split in time.")
    sizes = np.bincount(codes)
    order = check_random_state(random_state).permutation(len(keys))
    filled = np.cumsum(sizes[order])
    wanted = test_size * len(codes)
    n_test = int(np.argmin(np.abs(filled[:-1] - wanted))) + 1
    # Of two equally good counts the larger one, so that a test set is not smaller than requested.
    if n_test < len(keys) - 1 and abs(filled[n_test] - wanted) <= abs(filled[n_test - 1] - wanted):
        n_test += 1
    chosen = np.isin(codes, order[:n_test])
    return np.flatnonzero(~chosen), np.flatnonzero(chosen)
