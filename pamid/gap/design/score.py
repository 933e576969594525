r"""How clearly runs would distinguish explanations, computed before they are recorded.

A run is simulated with one explanation; another one, refitted to it, leaves d. Its cost is computed as a diagnosis
will: with the robust likelihood of each equation (`expected_cost`), the parameters and tolerances refitted under their
posterior from the earlier logs, and with or without an inexact form of its effects,

.. math:: L_j(d) = \min_x \sum_e \bar\rho_e(d + A_j x) + \tfrac{1}{2} x^\top \Lambda_j x, \qquad
    D_{ij}(\theta) = L_j(r_j - r_i(\theta)) - L_i(r_i - r_i(\theta))

with r the residuals, A their sensitivities to parameters, tolerances and form, and Λ the posterior precision of the
earlier logs. The difference is between refitted models, as in T-optimality (Atkinson & Fedorov). The truth is not
the best fit of the earlier logs: its parameters θ are drawn from their posterior. The evidence also includes the price
of parameters that the run determines (`Known.price`).

Runs are chosen by their expected information about which explanation is true (Lindley; Box & Hill bound the same for
two models at a time):

.. math:: I = \sum_i \pi_i \, \mathrm E_{\theta, \xi}\Big[\log \frac{p_i}{\pi_i}\Big], \qquad
    \frac{p_j}{p_i} = \frac{\pi_j}{\pi_i} \exp\Big(-\frac{D_{ij} + \sqrt{2 |D_{ij}|} \xi}{\tau}\Big)

with ξ the noise of a recording, and τ the difference in score that the form of an explanation is worth.

References
----------
D. V. Lindley, "On a measure of the information provided by an experiment", Annals of Mathematical Statistics 27(4),
1956. https://doi.org/10.1214/aoms/1177728069

G. E. P. Box, W. J. Hill, "Discrimination among mechanistic models", Technometrics 9(1), 1967.
https://doi.org/10.1080/00401706.1967.10490441

A. C. Atkinson, V. V. Fedorov, "The design of experiments for discriminating between two rival models", Biometrika
62(1), 1975. https://doi.org/10.1093/biomet/62.1.57
"""

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from ..settings import CLASS, FORM_SMOOTH, INCLUDED
from .expected_cost import counts_for, expected_cost
from .known import Known, cleaned, form_of, informed, residuals, scaled, sensitivities

HELD = 1.0 - INCLUDED
"""Least probability of an explanation: those that are kept are not ruled out."""
ROUNDS = 3
"""Rounds of refitting a rival, each window weighted by its residual there."""
NOISE = np.array([-1.0, 0.0, 1.0]) * np.sqrt(3.0), np.array([1.0, 4.0, 1.0]) / 6.0
"""Nodes of the noise of a recording, and their weights."""


