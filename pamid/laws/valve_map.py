"""A servo valve by its measured map: mass flow over command and pressure, as a table of polynomials."""

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Self

import numpy as np

from ..errors import ExcitationError, ParameterError, ShapeError
from ..explained import explained_fields
from ..signals.state import Array
from ._backend import namespace

_LEAST = 30
"""Samples on each side of the middle position, below which no map is identified."""


@explained_fields
@dataclass(frozen=True)
class ValveMap:
    r"""Mass flow of a servo valve as a characteristic map, identified from measured flow.

    .. math:: \dot m(u, P) = \varphi(P) + \psi_\pm(P)\,u, \qquad
        \varphi, \psi_\pm \text{ polynomials of } x = P / P_s

    φ is what leaks at the middle position; ψ₊ holds for u > 0 (filling), ψ₋ for u < 0 (venting), since the passages
    differ. Unlike ISO 6358 (`pamid.laws.valve.Valve`) it presumes nothing of the passages, and needs data that cover
    both directions over all pressures.

    Notes
    -----
    The study computes its flow from the valve's characteristic map as verified by Olaby et al. The form is that of
    the electropneumatic literature of the same laboratory; the coefficients of Olaby et al. are those of one valve and
    are not part of this package.

    References
    ----------
    M. Belgharbi, S. Sesmat, S. Scavarda, D. Thomasset, "Analytical model of the flow stage of a pneumatic
    servo-distributor for simulation and nonlinear control", 6th Scandinavian International Conference on Fluid Power,
    1999, as later papers quote it. O. Olaby, X. Brun, S. Sesmat, T. Redarce, E. Bideaux, "Characterization and modeling
    of a proportional valve for control synthesis", 6th JFPS International Symposium on Fluid Power, 2005.

    Examples
    --------
    >>> import numpy as np
    >>> from pamid.laws.valve import Valve
    >>> from pamid.laws.valve_map import ValveMap
    >>> rng = np.random.default_rng(0)
    >>> u, P = rng.uniform(-1, 1, 2000), rng.uniform(1.5e5, 5e5, 2000)
    >>> iso = Valve(sonic_conductance=6e-9, critical_pressure_ratio=0.35, supply_pressure=7e5)
    >>> mdot = iso.flow(u, P) + rng.normal(0, 3e-6, 2000)  # kg/s
    >>> known = ValveMap.fit(u, P, mdot, supply_pressure=7e5)
    >>> bool(np.std(known.flow(u, P) - iso.flow(u, P)) < 2e-6)
    True
    """

    leakage: Annotated[tuple[float, ...], "Coefficients of φ, kg/s, lowest power first."]
    filling: Annotated[tuple[float, ...], "Coefficients of ψ₊ and ψ₋, kg/s at u = ±1, lowest power first."]
    venting: Annotated[tuple[float, ...], "Coefficients of ψ₊ and ψ₋, kg/s at u = ±1, lowest power first."]
    supply_pressure: Annotated[float, "P_s, Pa, absolute."]
    lowest: Annotated[float, "Range of the pressures of the fit, Pa, absolute, at whose ends the polynomials are held."]
    highest: Annotated[
        float, "Range of the pressures of the fit, Pa, absolute, at whose ends the polynomials are held."
    ]

    equation: ClassVar[str] = "valve"
    target: ClassVar[str] = "mdot"
    unit: ClassVar[str] = "kg/s"

    @classmethod
    def fit(
        cls, u: Any, P: Any, mdot: Any, *, supply_pressure: float, degree: int = 5, leakage_degree: int = 0
    ) -> Self:
        """Identify the map by linear least squares.

        Parameters
        ----------
        u : array_like, shape (n_samples,)
            Valve command, −1 (full vent) to 1 (full fill).
        P : array_like, shape (n_samples,)
            Pressure in the muscle, Pa, absolute.
        mdot : array_like, shape (n_samples,)
            Measured mass flow into the muscle, kg/s.
        supply_pressure : float
            P_s, Pa, absolute.
        degree, leakage_degree : int, default=5, 0
            Degrees of ψ and of φ.

        Returns
        -------
        ValveMap
            The identified map.

        Raises
        ------
        ShapeError
            If the signals are not of one length.
        ParameterError
            If a degree is not a whole number from 0.
        ExcitationError
            If the valve has hardly been open one way, or the pressure does not tell the polynomials.
        """
        u, P, mdot = (np.asarray(v, dtype=float).ravel() for v in (u, P, mdot))
        if not len(u) == len(P) == len(mdot):
            raise ShapeError(f"u, P and mdot have {len(u)}, {len(P)} and {len(mdot)} samples.", "one length", "Match.")
        for name, value in (("degree", degree), ("leakage_degree", leakage_degree)):
            if not isinstance(value, int | np.integer) or value < 0:
                raise ParameterError(f"{name} is {value!r}.", "a whole number from 0", "Correct it.")
        for way, open_ in (("filling", u > 0), ("venting", u < 0)):
            if (n := int(open_.sum())) < _LEAST:
                raise ExcitationError(
                    f"The valve is {way} in {n} samples.", f"at least {_LEAST} each way", "Record a run that does both."
                )
        x = P / supply_pressure
        powers = np.vander(x, degree + 1, increasing=True)
        leaks = np.vander(x, leakage_degree + 1, increasing=True)
        columns = np.hstack([leaks, powers * np.maximum(u, 0)[:, None], powers * np.minimum(u, 0)[:, None]])
        scale = np.sqrt((columns**2).mean(axis=0))
        found, _, rank, _ = np.linalg.lstsq(columns / scale, mdot, rcond=1e-10)
        if rank < columns.shape[1]:
            raise ExcitationError(
                f"Commands and pressures tell {rank} of {columns.shape[1]} coefficients.",
                "pressures that vary while the valve is open, each way",
                "Record more pressures, or lower degree.",
            )
        found = found / scale
        a, b = leakage_degree + 1, leakage_degree + degree + 2
        parts = (tuple(float(c) for c in part) for part in (found[:a], found[a:b], found[b:]))
        leakage, filling, venting = parts
        return cls(leakage, filling, venting, float(supply_pressure), float(P.min()), float(P.max()))

    def flow(self, u: Array, P: Array) -> Array:
        """Return ṁ into the muscle (kg/s) at command ``u`` and absolute pressure ``P`` (Pa)."""
        xp = namespace(u, P)
        x = xp.clip(P, self.lowest, self.highest) / self.supply_pressure
        passage = xp.where(u + 0.0 * P > 0, _value(self.filling, x), _value(self.venting, x))
        return _value(self.leakage, x) + passage * u

    def command(self, mdot: Array, P: Array) -> Array:
        """Return the command ``u`` that gives the flow ``mdot`` (kg/s) at absolute pressure ``P`` (Pa); not clipped."""
        xp = namespace(mdot, P)
        x = xp.clip(P, self.lowest, self.highest) / self.supply_pressure
        through = mdot - _value(self.leakage, x)
        return through / xp.where(through > 0, _value(self.filling, x), _value(self.venting, x))


def _value(coefficients: tuple[float, ...], x: Array) -> Array:
    """Evaluate a polynomial, lowest power first."""
    out = 0.0 * x + coefficients[-1]
    for c in coefficients[-2::-1]:
        out = out * x + c
    return out
