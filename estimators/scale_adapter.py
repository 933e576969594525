"""Adaptation by physical scales: length, diameter and dead volume, as far as the data can distinguish them."""

from collections.abc import Sequence
from dataclasses import KW_ONLY, field
from typing import Any, NamedTuple, Self

import numpy as np

from pamid.errors import FitError, IncompatibleError, UnknownOptionError

from ._adaptation import AdaptedModel
from ._base import state_of
from ._hybrid_fit import FitSamples
from ._hybrid_use import predicted
from ._parameters import parameters
from ._pihm import HybridModel
from ._source import hybrid_of

SCALES = ("length", "diameter", "dead_volume")

WEAK = 0.1
"""Relative standard uncertainty above which data do not determine a scale; a dead volume's is relative to the
muscle's."""

ALIKE = 1e4
"""Condition of the Gauss–Newton Hessian, its columns of one length, above which data do not distinguish scales."""


class _Solution(NamedTuple):
    """Estimates of the linear problem, their standard uncertainties, and the condition of its Hessian."""

    value: np.ndarray
    error: np.ndarray
    condition: float


_Part = tuple[str, np.ndarray, np.ndarray, np.ndarray, float]
"""Of an equation its name, prediction, share of a dead volume, target and scale."""


@parameters
class ScaleAdapter(AdaptedModel):
    r"""Adapt a hybrid model by the physical scales in which two muscles of one kind differ.

    .. math:: V_\mathrm{target} = Q_L Q_D^2\,V_\mathrm{source} + V_d, \qquad
        F_\mathrm{target} = Q_D^2\,F_\mathrm{source}

    with the ratios of lengths :math:`Q_L` and diameters :math:`Q_D` and the volume :math:`V_d` of tubes and fittings.
    Force depends neither on the length (the volume's and the lever's cancel) nor on a dead volume;
    flow depends on length and diameter only through D²L; together they distinguish them. The problem is linear and
    solved at once. Scales that the data do not determine are refused.

    Parameters
    ----------
    scales : "auto" or tuple of str, default="auto"
        Any of ``"length"``, ``"diameter"``, ``"dead_volume"``. ``"auto"`` takes those that the data distinguish: the
        diameter always, the length where force and flow are measured. The others keep the ratio of `rest_length` and
        `rest_diameter` to the source's.
    base : str or Adapter, default="frozen"
        How the network is adapted as well, as in `QAdapter`.

    Attributes
    ----------
    length_factor_, diameter_factor_ : float
        Q_L and Q_D.
    dead_volume_ : float
        V_d, m³.
    uncertainty_ : dict
        Standard uncertainty of each scale that was found from data.
    refused_ : dict
        Why ``scales="auto"`` left a scale out.
    condition_ : float
        Condition of the Gauss–Newton Hessian of the scales.

    See Also
    --------
    QAdapter : One factor on the volume.

    Examples
    --------
    >>> import numpy as np, pandas as pd
    >>> from sklearn.frozen import FrozenEstimator
    >>> from pamid.estimators import ScaleAdapter, StaticPIHM
    >>> t = np.linspace(0, 6, 200)
    >>> X = pd.DataFrame({"eps": 0.1 + 0.05 * np.sin(t), "deps": 0.05 * np.cos(t),
    ...                   "P": 3e5 + 1e5 * np.cos(3 * t), "dP": -3e5 * np.sin(3 * t)})
    >>> F = (X["P"] - 101325) * 5e-4 * (1 - 3 * X["eps"])  # N
    >>> A = StaticPIHM(0.2, 0.01, hidden_layer_sizes=(8,), max_iter=20, random_state=0).fit(X, F)
    >>> B = ScaleAdapter(FrozenEstimator(A), random_state=0).fit(X[::10], 4 * F[::10])
    >>> bool(B.score(X, 4 * F) > 0.99)
    True
    >>> round(B.diameter_factor_, 2)
    2.0
    """

    scales: Sequence[str] | str = "auto"
    _: KW_ONLY
    base: Any = "frozen"
    blend: bool | str = field(default=False, init=False)

    method = "scales"

    def _place(self, model: HybridModel, rows: FitSamples) -> None:
        table, Y, weight, codes = rows
        source = hybrid_of(self.source, type(self).__name__)
        self.length_factor_ = (self.rest_length or source.rest_length) / source.rest_length
        self.diameter_factor_ = (self.rest_diameter or source.rest_diameter) / source.rest_diameter
        # The source's prediction at its own length: the law's lever is then part of the scales.
        laws = source.laws()
        f = predicted(model, table, laws)
        dead = np.column_stack([np.asarray(law.coefficients(state_of(model, table)).V) + 0.0 * f[:, 0] for law in laws])
        wanted = self._wanted(model)
        parts = [
            (law.equation, f[:, k], dead[:, k], Y[:, k], model.target_scale_[k]) for k, law in enumerate(model.laws())
        ]
        self.refused_: dict[str, str] = {}
        if self.scales != "auto":
            solution = self._solve(parts, wanted, weight, codes)
            if reason := self._reason(wanted, solution, model):
                raise FitError(
                    f"The data do not determine {' and '.join(wanted)}: {reason}",
                    "data that excite each scale on its own",
                    "Ask for fewer scales, or record runs that change the pressure at rest and move the muscle.",
                )
        else:
            wanted, solution = self._largest(parts, wanted, weight, codes, model)
        self._apply(model, wanted, solution)

    def _wanted(self, model: HybridModel) -> tuple[str, ...]:
        """Return the scales asked for; raise for those that no data of these laws could tell."""
        equations = {law.equation for law in model.laws()}
        if isinstance(self.scales, str) and self.scales == "auto":
            own = {"force": ("diameter",), "flow": ("diameter", "dead_volume")}
            return own.get(next(iter(equations)), SCALES) if len(equations) == 1 else SCALES
        wanted = () if isinstance(self.scales, str) else tuple(self.scales)
        if not wanted or set(wanted) - set(SCALES) or len(set(wanted)) < len(wanted):
            raise UnknownOptionError(
                f"scales={self.scales!r}.", f"'auto' or some of {', '.join(SCALES)}", "Correct it."
            )
        why = {
            "length": "force does not depend on the length: the volume's length and the lever's cancel",
            "dead_volume": "force does not depend on a constant volume",
        }
        for scale in wanted:
            if equations == {"force"} and scale in why:
                raise IncompatibleError(
                    f"scales={wanted} with a source of force alone: {why[scale]}.",
                    "a source that reads the flow as well for this scale",
                    "Leave it out, or adapt a JointPIHM.",
                )
        if equations == {"flow"} and {"length", "diameter"} <= set(wanted):
            raise IncompatibleError(
                f"scales={wanted} with a source of flow alone: flow sees length and diameter as D²L only.",
                "one of the two",
                "Give the other one's size, or adapt a JointPIHM to force and flow.",
            )
        return wanted

    def _solve(
        self,
        parts: list[_Part],
        wanted: Sequence[str],
        weight: np.ndarray,
        codes: Any,
    ) -> _Solution:
        r"""Solve for what the equations read linearly: Q_D² of the force, Q_L Q_D² of the flow, V_d."""
        area = self.diameter_factor_**2
        columns, targets, weights = [], [], []
        free = [name for name in ("diameter", "length") if name in wanted] + ["dead_volume"] * ("dead_volume" in wanted)
        for equation, f, dead, y, scale in parts:
            known = np.isfinite(y)
            A, rest = np.zeros((len(f), len(free))), np.zeros(len(f))
            if equation == "force":
                if "diameter" in free:
                    A[:, free.index("diameter")] = f
                else:
                    rest = area * f
            else:
                if "length" in free:
                    A[:, free.index("length")] = f
                elif "diameter" in free:
                    A[:, free.index("diameter")] = self.length_factor_ * f
                else:
                    rest = self.length_factor_ * area * f
                if "dead_volume" in free:
                    A[:, free.index("dead_volume")] = dead
            columns.append(A / scale)
            targets.append(np.where(known, y - rest, 0.0) / scale)
            weights.append(np.where(known, weight, 0.0))
        A, y, w = np.vstack(columns), np.concatenate(targets), np.concatenate(weights)
        H = A.T @ (w[:, None] * A)
        size = np.sqrt(np.diag(H))
        size[size == 0] = 1.0
        condition = float(np.linalg.cond(H / size / size[:, None]))
        inverse = np.linalg.pinv(H / size / size[:, None]) / size / size[:, None]
        value = inverse @ (A.T @ (w * y))
        score = A * (w * (y - A @ value))[:, None]
        groups = np.arange(len(y)) if codes is None else np.tile(codes, len(parts))
        summed = np.zeros((int(groups.max()) + 1, len(free)))
        np.add.at(summed, groups, score)
        error = np.sqrt(np.diag(inverse @ (summed.T @ summed) @ inverse))
        order = [free.index(name) for name in wanted]
        return _Solution(value[order], error[order], condition)

    def _reason(self, wanted: Sequence[str], solution: _Solution, model: HybridModel) -> str:
        """Return why a solution is not to be trusted, empty if it is."""
        if not solution.condition < ALIKE:
            return f"their effects are nearly the same (condition of the Hessian {solution.condition:.1e})."
        rest = np.pi * model.rest_diameter**2 / 4.0 * model.rest_length
        for name, value, error in zip(wanted, solution.value, solution.error, strict=True):
            size = rest if name == "dead_volume" else abs(value)
            if not error < WEAK * size:
                return f"{name} is known to {error / size:.0%} only."
            if name != "dead_volume" and value <= 0:
                return f"the data give a negative {name}; check signs, units and columns."
        return ""

    def _largest(
        self, parts: Any, wanted: Sequence[str], weight: np.ndarray, codes: Any, model: HybridModel
    ) -> tuple[tuple[str, ...], _Solution]:
        """Leave out scales, the dead volume first, until the data distinguish the others."""
        left = tuple(wanted)
        while True:
            solution = self._solve(parts, left, weight, codes)
            reason = self._reason(left, solution, model)
            if not reason or not left:
                return left, solution
            gone = "dead_volume" if "dead_volume" in left else "length" if "length" in left else left[-1]
            self.refused_[gone] = reason
            left = tuple(name for name in left if name != gone)
            if not left:
                return left, _Solution(np.empty(0), np.empty(0), np.inf)

    def _apply(self, model: HybridModel, wanted: Sequence[str], solution: _Solution) -> None:
        found = dict(zip(wanted, solution.value, strict=True))
        spread = dict(zip(wanted, solution.error, strict=True))
        self.condition_, self.uncertainty_, self.dead_volume_ = solution.condition, {}, 0.0
        if "diameter" in found:
            self.diameter_factor_ = float(np.sqrt(found["diameter"]))
            self.uncertainty_["diameter"] = float(spread["diameter"] / (2.0 * self.diameter_factor_))
        area = self.diameter_factor_**2
        if "length" in found:
            # The unknown of the flow is the whole factor on the volume.
            self.length_factor_ = float(found["length"] / area)
            self.uncertainty_["length"] = float(spread["length"] / area)
        if "dead_volume" in found:
            self.dead_volume_ = float(found["dead_volume"])
            self.uncertainty_["dead_volume"] = float(spread["dead_volume"])
        source = hybrid_of(self.source, type(self).__name__)
        model.rest_length = float(source.rest_length * self.length_factor_)
        self._rescale(model, float(self.length_factor_ * area), self.dead_volume_)

    @property
    def _counts_scale(self) -> int:  # type: ignore[override]
        return len(self.uncertainty_)

    @classmethod
    def _checked_instances(cls) -> list[Self]:
        return [cls._tiny(), cls._tiny(base="full", max_iter=5)]
