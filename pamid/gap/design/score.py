r"""How clearly runs would tell explanations apart, before they are recorded.

A run is simulated with one explanation; another one, refitted to what it would then see, leaves d. Beside what the
earlier logs say of its parameters, the expected difference in log-likelihood is

.. math:: D_{ij} = \min_x \sum_e \tfrac{n_e}{2} \log\Big(1 + \frac{\|d_e + A_e x\|^2}{n_e}\Big)
    + \tfrac{1}{2} x^\top \Lambda_j x

with d the difference of their residuals in units of noise and model discrepancy, A what the rival's parameters, the
tolerances and the inexactness of its form can do, and Λ the posterior precision of the earlier logs: the
Kullback–Leibler divergence between refitted models, of which T-optimality takes the smallest (Atkinson & Fedorov).
Each equation has a scale of its own, so that what is far off counts by its logarithm. Several rivals are judged
together by the bound on the probability of a wrong choice,

.. math:: P_\text{wrong} \le \sum_{i<j} \sqrt{\pi_i \pi_j}\, e^{-D_{ij}/4}.

References
----------
G. E. P. Box, W. J. Hill, "Discrimination among mechanistic models", Technometrics 9(1), 1967.
https://doi.org/10.1080/00401706.1967.10490441

A. C. Atkinson, V. V. Fedorov, "The design of experiments for discriminating between two rival models", Biometrika
62(1), 1975. https://doi.org/10.1093/biomet/62.1.57

T. Kailath, "The divergence and Bhattacharyya distance measures in signal selection", IEEE Transactions on Communication
Technology 15(1), 1967. https://doi.org/10.1109/TCOM.1967.1089532
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ..inference.discrepancy import Discrepancy
from ..inference.gauss_newton import Fit, Fitter, slots_of
from ..residuals.bench import Evidence
from ..settings import FORM_SMOOTH, TOLERANCE

HELD = 0.05
"""Least belief that an explanation counts with: those that are kept are not out of the question."""
ROUNDS = 4
"""Rounds in which a rival is refitted, each equation weighed by the scale of what it leaves there."""


@dataclass(frozen=True)
class Known:
    """An explanation with what the earlier logs say of its parameters.

    Parameters
    ----------
    fit : Fit
        Its effects and deviations of the tolerances.
    precision : array, shape (n_free + n_parameters, n_free + n_parameters)
        Posterior precision of the tolerances and its effects' parameters.
    belief : float
        Probability.
    """

    fit: Fit
    precision: np.ndarray
    belief: float

    @property
    def names(self) -> tuple[str, ...]:
        """Its effects."""
        return tuple(self.fit.spec)


def sensitivities(evidence: Evidence, fit: Fit) -> tuple[np.ndarray, np.ndarray]:
    """Return the residuals of an explanation on a log, and what tolerances and its parameters do to them."""
    slots = slots_of(fit.spec)
    z = evidence.tangent(fit.spec, fit.x)
    if not slots:
        return z + evidence.J @ fit.x, evidence.J
    phi = np.array([fit.spec[name][p.name] for name, p in slots])
    D, _, _ = Fitter(evidence).jacobian(slots, phi, z, fit.x)
    return z + evidence.J @ fit.x, np.column_stack([evidence.J, D])


def precision(logs: Sequence[Evidence], fit: Fit) -> np.ndarray:
    """Return the posterior precision of an explanation's parameters after logs, what its form may do left free.

    Parameters
    ----------
    logs : sequence of Evidence
        The logs.
    fit : Fit
        The explanation.
    """
    m = logs[0].J.shape[1]
    total = np.diag(np.concatenate([np.full(m, TOLERANCE), np.zeros(len(slots_of(fit.spec)))]))
    for log in logs:
        z, A = sensitivities(log, fit)
        S, width = _form(log, fit)
        weight = 1.0 / np.square(width * _scales(log, z / width))
        Aw = A * weight[:, None]
        H = A.T @ Aw
        if S.shape[1]:
            cross = S.T @ Aw
            H -= cross.T @ np.linalg.solve(S.T @ (S * weight[:, None]) + np.eye(S.shape[1]) / FORM_SMOOTH**2, cross)
        total = total + H
    return total


def _scales(log: Evidence, z: np.ndarray) -> np.ndarray:
    """Return the scale of each window's equation, at least 1."""
    out = np.ones(len(z))
    for part in log.parts:
        out[part] = max(1.0, float(np.sqrt(np.mean(np.square(z[part]))))) if part.stop > part.start else 1.0
    return out


