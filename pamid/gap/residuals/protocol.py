"""What the inference reads from a log: windowed residuals in units of their noise, for any simulator."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Any, Protocol

import numpy as np

from ...effects import Effect, Parameter
from ...simulators.placement import Placement

Spec = Mapping[str, Mapping[str, float]]
"""Effects by name, with the values of their parameters."""

Active = list[tuple[Placement, Any]]
"""Effects with their values, made: what acts at which port."""

STATE = ("eps", "deps", "P", "dP", "u", "q", "dq")
"""The state at the centre of a window: contraction ratio and its rate (1/s), absolute pressure (Pa) and its rate
(Pa/s), valve command, joint angle (rad) and its rate (rad/s)."""


class ResidualSource(Protocol):
    """A log compared with a simulator, as one vector of windows; its users do not know which kind of simulator."""

    @property
    def effects(self) -> Mapping[str, type[Effect]]:
        """The effects that may act here, by the names of a `Spec`."""
        ...

    equations: list[str]  # the equations (of a simulator: its ports) that the log allows
    parts: list[slice]  # the windows of each
    units: dict[str, str]
    skipped: dict[str, str]  # equations that were left out, and why
    z0: np.ndarray  # residuals of the simulator as given, white, in units of their noise, equation after equation
    noise: np.ndarray  # standard deviation of each window's noise, in the unit of its equation
    measured: np.ndarray  # the measured side of each window's equation
    J: np.ndarray  # change of the residuals by one tolerance of each free parameter, (n_windows, n_free)
    free: list[str]  # parameters that have a tolerance
    weights: np.ndarray  # of a window of each equation, less than one where neighbours repeat each other
    run: np.ndarray  # stretch of the log of each window
    side: np.ndarray  # muscle (or joint) of each window
    block: np.ndarray  # run of each window
    time: np.ndarray  # centres of the windows, s
    trajectories: list[str]
    sharp: list[slice]  # windows in which none may be far out by chance
    stretch: float  # correlation time of the residuals, s
    exact: bool
    bends: bool
    simulates: bool  # residuals are of runs of the simulator, not of its equations
    rough: bool  # changes are differences of whole runs of somebody's code, which may stick, switch or step
    rows: int  # of the log, which show its noise
    overlap: int  # most windows of an equation that one reading is in
    curved: bool  # `slopes` differ much between parameters as given and as fitted
    twins: Mapping[str, str]  # effects that no log of this simulator distinguishes, each by the other's name
    pace: float  # what a second of the log counts, s: 1 unless its runs are of unusual length
    one_sided: bool  # `side` is the place of a window's equation, not a muscle
    least_gain: float
    decisive: float

    @property
    def lasting(self) -> Collection[str]:
        """The free parameters that stay from one day to the next, such as lengths and masses."""
        ...

    @property
    def about(self) -> np.ndarray:
        """Starting deviations of the free parameters, in tolerances."""
        ...

    @property
    def ends(self) -> tuple[np.ndarray, np.ndarray]:
        """The lowest and highest deviations of the free parameters, in tolerances from the starting ones."""
        ...

    def has(self, name: str) -> bool:
        """Return whether an effect has something to act on here."""
        ...

    @property
    def state(self) -> dict[str, np.ndarray]:
        """The state at each window, by the names of `STATE`; NaN where it has none."""
        ...

    def z(
        self, spec: Spec, deviations: Mapping[str, float] | None = None, equations: Sequence[str] | None = ()
    ) -> np.ndarray:
        """Return the residuals under effects and changed parameters, in units of the noise and white."""
        ...

    def tangent(self, spec: Spec, x: np.ndarray) -> np.ndarray:
        """Return z0 such that z0 + slopes @ x equals the exact residuals at deviations x, in tolerances."""
        ...

    def slopes(self, spec: Spec, x: np.ndarray) -> np.ndarray:
        """Return the change of the residuals by one tolerance of each parameter, under effects, at deviations x."""
        ...

    def folded(self, spec: Spec, x: np.ndarray) -> tuple[dict[str, dict[str, float]], np.ndarray]:
        """Return the same effects and deviations, with no tolerance left that an effect contains."""
        ...

    def change(self, spec: Spec, about: Spec, x: np.ndarray) -> np.ndarray:
        """Return by how much the residuals change from effects to others nearby, to first order, at deviations x."""
        ...

    def glance(self, spec: Spec) -> np.ndarray:
        """Return roughly what effects change in the residuals, at low cost: enough to choose points of a fine grid."""
        ...

    def raw(self, z: np.ndarray) -> np.ndarray:
        """Return residuals as the windows have them, in units of each window's noise."""
        ...

    def white(self, z: np.ndarray) -> np.ndarray:
        """Return residuals with noise that is independent from window to window: the inverse of `raw`."""
        ...

    def touched(self, names: Collection[str]) -> list[str]:
        """Return the equations that effects change."""
        ...

    def freedom(self, spec: Spec) -> float:
        """Return the price of the unknown memory of effects when runs begin, a logarithm of likelihood."""
        ...

    def widening(self, spec: Spec) -> np.ndarray | None:
        """Return by how much undoing the lags of sensors widens each window's noise; None without such effects."""
        ...

    def spread(self, spec: Spec, x: np.ndarray) -> np.ndarray | None:
        """Return how wide the noise is under a changed simulator, per what `z` is divided by; None if the same."""
        ...

    def filtered(self, spec: Spec, z: np.ndarray) -> np.ndarray | None:
        """Return residuals filtered as undoing faults of readings filters their noise; None without such faults."""
        ...

    def scales_noise(self, spec: Spec) -> bool:
        """Return whether undoing faults of readings changes their noise, which first order takes for evidence."""
        ...

    def reach(self, spec: Spec) -> np.ndarray | None:
        """Return the share of a small addition that reaches each window past sensor effects; None for all of it."""
        ...

    def reached(self, p: Parameter) -> Parameter:
        """Return a parameter with the bounds between which it changes anything on this log."""
        ...

    def stepped(self) -> ResidualSource | None:
        """Return the log with steps of the integrator behind it as one more free parameter; None without any."""
        ...

    def pieces(self) -> tuple[np.ndarray, int]:
        """Return the run, or piece of one, with which each window is left out in turn, and their number."""
        ...

    def prior(self, name: str) -> float:
        """Return the logarithm of the odds with which an effect is expected."""
        ...

    def column(self, name: str, side: int = 0) -> str:
        """Return the user's name of a signal of the state."""
        ...

    def told(self, equation: str) -> dict[str, np.ndarray]:
        """Return what tells a reader where the windows of an equation lie, by the user's names."""
        ...


def lanes(evidence: ResidualSource) -> np.ndarray:
    """Number the windows by equation, run and side, in their order."""
    equation = np.repeat(np.arange(len(evidence.parts)), [part.stop - part.start for part in evidence.parts])
    return (equation * (int(evidence.run.max(initial=0)) + 1) + evidence.run) * 16 + evidence.side
