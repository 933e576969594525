"""A linear state-space model by subspace identification, its order found from the data."""

from dataclasses import KW_ONLY
from typing import Any, Self

import numpy as np
from sklearn.utils.validation import check_is_fitted

from pamid.errors import ParameterError, ShortTrajectoryError, needs

from ._checks import check_counts, warn_of_still_columns
from ._narx import OutputModel
from ._parameters import parameters
from ._subspace import Realisation, gain_alone, realisations, simulated, steady
from ._trajectories import trajectory_slices


@parameters
class LinearStateSpace(OutputModel):
    r"""Linear state-space model of an output under inputs, by subspace identification (PO-MOESP).

    .. math:: x_{t+1} = A\,x_t + B\,u_t, \qquad y_t = C\,x_t + D\,u_t + c

    The column space of the extended observability matrix comes from projections of future outputs on past data, run by
    run, weighted to canonical correlations; A and C follow from it, B, D and the first states of the runs from linear
    least squares on free runs. The order is the number of canonical correlations σ that exceed those of as many
    unrelated signals, :math:`\sigma^2 > (\sqrt{a (1 - b)} + \sqrt{b (1 - a)})^2`, where a and b are the numbers of
    future and of past signals over that of the samples. Poles outside the unit circle are moved onto its edge.

    Parameters
    ----------
    order : int or "auto", default="auto"
        Number of states.
    max_order : int, default=8
        Largest number of states that "auto" considers.
    block_rows : int, default=20
        Rows of past and of future that the projection uses; more than the order.
    start : str, optional
        Signal that holds, in the first row of each run, the output before it. A free run starts at rest under
        its first inputs, and where `start` is given from the likeliest state with that output.

    Attributes
    ----------
    order_ : int
        Number of states.
    A_, B_, C_, D_ : ndarray
        The matrices, in standardised inputs and output.
    offset_ : float
        Output at rest under mean inputs, in its unit.
    state_covariance_ : ndarray, shape (n_states, n_states)
        Covariance of the states over the runs of the fit.
    poles_ : ndarray of complex, shape (n_states,)
        Eigenvalues of A.
    orders_ : list of dict
        For each order that was tried: ``order``, ``correlation`` (canonical, of past and future, that
        its last state carries), ``fit`` (of free runs, %) and ``criterion``.
    input_mean_, input_scale_ : ndarray, shape (n_inputs,)
        Mean and standard deviation of the inputs, in their units.
    output_mean_, output_scale_ : float
        The same of the output.
    n_parameters_ : int
        Number of parameters that a model of this order has, whatever its coordinates.

    See Also
    --------
    TransferFunction : A linear model of given order, fitted to its output error.

    References
    ----------
    M. Verhaegen, "Identification of the deterministic part of MIMO state space models given in innovations form from
    input-output data", Automatica 30(1), 1994. https://doi.org/10.1016/0005-1098(94)90229-1

    K. W. Wachter, "The limiting empirical measure of multiple discriminant ratios", The Annals of Statistics 8(5),
    1980. https://doi.org/10.1214/aos/1176345134

    Examples
    --------
    >>> import numpy as np, pandas as pd
    >>> from pamid.estimators import LinearStateSpace
    >>> rng = np.random.default_rng(0)
    >>> P = np.repeat(rng.uniform(1e5, 7e5, 200), 3)
    >>> eps = np.zeros(600)
    >>> for k in range(1, 600):
    ...     eps[k] = 0.8 * eps[k - 1] + 8e-8 * P[k - 1]
    >>> X = pd.DataFrame({"P": P})
    >>> model = LinearStateSpace(("P",), one_trajectory=True).fit(X, eps + 1e-4 * rng.standard_normal(600))
    >>> model.order_, round(float(model.poles_[0].real), 2)
    (1, 0.8)
    """

    _: KW_ONLY
    order: int | str = "auto"
    max_order: int = 8
    block_rows: int = 20
    start: str | None = None

    # each row a run of its own, as predictions must not change with the order of rows
    _checked = ({"inputs": ("x",), "max_order": 2, "block_rows": 3, "trajectory_column": 0},)

    def fit(self, X: Any, y: Any, groups: Any = None) -> Self:
        """Find order and matrices.

        Parameters
        ----------
        X : DataFrame or array_like, shape (n_samples, n_columns)
            Inputs, SI units, in time order within each run, at one sampling period throughout.
        y : array_like, shape (n_samples,)
            Output, for instance absolute pressure (Pa) or contraction ratio.

        Raises
        ------
        MissingTrajectoryError
            If nothing says which rows form a run.
        ShortTrajectoryError
            If the runs are too short for the projection.
        """
        check_counts(self, "max_order", "block_rows")
        if self.order != "auto":
            check_counts(self, "order")
        columns, target, codes = self._read_runs(X, y, groups)
        slices = trajectory_slices(codes)
        warn_of_still_columns(columns, self.inputs, type(self).__name__)
        u, z = self._scaled(columns, target)
        chosen = self._chosen(u, z, slices)
        self.A_, self.B_, self.C_, self.D_ = chosen.A, chosen.B, chosen.C, chosen.D
        self.offset_ = chosen.offset * self.output_scale_ + self.output_mean_
        self.state_covariance_ = chosen.covariance
        self.order_ = len(chosen.A)
        self.poles_ = np.linalg.eigvals(self.A_).astype(complex)
        m = columns.shape[1]
        self.n_parameters_ = self.order_ * (m + 1) + m + 1
        self._remember(X, y, groups=groups)
        return self

    def _chosen(self, u: np.ndarray, z: np.ndarray, slices: list[slice]) -> Realisation:
        """Return the realisation of the order asked for, or of the one that the data justify."""
        rows = min(int(self.block_rows), _most_rows(slices, u.shape[1]))
        if rows < 2:
            longest = max(s.stop - s.start for s in slices)
            if len(z) > 2 and longest > 1 and self.order != "auto":
                raise ShortTrajectoryError(
                    f"The longest run has {longest} rows.", "longer runs", "Record longer ones, or take order='auto'."
                )
            return gain_alone(u, z)
        most = min(int(self.max_order), rows - 1) if self.order == "auto" else int(self.order)
        if most >= rows:
            raise ParameterError(
                f"order is {most} and block_rows {rows}.", "fewer states than block_rows", "Correct one of them."
            )
        found = realisations(u, z, slices, rows, most)
        self.orders_ = [
            {
                "order": len(r.A),
                "correlation": r.correlation,
                "fit": float(100.0 * (1.0 - np.sqrt(r.loss))),
                "criterion": r.criterion,
            }
            for r in found
        ]
        return min(found, key=lambda r: r.criterion) if self.order == "auto" else found[-1]

    def predict(self, X: Any, groups: Any = None) -> np.ndarray:
        """Simulate each run freely."""
        table = self._read_fitted(X, "A_")
        u = (self._signals(table, self.inputs) - self.input_mean_) / self.input_scale_
        out = np.empty(len(u))
        for rows in trajectory_slices(self._codes(X, table, groups)):
            x = steady(self.A_, self.B_, u[rows.start])
            if self.start:
                before = (self._signal(table, self.start)[rows.start] - self.offset_) / self.output_scale_
                gain = self.state_covariance_ @ self.C_
                power = float(self.C_ @ gain)
                if power > 0:
                    x = x + gain / power * (before - float(self.C_ @ x + self.D_ @ u[rows.start]))
            out[rows] = simulated(self.A_, self.B_, self.C_, self.D_, x, u[rows])
        return out * self.output_scale_ + self.offset_

    def to_control(self, sampling_interval: float) -> Any:
        """Return the model for python-control, in the units of inputs and output, about mean inputs and `offset_`.

        Parameters
        ----------
        sampling_interval : float
            Time between rows, s.

        Returns
        -------
        control.StateSpace
            Discrete, with that sampling interval.

        Raises
        ------
        MissingDependencyError
            python-control is not installed.
        """
        check_is_fitted(self)
        with needs("python-control", "control", "control"):
            import control
        B, size = self.B_ / self.input_scale_, self.output_scale_
        D = (size * self.D_ / self.input_scale_)[None]
        return control.StateSpace(self.A_, B, size * self.C_[None], D, sampling_interval)


def _most_rows(slices: list[slice], n_inputs: int) -> int:
    """Return how many block rows the runs allow: twice as many columns as rows of the projection."""
    lengths = np.array([s.stop - s.start for s in slices])
    for rows in range(int(lengths.max()) // 2, 1, -1):
        if int(np.maximum(lengths - 2 * rows + 1, 0).sum()) >= 2 * rows * (2 * n_inputs + 2):
            return rows
    return 0