def _form(log: Evidence, fit: Fit) -> tuple[np.ndarray, np.ndarray]:
    """Return the columns of an explanation's inexact form, and the standard deviation of each window with it."""
    if not fit.spec:
        return np.zeros((len(log.z0), 0)), np.ones(len(log.z0))
    discrepancy = Discrepancy(log)
    width = discrepancy.width(fit)
    return discrepancy.columns(fit), np.ones(len(log.z0)) if width is None else width


class Discrimination:
    """What each run of a simulated log says about each pair of explanations.

    Parameters
    ----------
    trial : Evidence
        The log, one trajectory a run.
    known : sequence of Known
        The explanations.
    forms : bool, default=True
        Whether the inexactness of forms is counted: without it a preview, which says too much.
    """

    def __init__(self, trial: Evidence, known: Sequence[Known], forms: bool = True) -> None:
        self.known, self.m = list(known), len(known)
        self.runs = trial.trajectories
        slices = [_rows(trial.block[part], part.start, len(self.runs)) for part in trial.parts]
        self.n = np.array([[s.stop - s.start for s in rows] for rows in slices], dtype=float)  # equation, run
        residuals, columns = zip(*(sensitivities(trial, k.fit) for k in self.known), strict=True)
        self.G: list[np.ndarray] = []
        self.b: list[list[np.ndarray | None]] = []
        self.dd: list[list[np.ndarray | None]] = []
        self.prior: list[np.ndarray] = []
        for j, k in enumerate(self.known):
            S, width = _form(trial, k.fit) if forms else (np.zeros((len(trial.z0), 0)), np.ones(len(trial.z0)))
            B = np.column_stack([columns[j], S]) / width[:, None]
            q = S.shape[1]
            P = np.zeros((B.shape[1], B.shape[1]))
            P[: B.shape[1] - q, : B.shape[1] - q] = k.precision
            P[B.shape[1] - q :, B.shape[1] - q :] = np.eye(q) / FORM_SMOOTH**2
            self.prior.append(P)
            self.G.append(np.array([[B[s].T @ B[s] for s in rows] for rows in slices]))
            d = [None if i == j else (residuals[j] - residuals[i]) / width for i in range(self.m)]
            self.b.append(
                [None if v is None else np.array([[B[s].T @ v[s] for s in rows] for rows in slices]) for v in d]
            )
            self.dd.append(
                [None if v is None else np.array([[v[s] @ v[s] for s in rows] for rows in slices]) for v in d]
            )

    def between(self, chosen: Sequence[int]) -> np.ndarray:
        """Return the expected difference in log-likelihood between explanations after some of the runs together.

        Parameters
        ----------
        chosen : sequence of int
            Places of the runs.

        Returns
        -------
        array, shape (n_explanations, n_explanations)
            Row: the one that is true; column: the one that is refitted.
        """
        out = np.zeros((self.m, self.m))
        for i in range(self.m):
            for j in range(self.m):
                if i != j:
                    x, left, n = self._refitted(i, j, chosen)
                    out[i, j] = float(0.5 * n @ np.log1p(left / n) + 0.5 * x @ self.prior[j] @ x)
        return out

    def _refitted(self, i: int, j: int, chosen: Sequence[int]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Refit an explanation to what some of the runs show where another is true.

        Returns
        -------
        tuple of array
            Its coefficients, the sum of squares that it leaves in each equation, and the windows of each.
        """
        at, b, dd = list(chosen), self.b[j][i], self.dd[j][i]
        assert b is not None and dd is not None
        G, bi, ddi = (v[:, at].sum(axis=1) for v in (self.G[j], b, dd))
        n = np.maximum(self.n[:, at].sum(axis=1), 1.0)
        scale2, x, left = np.ones(len(n)), np.zeros(G.shape[1]), ddi
        for _ in range(ROUNDS):
            H = np.tensordot(1.0 / scale2, G, 1) + self.prior[j]
            size = np.sqrt(np.maximum(np.diag(H), 1e-300))
            C = H / np.outer(size, size) + 1e-9 * np.eye(len(size))
            x = -np.linalg.solve(C, (bi / scale2[:, None]).sum(axis=0) / size) / size
            left = np.maximum(ddi + 2.0 * bi @ x + np.einsum("i,eij,j->e", x, G, x), 0.0)
            scale2 = 1.0 + left / n
        return x, left, n

    def largest(self, i: int, j: int, chosen: Sequence[int]) -> tuple[int, float]:
        """Return the equation in which an explanation is furthest off where another is true, and how far, in noise."""
        _, left, n = self._refitted(i, j, chosen)
        size = np.sqrt(1.0 + left / n)
        place = int(np.argmax(size))
        return place, float(size[place])

    def deviations(self, chosen: Sequence[int], which: int = 0) -> dict[str, float]:
        """Return the standard deviations of an explanation's parameters after some of the runs, by effect and name."""
        k = self.known[which]
        H = self.G[which][:, list(chosen)].sum(axis=(0, 1)) + self.prior[which]
        size = np.sqrt(np.maximum(np.diag(H), 1e-300))
        covariance = np.linalg.pinv(H / np.outer(size, size) + 1e-9 * np.eye(len(H)))
        error = np.sqrt(np.maximum(np.diag(covariance), 0.0)) / size
        m = len(k.fit.x)
        return {f"{name}.{p.name}": float(error[m + q]) for q, (name, p) in enumerate(slots_of(k.fit.spec))}

    def information(self, chosen: Sequence[int], which: int = 0) -> float:
        """Return the logarithm of the determinant of an explanation's parameters' precision after some of the runs."""
        k = self.known[which]
        m = len(k.fit.x)
        H = self.G[which][:, list(chosen)].sum(axis=(0, 1)) + self.prior[which]
        keep = np.arange(m, len(k.precision))
        if not len(keep):
            return 0.0
        rest = np.setdiff1d(np.arange(len(H)), keep)
        size = np.sqrt(np.maximum(np.diag(H), 1e-300))
        C = H / np.outer(size, size) + 1e-9 * np.eye(len(H))
        schur = C[np.ix_(keep, keep)] - C[np.ix_(keep, rest)] @ np.linalg.solve(
            C[np.ix_(rest, rest)], C[np.ix_(rest, keep)]
        )
        return float(np.linalg.slogdet(schur)[1] + 2.0 * np.sum(np.log(size[keep])))


def clarity(between: np.ndarray, beliefs: np.ndarray) -> float:
    """Return what runs are chosen by: how clearly they would tell explanations apart, in nats.

    It is −4 times the logarithm of the bound on the probability of a wrong choice: the expected difference in
    log-likelihood of the pair that is hardest to tell apart, or a little less where several are as hard.

    Parameters
    ----------
    between : array, shape (n, n)
        Expected differences in log-likelihood.
    beliefs : array, shape (n,)
        Probabilities of the explanations.
    """
    i, j = np.triu_indices(len(beliefs), 1)
    if not len(i):
        return 0.0
    D = 0.5 * (between[i, j] + between[j, i])
    pi = np.maximum(beliefs, HELD)
    pi = pi / pi.sum()
    weight = 0.5 * np.log(pi[i] * pi[j])
    top = np.max(weight - D / 4.0)
    return float(-4.0 * (top + np.log(np.sum(np.exp(weight - D / 4.0 - top)))))


def _rows(block: np.ndarray, first: int, n: int) -> list[slice]:
    """Return the windows of each run within an equation, whose runs stand one after another."""
    ends = np.searchsorted(block, np.arange(n + 1))
    return [slice(first + int(a), first + int(b)) for a, b in pairwise(ends)]
