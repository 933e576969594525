"""What an equation of the bench is: the columns it needs, and its residual over windows of a run."""

from abc import ABC, abstractmethod
from typing import ClassVar, NamedTuple

import numpy as np

from .._discovery import modules
from ..effects import Effect
from ..errors import IncompatibleError
from .run import Run


class Residual(NamedTuple):
    """An equation over the windows of one run.

    Parameters
    ----------
    time : array, shape (n_windows,)
        Centres of the windows, s.
    value : array, shape (n_windows, n_sides)
        Measured minus modelled side, in the equation's unit; a side is a muscle, or the joint.
    measured : array, shape (n_windows, n_sides)
        The measured side.
    noise : array, shape (n_windows, n_sides)
        Standard deviation that the noise of the channels leaves in `value`.
    shared : array, shape (n_lags, n_windows, n_sides)
        Covariance of that noise with the one in the first, second ... window after it: neighbouring test functions
        overlap, and a derivative takes from one window what it gives the next. 0 beyond the end.

    Examples
    --------
    >>> from pamid.bench import BenchParameters, simulate, sine
    >>> from pamid.equations import residuals
    >>> bench = BenchParameters.for_muscle("B")
    >>> trajectory, equation, r = next(residuals(simulate(bench, [sine(4, 15, 400)]), bench, ["force"]))
    >>> equation, r.value.shape == r.noise.shape
    ('force', True)
    """

    time: np.ndarray
    value: np.ndarray
    measured: np.ndarray
    noise: np.ndarray
    shared: np.ndarray = np.zeros((0, 0, 0))


class Equation(ABC):
    """One equation of the bench. A subclass in a module of this package is found automatically.

    Examples
    --------
    >>> from pamid.equations import all_equations
    >>> flow = all_equations()["flow"]
    >>> flow.unit, flow.channels
    ('kg/s', ('q', 'P', 'mdot'))
    """

    name: ClassVar[str]
    """Its name."""
    unit: ClassVar[str]
    """Unit of its residual."""
    channels: ClassVar[tuple[str, ...]]
    """Channels that it reads, of ``q``, ``P``, ``F``, ``mdot``, ``u``."""
    order: ClassVar[int]
    """Order of the B-spline that tests it: one more than the time derivatives that it takes."""
    rank: ClassVar[int]
    """Place in lists."""
    sides: ClassVar[tuple[str, ...]] = ("1", "2")
    """What the columns of a residual belong to."""
    combines: ClassVar[tuple[str, ...]] = ()
    """Equations that it joins such that no channel is left that only they read; empty for an equation of its own."""
    without: ClassVar[str] = ""
    """The channel that those read and it does not: it is tested where a log lacks that one."""

    @classmethod
    def title(cls) -> str:
        """Return its name for people, such as ``"flow"``, or what it combines, such as ``"flow–valve"``."""
        return "–".join(cls.combines) or cls.name

    @classmethod
    def changed_by(cls, effect: type[Effect]) -> bool:
        """Return whether an effect enters the equation or one that it combines; a sensor's fault where that is read."""
        entered = any(name in effect.equations for name in cls.combines or (cls.name,))
        return entered and (not cls.combines or not effect.channel or effect.channel in cls.channels)

    @abstractmethod
    def residual(self, run: Run) -> Residual:
        """Return the residual over the windows of ``run``."""


def spread(*parts: tuple[np.ndarray | float, np.ndarray], n_windows: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the standard deviation of a residual from the noise of its channels, and the neighbours' covariance."""
    order = max(len(covariances) for _, covariances in parts)
    total: list[np.ndarray | float] = [0.0] * order
    sides = max(max(np.shape(s)[-1] if np.ndim(s) else 1, c.shape[-1]) for s, c in parts)
    for sensitivity, covariances in parts:
        s = np.broadcast_to(sensitivity, (n_windows, sides))
        for lag, covariance in enumerate(covariances):
            found = s * s * covariance if lag == 0 else s * covariance
            if lag:  # with the window so many further on, which the last ones lack
                found[:-lag] *= s[lag:]
                found[-lag:] = 0.0
            total[lag] = total[lag] + found
    full = [np.broadcast_to(t, (n_windows, sides)) for t in total]
    return np.sqrt(full[0]), np.array(full[1:]).reshape(order - 1, n_windows, sides)


def all_equations() -> dict[str, Equation]:
    """Return the equations of the bench by name.

    Returns
    -------
    dict of str to Equation
        ``force``, ``flow``, ``valve``, ``joint``, those that combine them, and any further one that a module of this
        package defines.

    Examples
    --------
    >>> from pamid.equations import all_equations
    >>> sorted(all_equations())
    ['flow', 'force', 'gas_valve', 'joint', 'joint_modelled', 'valve']
    """
    modules("pamid.equations")
    found: dict[str, Equation] = {}
    for equation in sorted(Equation.__subclasses__(), key=lambda c: c.rank):
        if equation.name in found:
            raise IncompatibleError(
                f"Two equations are named {equation.name!r}.", "one equation a name", "Rename one of them."
            )
        found[equation.name] = equation()
    return found
