r"""How clearly runs would distinguish explanations, before they are recorded.

A run is simulated with one explanation; another one, refitted to what it would then see, leaves d. Beside what the
earlier logs say of its parameters, the expected difference in log-likelihood is

.. math:: D_{ij} = \min_x \sum_e \tfrac{n_e}{2} \log\Big(1 + \frac{\|d_e + A_e x\|^2}{n_e}\Big)
    + \tfrac{1}{2} x^\top \Lambda_j x

with d the difference of their residuals in units of noise and model discrepancy, A what the rival's parameters, the
tolerances and the inexactness of its form can do, and Λ the posterior precision of the earlier logs: the
Kullback–Leibler divergence between refitted models, of which T-optimality takes the smallest (Atkinson & Fedorov).
Each equation has a scale of its own, so that what is far off counts by its logarithm. To the evidence also goes what
parameters cost that the run determines (`price`): with it a simple explanation gains on one that holds it as a special
case. Several rivals are judged together by the bound on the probability of a wrong choice,

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

from ...effects import Parameter
from ..inference.discrepancy import Discrepancy
from ..inference.gauss_newton import Fit, Fitter, slots_of
from ..inference.occam import occam_of, possible
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
    windows : int, default=0
        Windows of the earlier logs.
    """

    fit: Fit
    precision: np.ndarray
    belief: float
    windows: int = 0

    @property
    def names(self) -> tuple[str, ...]:
        """Its effects."""
        return tuple(self.fit.spec)

    def curvature(self, H: np.ndarray) -> np.ndarray:
        """Return what is known of the effects' parameters where that of all coefficients is H."""
        m = len(self.fit.x)
        keep = np.arange(m, len(self.precision))
        rest = np.setdiff1d(np.arange(len(H)), keep)
        size = np.sqrt(np.maximum(np.diag(H), 1e-300))
        C = H / np.outer(size, size) + 1e-9 * np.eye(len(H))
        schur = C[np.ix_(keep, keep)] - C[np.ix_(keep, rest)] @ np.linalg.solve(
            C[np.ix_(rest, rest)], C[np.ix_(rest, keep)]
        )
        return np.asarray(schur * np.outer(size[keep], size[keep]))

    def each(self) -> list[tuple[list[int], list[Parameter], list[float]]]:
        """Return for each effect the places, parameters and values of its parameters."""
        slots = slots_of(self.fit.spec)
        mine = [[q for q, (n, _) in enumerate(slots) if n == name] for name in self.fit.spec]
        return [
            (at, [slots[q][1] for q in at], [self.fit.spec[slots[q][0]][slots[q][1].name] for q in at]) for at in mine
        ]

    def price(self, H: np.ndarray, windows: float) -> float:
        """Return what the parameters cost in evidence where the precision of all coefficients is H."""
        if not self.fit.spec:
            return 0.0
        known = self.curvature(H)
        return sum(
            occam_of(
                known[np.ix_(at, at)], windows, parameters, values, _gain(known[np.ix_(at, at)], parameters, values)
            )
            for at, parameters, values in self.each()
        )

    @property
    def reach(self) -> np.ndarray:
        """How far tolerances and parameters were thought possible to be from their values; tolerances have a prior."""
        out = np.full(len(self.precision), np.inf)
        if self.fit.spec:
            m, known = len(self.fit.x), self.curvature(self.precision)
            for at, parameters, values in self.each():
                mine = known[np.ix_(at, at)]
                out[m + np.array(at)] = possible(mine, parameters, values, _gain(mine, parameters, values))
        return np.maximum(out, 1e-12)

    @property
    def held(self) -> np.ndarray:
        """The precision with which the explanation is refitted: nonlinear parameters no further than they reach."""
        linear = np.array([p.linear for _, p in slots_of(self.fit.spec)], dtype=bool)
        free = np.concatenate([np.ones(len(self.fit.x), dtype=bool), linear])
        return np.asarray(self.precision + np.diag(np.where(free, 0.0, self.reach**-2.0)))