class Discrimination:
    """What each run of a simulated log says about each pair of explanations."""

    def __init__(self, trial: Any, known: Sequence[Known], forms: bool = True) -> None:
        self.trial, self.known, self.m, self.forms = trial, list(known), len(known), forms
        self.runs = trial.trajectories
        self._rows: dict[tuple[int, tuple[int, ...]], np.ndarray] = {}
        self._places: dict[tuple[int, ...], tuple[np.ndarray, list[slice]]] = {}
        self._prices: dict[tuple[int, tuple[int, ...]], float] = {}
        self.residuals, self.columns, self.smooth, self.widths, self.truths = [], [], [], [], []
        clean = cleaned(trial, apart=True)
        for k in self.known:
            residual, columns = map(clean, sensitivities(trial, k.fit))
            S, width = form_of(trial, k.fit) if forms else (np.zeros((len(residual), 0)), np.ones(len(residual)))
            if forms:
                others = [clean(residuals(trial, d)) - residual for d, _ in k.draws]
            else:
                others = [columns @ k.step_to(d) for d, _ in k.draws]
            self.residuals.append(residual)
            self.columns.append(columns)
            self.smooth.append(clean(S))
            self.widths.append(width)
            self.truths.append(np.column_stack([np.zeros(len(residual)), *others]))

    # --- pairs of explanations ------------------------------------------------------------------------------
    def between(self, chosen: Sequence[int]) -> np.ndarray:
        """Return the expected difference in log-likelihood between explanations after some of the runs together."""
        return np.asarray(self.outlook(chosen)[:, :, 0])

    def outlook(self, chosen: Sequence[int]) -> np.ndarray:
        """Return the differences for each draw of the truth, shape (n_explanations, n_explanations, n)."""
        return np.array([self.row(i, chosen) for i in range(self.m)])

    def row(self, i: int, chosen: Sequence[int]) -> np.ndarray:
        """Return the differences where one explanation is true, shape (n_explanations, n_draws)."""
        key = (i, tuple(chosen))
        if key not in self._rows:
            dearer = np.array([self._dearer(k, chosen) for k in range(self.m)])
            each = np.array([self._refitted(i, j, chosen)[0] for j in range(self.m)])
            # The truth may return to its own values: a tangent holds for small steps only.
            own = np.minimum(each[i], [0.0, *(lost for _, lost in self.known[i].draws)])
            found = each - own + (dearer - dearer[i])[:, None]
            found[i] = 0.0
            self._rows[key] = found
        return self._rows[key]

    def _windows(self, chosen: Sequence[int]) -> tuple[np.ndarray, list[slice]]:
        """Return the windows of some of the runs, and where each equation's stand among them."""
        key = tuple(chosen)
        if key not in self._places:
            there, ends = np.isin(self.trial.block, list(chosen)), [0]
            for part in self.trial.parts:
                ends.append(ends[-1] + int(there[part].sum()))
            self._places[key] = np.flatnonzero(there), [slice(a, b) for a, b in pairwise(ends)]
        return self._places[key]

    def _refitted(self, i: int, j: int, chosen: Sequence[int]) -> tuple[np.ndarray, np.ndarray]:
        """Refit an explanation to what some of the runs show where another is true."""
        rows, parts = self._windows(chosen)
        d = (self.residuals[j] - self.residuals[i])[rows, None] - self.truths[i][rows]
        known, A = self.known[j], self.columns[j][rows]
        cost, left = self._cost(d, A, known.held, np.ones(len(rows)), known.windows, parts)
        if self.forms and self.smooth[j].shape[1]:
            B = np.column_stack([A, self.smooth[j][rows]])
            P = np.zeros((B.shape[1], B.shape[1]))
            P[: A.shape[1], : A.shape[1]] = known.held
            P[A.shape[1] :, A.shape[1] :] = np.eye(B.shape[1] - A.shape[1]) / FORM_SMOOTH**2
            loose, other = self._cost(d, B, P, self.widths[j][rows], known.windows, parts, A.shape[1])
            left = other if loose[0] < cost[0] else left
            cost = np.minimum(cost, loose)
        return cost, np.array([np.sqrt(np.mean(np.square(left[p]))) if p.stop > p.start else 0.0 for p in parts])

    @staticmethod
    def _cost(
        d: np.ndarray, A: np.ndarray, P: np.ndarray, width: np.ndarray, earlier: float, parts: Sequence[slice],
        exact: int | None = None,
    ) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
        """Return the least cost over the coefficients of some columns, and the residual of the first draw."""
        d, A = d / width[:, None], A / width[:, None]
        share = earlier / max(len(d), 1)
        scale, left = np.ones(len(d)), np.zeros(len(d))
        for turn in range(ROUNDS):
            # The first round trusts every window: what is far off there may be explained by the columns.
            w = counts_for(left, scale)
            Aw = A * w[:, None]
            H = A.T @ Aw + P
            C, size = scaled(H)
            x = -np.linalg.solve(C, (Aw.T @ d) / size[:, None]) / size[:, None]
            rest = d + A @ x
            left = np.sqrt(np.mean(np.square(rest), axis=1))
            if turn < ROUNDS - 1:
                for part in parts:
                    s = expected_cost(left[part, None], share * (part.stop - part.start))[1]
                    scale[part] = float(s[0])
        cost = 0.5 * np.einsum("ij,ij->j", x, P @ x)
        for part in parts:
            cost = cost + expected_cost(rest[part], share * (part.stop - part.start))[0]
        if exact is not None:
            form = H[exact:, exact:] * FORM_SMOOTH**2  # includes its prior
            cost = cost + 0.5 * float(np.linalg.slogdet(form)[1])
        return cost + float(np.log(width).sum()), rest[:, 0]

    def largest(self, i: int, j: int, chosen: Sequence[int]) -> tuple[int, float]:
        """Return the equation of an explanation's largest error where another is true, and its size over the noise."""
        size = np.hypot(1.0, self._refitted(i, j, chosen)[1])
        place = int(np.argmax(size))
        return place, float(size[place])

    # --- parameters -----------------------------------------------------------------------------------------
    def _precision(self, which: int, chosen: Sequence[int]) -> np.ndarray:
        """Return the precision of the tolerances and parameters of an explanation after some of the runs."""
        rows = self._windows(chosen)[0]
        A, S, width = self.columns[which][rows], self.smooth[which][rows], self.widths[which][rows]
        return self.known[which].precision + informed(A, S, 1.0 / np.square(width))

    def _dearer(self, which: int, chosen: Sequence[int]) -> float:
        """Return by how much the parameters of an explanation cost more after some of the runs."""
        k, key = self.known[which], (which, tuple(chosen))
        if key not in self._prices:
            more = len(self._windows(chosen)[0])
            after = k.price(self._precision(which, chosen), k.windows + more) if k.fit.spec else 0.0
            self._prices[key] = after - k.price(k.precision, k.windows)
        return self._prices[key]

    def deviations(self, chosen: Sequence[int], which: int = 0) -> dict[str, float]:
        """Return the standard deviations of an explanation's parameters after some of the runs, by effect and name."""
        k = self.known[which]
        H = self._precision(which, chosen) + k.held - k.precision
        C, size = scaled(H)
        error = np.sqrt(np.maximum(np.diag(np.linalg.pinv(C)), 0.0)) / size
        m = len(k.fit.x)
        return {f"{name}.{p.name}": float(error[m + q]) for q, (name, p) in enumerate(k.slots)}

    def information(self, chosen: Sequence[int], which: int = 0) -> float:
        """Return the logarithm of the determinant of an explanation's parameters' precision after some of the runs."""
        k = self.known[which]
        H, m = self._precision(which, chosen) + k.held - k.precision, len(k.fit.x)
        if len(H) == m:
            return 0.0
        return float(np.linalg.slogdet(k.curvature(H))[1])


