"""The Q-adapter: a factor on the volume, from the muscles' geometry and the data, over any other adapter."""

import warnings
from dataclasses import KW_ONLY
from typing import Any, Self

import numpy as np

from pamid.errors import AdaptationWarning, IncompatibleError, ParameterError

from ._adaptation import AdaptedModel
from ._hybrid_fit import FitSamples
from ._hybrid_use import predicted
from ._parameters import parameters
from ._pihm import HybridModel
from ._source import hybrid_of

FAR_SIGMAS = 3.0
"""Standard uncertainties between the factor by geometry and the one by the data that are worth a warning."""


@parameters
class QAdapter(AdaptedModel):
    r"""Adapt a hybrid model to a muscle of another size: its volume is multiplied by Q.

    .. math:: V_\mathrm{target} = Q\,V(\cdot;\theta), \qquad
        Q_0 = \left(\frac{D_\mathrm{target}}{D_\mathrm{source}}\right)^2 \frac{L_\mathrm{target}}{L_\mathrm{source}}

    The laws are linear in the volume, so the default trainer solves for Q exactly, with Q₀ and its uncertainty as
    prior; then the network is adapted by `base`. With ``trainer="adam"`` both are trained together by
    Algorithm 2 as printed, Q at 0.2 of the rate, on a source with ``volume_model="neural"``.

    It is a regressor that predicts what the source predicts, and a transformer that appends the adapted volume and its
    derivatives to the signals, for `LawRegressor` as the next step of a pipeline.

    Parameters
    ----------
    initial : float or "geometry", default="geometry"
        Q₀. ``"geometry"`` takes it from the sizes of both muscles; where neither `rest_length` nor `rest_diameter` is
        given, the data alone decide.
    base : str or Adapter, default="full"
        How the network is adapted as well: ``"full"``, ``"low_rank"``, ``"frozen"`` (not at all), or an adapter with
        its parameters, such as ``pamid.adapters.low_rank.LowRank(ranks=(1, 2))``.
    size_uncertainty : tuple of float, default=(0.02, 0.05)
        Relative standard uncertainty of each length and of each diameter.
    trainer : {"levenberg_marquardt", "adam"} or Trainer, default="levenberg_marquardt"
        ``"adam"`` is Algorithm 2 as printed, with its hyperparameters. It refuses an anchored source: a factor on
        the network's output is not Q where the volume is not the network's alone.

    Attributes
    ----------
    q_ : float
        The factor on the volume.
    q0_ : float
        The factor by geometry or as given; that of the data where there is neither.
    q0_uncertainty_, q_uncertainty_ : float
        Standard uncertainties of both, the second from residuals that depend within a run.

    See Also
    --------
    ScaleAdapter : Length, diameter and dead volume one by one.
    LoRA, FullFineTuning, PartialFineTuning : Adaptations without a factor.

    References
    ----------
    G. Wang, R. Chalard, J. Cifuentes, M. Pham, "Fast adaptation of physics-informed hybrid models for pneumatic
    artificial muscles", 2025: Equation 7, Algorithm 2.

    Examples
    --------
    >>> import numpy as np, pandas as pd
    >>> from sklearn.frozen import FrozenEstimator
    >>> from pamid.estimators import QAdapter, StaticPIHM
    >>> t = np.linspace(0, 6, 200)
    >>> X = pd.DataFrame({"eps": 0.1 + 0.05 * np.sin(t), "deps": 0.05 * np.cos(t),
    ...                   "P": 3e5 + 1e5 * np.cos(3 * t), "dP": -3e5 * np.sin(3 * t)})
    >>> F = (X["P"] - 101325) * 5e-4 * (1 - 3 * X["eps"])  # N
    >>> A = StaticPIHM(0.2, 0.01, hidden_layer_sizes=(8,), max_iter=20, random_state=0).fit(X, F)
    >>> B = QAdapter(FrozenEstimator(A), rest_diameter=0.02, random_state=0).fit(X[::10], 4 * F[::10])
    >>> bool(B.score(X, 4 * F) > 0.99)
    True
    >>> round(B.q_, 2)
    4.0
    """

    initial: float | str = "geometry"
    _: KW_ONLY
    base: Any = "full"
    size_uncertainty: tuple[float, float] = (0.02, 0.05)

    method = "q"

    def _trains_q(self) -> bool:
        """Whether Q is one of the trained parameters, as published, instead of part of the volume's scale."""
        return not self._trainer_as_given().second_order

    def _check_law(self, source: HybridModel, y: Any) -> None:
        super()._check_law(source, y)
        if self._trains_q() and source.anchor_ is not None:
            raise IncompatibleError(
                f"QAdapter(trainer={self.trainer!r}) on a source with volume_model='anchored'.",
                "a source whose volume is the network's alone, for Algorithm 2 trains Q as a factor on its output",
                "Fit the source with volume_model='neural', or leave the trainer at its default, which solves for Q.",
            )

    def _bound_adapter(self) -> Any:
        if not self._trains_q():
            return self._adapter()
        from pamid.adapters.scalar import Scalar

        return Scalar(self.q0_, self._adapter())

    @property
    def _counts_scale(self) -> bool:  # type: ignore[override]
        return not self._trains_q()

    def _first_guess(self) -> tuple[float | None, float]:
        """Return Q₀, None if the data alone are to tell, and its relative uncertainty."""
        from pamid.adapters.geometry import volume_ratio

        source = hybrid_of(self.source, type(self).__name__)
        sizes = (source.rest_length, source.rest_diameter)
        spread = volume_ratio(sizes, sizes, self.size_uncertainty).uncertainty
        if isinstance(self.initial, str):
            if self.initial != "geometry":
                raise ParameterError(f"initial={self.initial!r}.", "'geometry' or a number above 0", "Correct it.")
            if self.rest_length is None and self.rest_diameter is None:
                return None, spread
            target = (self.rest_length or sizes[0], self.rest_diameter or sizes[1])
            return volume_ratio(sizes, target).value, spread
        if not (np.isfinite(self.initial) and self.initial > 0):
            raise ParameterError(
                f"The initial factor on the volume is {self.initial!r}.",
                "a finite number above 0",
                "Take the ratio of D^2 L of the two muscles, or initial='geometry'.",
            )
        return float(self.initial), spread

    def _place(self, model: HybridModel, rows: FitSamples) -> None:
        table, Y, weight, codes = rows
        guess, relative = self._first_guess()
        f = predicted(model, table) / model.target_scale_
        y = Y / model.target_scale_
        w = np.where(np.isfinite(Y), weight[:, None], 0.0)
        y = np.where(w > 0, y, 0.0)
        information = float((w * f * f).sum())
        fitted = float((w * f * y).sum()) / information if information > 0 else np.nan
        score = f * (y - fitted * f)
        scatter = float((w * score**2).sum())
        if codes is not None and np.ptp(codes) > 0:
            # Residuals of one run depend on each other: their information about Q counts once. Those of a
            # single run sum to nothing, so that rows count there.
            scatter = float((np.bincount(codes, weights=(w * score).sum(axis=1)) ** 2).sum())
        error = float(np.sqrt(scatter)) / information if information > 0 else np.inf
        error = max(error, 1e-9 * abs(fitted)) if np.isfinite(fitted) else np.inf
        self.q0_ = guess if guess is not None else fitted if fitted > 0 else 1.0
        self.q0_uncertainty_ = relative * self.q0_ if guess is not None else np.inf
        self._warn_of_contradiction(fitted, error, f, y, w)
        precision = 1.0 / self.q0_uncertainty_**2 + (1.0 / error**2 if fitted > 0 else 0.0)
        q = self.q0_
        if fitted > 0:
            q = (self.q0_ / self.q0_uncertainty_**2 + fitted / error**2) / precision
        self.q_, self.q_uncertainty_ = float(q), float(1.0 / np.sqrt(precision)) if precision else np.inf
        if not self._trains_q():
            self._rescale(model, self.q_)

    def _warn_of_contradiction(
        self, fitted: float, error: float, f: np.ndarray, y: np.ndarray, weight: np.ndarray
    ) -> None:
        if not fitted > 0:
            warnings.warn(
                f"The factor on the volume that fits the data best is {fitted:.3g}; Q₀ = {self.q0_:.3g} is kept. "
                "Expected a factor above 0. Check signs, units and columns, and that source and target are of one law.",
                AdaptationWarning,
                stacklevel=6,
            )
            return
        apart = abs(fitted - self.q0_)
        if apart > FAR_SIGMAS * np.hypot(self.q0_uncertainty_, error):
            warnings.warn(
                f"The data give Q = {fitted:.4g} ± {error:.2g}, the sizes Q = {self.q0_:.4g} ± "
                f"{self.q0_uncertainty_:.2g}. Expected them to agree. Check the sizes of both muscles (m) and the "
                "units of the target's data; size_uncertainty says how well the sizes are known.",
                AdaptationWarning,
                stacklevel=6,
            )
        left, whole = float((weight * (y - fitted * f) ** 2).sum()), float((weight * y**2).sum())
        if left > 0.75 * whole:
            warnings.warn(
                f"The source explains {1 - left / whole:.0%} of the target whatever the factor on its volume. Expected "
                "most of it. Check that source and target are of one law, and that the columns are the same signals.",
                AdaptationWarning,
                stacklevel=6,
            )

    def _keep(self, model: HybridModel, result: Any, bound: Any, before: list[float], held_out: list[float]) -> None:
        super()._keep(model, result, bound, before, held_out)
        if self._trains_q():
            self.q_ = float(self.psi_[0][0])

    @classmethod
    def _checked_instances(cls) -> list[Self]:
        return [
            cls._tiny(initial=4.0, max_iter=5),
            cls._tiny(rest_diameter=0.02, base="frozen", max_iter=5),
            cls._tiny(initial=2.0, trainer="adam", max_iter=5),
        ]