def _gain(known: np.ndarray, parameters: Sequence[Parameter], values: Sequence[float]) -> float:
    """Return what an effect explains: that of its amplitudes, in which it is linear."""
    a = np.array([v if p.linear else 0.0 for p, v in zip(parameters, values, strict=True)])
    return 0.5 * float(a @ known @ a)


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
        Whether the form of a rival may be inexact, at its cost, as the diagnosis allows: without it a preview, which
        says too much.
    """

    def __init__(self, trial: Evidence, known: Sequence[Known], forms: bool = True) -> None:
        self._read(trial, known, [sensitivities(trial, k.fit) for k in known], forms)

    def _read(
        self, trial: Evidence, known: Sequence[Known], each: Sequence[tuple[np.ndarray, np.ndarray]], forms: bool
    ) -> None:
        self.known, self.m = list(known), len(known)
        self.exact: Discrimination | None = None
        if forms:
            self.exact = Discrimination.__new__(Discrimination)
            self.exact._read(trial, known, each, False)
        self.runs = trial.trajectories
        slices = [_rows(trial.block[part], part.start, len(self.runs)) for part in trial.parts]
        self.n = np.array([[s.stop - s.start for s in rows] for rows in slices], dtype=float)  # equation, run
        residuals, columns = zip(*each, strict=True)
        self.G: list[np.ndarray] = []
        self.b: list[list[np.ndarray]] = []
        self.dd: list[list[np.ndarray]] = []
        self.prior: list[np.ndarray] = []
        self.wider: list[np.ndarray] = []
        for j, k in enumerate(self.known):
            S, width = _form(trial, k.fit) if forms else (np.zeros((len(trial.z0), 0)), np.ones(len(trial.z0)))
            B = np.column_stack([columns[j], S]) / width[:, None]
            q = S.shape[1]
            self.wider.append(
                np.array([sum(float(np.log(width[rows[k]]).sum()) for rows in slices) for k in range(len(self.runs))])
            )
            P = np.zeros((B.shape[1], B.shape[1]))
            P[: B.shape[1] - q, : B.shape[1] - q] = k.held
            P[B.shape[1] - q :, B.shape[1] - q :] = np.eye(q) / FORM_SMOOTH**2
            self.prior.append(P)
            self.G.append(np.array([[B[s].T @ B[s] for s in rows] for rows in slices]))
            d = [(residuals[j] - residuals[i]) / width for i in range(self.m)]
            self.b.append([np.array([[B[s].T @ v[s] for s in rows] for rows in slices]) for v in d])
            self.dd.append([np.array([[v[s] @ v[s] for s in rows] for rows in slices]) for v in d])

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
        dearer = np.array([self._dearer(k, chosen) for k in range(self.m)])
        return np.asarray(self._losses(chosen) + dearer[None, :] - dearer[:, None])

    def _losses(self, chosen: Sequence[int]) -> np.ndarray:
        """Return the log-likelihood that each explanation, column, is expected to lose where one, row, is true."""
        out = np.zeros((self.m, self.m))
        for i in range(self.m):
            for j in range(self.m):
                if i != j:
                    cost, left, n = self._refitted(i, j, chosen)
                    out[i, j] = float(0.5 * n @ np.log1p(left / n) + cost)
        return out if self.exact is None else np.minimum(out, self.exact._losses(chosen))

    def _dearer(self, which: int, chosen: Sequence[int]) -> float:
        """Return by how much the parameters of an explanation cost more after some of the runs."""
        k, at = self.known[which], list(chosen)
        H = self.G[which][:, at].sum(axis=(0, 1)) + self.prior[which]
        inner = slice(0, len(k.precision))
        H[inner, inner] += k.precision - k.held  # what was thought possible is counted by the price
        return k.price(H, k.windows + self.n[:, at].sum()) - k.price(k.precision, k.windows)

    def _refitted(self, i: int, j: int, chosen: Sequence[int]) -> tuple[float, np.ndarray, np.ndarray]:
        """Refit an explanation to what some of the runs show where another is true.

        Returns
        -------
        cost : float
            What its coefficients and the inexactness of its form cost.
        left, windows : array, shape (n_equations,)
            The sum of squares that it leaves in each equation, and the windows of each.
        """
        at, P = list(chosen), self.prior[j]
        G, bi, ddi = (v[:, at].sum(axis=1) for v in (self.G[j], self.b[j][i], self.dd[j][i]))
        n = np.maximum(self.n[:, at].sum(axis=1), 1.0)
        scale2, x, left = np.ones(len(n)), np.zeros(len(P)), ddi
        for _ in range(ROUNDS):
            H = np.tensordot(1.0 / scale2, G, 1) + P
            size = np.sqrt(np.maximum(np.diag(H), 1e-300))
            C = H / np.outer(size, size) + 1e-9 * np.eye(len(size))
            x = -np.linalg.solve(C, (bi / scale2[:, None]).sum(axis=0) / size) / size
            left = np.maximum(ddi + 2.0 * bi @ x + np.einsum("i,eij,j->e", x, G, x), 0.0)
            scale2 = 1.0 + left / n
        cost = 0.5 * float(x @ P @ x)
        free = slice(len(self.known[j].precision), None)
        form = np.tensordot(1.0 / scale2, G, 1)[free, free] * FORM_SMOOTH**2
        cost += 0.5 * float(np.linalg.slogdet(np.eye(len(form)) + form)[1]) + float(self.wider[j][at].sum())
        return cost, left, n

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
        if len(k.precision) == m:
            return 0.0
        return float(np.linalg.slogdet(k.curvature(H))[1])


def clarity(between: np.ndarray, beliefs: np.ndarray) -> float:
    """Return what runs are chosen by: how clearly they would distinguish explanations, in nats.

    It is −4 times the logarithm of the bound on the probability of a wrong choice: the expected difference in
    log-likelihood of the pair that is hardest to distinguish, or a little less where several are as hard.

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