def shown(outlook: np.ndarray) -> float:
    """Return the criterion of runs where the first explanation is no effect."""
    even = np.array([0.5, 0.5])
    pairs = [np.array([[np.zeros_like(d), d], [d, np.zeros_like(d)]]) for d in outlook[1:, 0]]
    return sum((gained(pair, even) for pair in pairs), 0.0)


def gained(outlook: np.ndarray, beliefs: np.ndarray) -> float:
    """Return the information that runs are expected to give about which explanation is true."""
    pi = np.maximum(beliefs, HELD)
    pi = pi / pi.sum()
    nodes, weights = NOISE
    llr = (outlook[..., None] + np.sqrt(2.0 * np.abs(outlook))[..., None] * nodes) / CLASS  # true, rival, draw, noise
    odds = np.log(pi)[None, :, None, None] - llr
    top = odds.max(axis=1, keepdims=True)
    total = (top + np.log(np.exp(odds - top).sum(axis=1, keepdims=True)))[:, 0]
    own = np.array([odds[i, i] for i in range(len(pi))])
    told = ((own - total) @ weights).mean(axis=1)  # expected logarithm of the belief in what is true
    return float(pi @ (told - np.log(pi)))


def right_first(outlook: np.ndarray, beliefs: np.ndarray) -> float:
    """Return the probability that the explanation that is true comes out first after runs."""
    from scipy.special import ndtr

    pi = np.maximum(beliefs, HELD)
    pi = pi / pi.sum()
    ahead = np.log(pi[:, None] / pi[None, :])[:, :, None] + outlook
    share = ndtr(ahead / np.sqrt(2.0 * np.abs(outlook) + CLASS**2))
    share[np.arange(len(pi)), np.arange(len(pi))] = 1.0
    return float(pi @ share.min(axis=1).mean(axis=1))
