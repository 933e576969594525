r"""Fit what names are trusted by: weights of the signs of a cause beyond the library, and the bar they must pass.

Causes of the development cases are named however little is to be trusted in them. A logistic regression, whose weights
may only speak against a name, says how likely a cause is to be right from its signs, on any log, whether anyone could
tell or not. Every probability that the bar is set by comes from a fit without the cases of the same effects. The bar is
the lowest at which

.. math:: (\text{wrong names that pass} + 1) / (\text{names that pass}) \le \alpha

with cases weighted such that one gap in five has a cause outside the library. As conformal selection has it, of the
names said on new cases of that mixture at most α are expected to be wrong. Cases that even the oracle cannot decide do
not count for the bar.

References
----------
Y. Jin, E. J. Candès, "Selection by prediction with conformal p-values", Journal of Machine Learning Research 24, 2023.

A. N. Angelopoulos et al., "Conformal risk control", ICLR 2024. https://doi.org/10.48550/arXiv.2208.02814
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import minimize

from .oracle import decidable

ALPHA = 0.05
"""Share of wrong answers among those named."""
BEYOND = 0.2
"""Share of gaps whose cause the library does not hold."""
RIDGE = 0.5
"""Precision of the weights' prior about 0."""
COMMON = ("elsewhere",)
"""Signs of the log and of no cause in it: what a second cause leaves elsewhere weighs no more against one alone."""
MODULE = '''"""What names are trusted by: written by ``python benchmarks/withheld --develop --write``, not by hand."""

from __future__ import annotations

ALONE = {{
{alone}}}
"""Weights of the signs of a cause outside the library, see `pamid.gap.diagnosis.signs`, for one that explains alone."""
BESIDE = {{
{beside}}}
"""The same for causes that explain together."""
TRUSTED = 0.5
"""Estimated probability from which a name is reported."""
SURE = {bar:.2f}
"""Probability from which at most one name in twenty is wrong, where one gap in five has a cause outside the library."""
'''


class Told(NamedTuple):
    """One cause that a case was given.

    Parameters
    ----------
    result : mapping
        The case.
    signs : dict of str to float
        The signs of the cause.
    right : bool
        Whether one of its names is a true effect of the library.
    decidable : bool
        Whether the oracle tells the true cause from others on this log.
    alone : bool
        Whether nothing else was named.
    """

    result: Mapping[str, Any]
    signs: dict[str, float]
    right: bool
    decidable: bool
    alone: bool

    @property
    def suite(self) -> str:
        """Suite of the case."""
        return str(self.result["key"]["suite"])


def told(results: Sequence[Mapping[str, Any]]) -> list[Told]:
    """Return the causes of the cases in which something was named."""
    known = decidable(results)
    found = []
    for r in results:
        causes = r.get("diagnosis", {}).get("causes", [])
        rest = r["name"] in known, len(causes) == 1
        found += [Told(r, c["signs"], bool({*c["effects"]} & _true(r)), *rest) for c in causes if c["signs"]]
    return found


def _true(result: Mapping[str, Any]) -> set[str]:
    """Return the true effects of a case that the library holds."""
    return set() if result["key"]["suite"] == "off-library" else set(result["key"]["effects"])


def design(causes: Sequence[Told], names: Sequence[str]) -> np.ndarray:
    """Return the signs of causes, one row each: a one and those of a cause alone, the same beside others, the log's."""
    own = [[1.0, *(c.signs[n] for n in names if n not in COMMON)] for c in causes]
    none = [0.0] * len(own[0])
    common = [[c.signs[n] for n in names if n in COMMON] for c in causes]
    rows = zip(causes, own, common, strict=True)
    return np.array([[*signs, *none, *rest] if c.alone else [*none, *signs, *rest] for c, signs, rest in rows])


def fitted(S: np.ndarray, y: np.ndarray, free: Sequence[int] = (0,)) -> np.ndarray:
    """Return the weights of a logistic regression; none but the constants, in columns ``free``, is above zero."""
    ridge = np.where(np.isin(np.arange(S.shape[1]), free), 0.0, RIDGE)

    def cost(w: np.ndarray) -> tuple[float, np.ndarray]:
        score = S @ w
        slope = 1.0 / (1.0 + np.exp(-score)) - y
        value = float(np.sum(np.logaddexp(0.0, score) - y * score)) + 0.5 * float(ridge @ w**2)
        return value, S.T @ slope + ridge * w

    bounds = [(None, None if k in free else 0.0) for k in range(S.shape[1])]
    return np.asarray(minimize(cost, np.zeros(S.shape[1]), jac=True, method="L-BFGS-B", bounds=bounds).x)


def held_out(S: np.ndarray, y: np.ndarray, groups: Sequence[str], free: Sequence[int], folds: int = 10) -> np.ndarray:
    """Return the probability of each cause by a fit without those of its fold; cases of one effect are one group."""
    names = {name: k % folds for k, name in enumerate(sorted(set(groups)))}
    fold = np.array([names[g] for g in groups])
    out = np.empty(len(y))
    for k in range(folds):
        out[fold == k] = 1.0 / (1.0 + np.exp(-S[fold == k] @ fitted(S[fold != k], y[fold != k], free)))
    return out


def weight_beyond(results: Sequence[Mapping[str, Any]]) -> float:
    """Return what a case beyond the library counts for, one in it counting 1, such that its share of all gaps is right.

    Gaps count that can be decided, whether something was named or not: of those that were named fewer are beyond it.
    """
    known = decidable(results)
    gaps = [r["key"]["suite"] for r in results if r["name"] in known and r["key"]["suite"] != "none"]
    beyond = gaps.count("off-library")
    return BEYOND / (1.0 - BEYOND) * (len(gaps) - beyond) / max(beyond, 1)


def bar(p: np.ndarray, y: np.ndarray, weight: np.ndarray, alpha: float = ALPHA) -> float:
    """Return the lowest probability at which the bound holds; 1 where it never does."""
    order = np.argsort(-p, kind="stable")
    passing, wrong = np.cumsum(weight[order]), np.cumsum(weight[order] * ~y[order])
    holds = (wrong + 1.0) / passing <= alpha
    return float(p[order][np.flatnonzero(holds)[-1]]) if holds.any() else 1.0


def report(results: Sequence[Mapping[str, Any]], module: Path | None = None) -> str:
    """Fit weights and bar to the causes of `told`, write them as a module if one is named; return them as text."""
    causes = told(results)
    names = sorted(causes[0].signs)
    S, y = design(causes, names), np.array([c.right for c in causes])
    suite = np.array([c.suite for c in causes])
    known = np.array([c.decidable for c in causes])
    weight = np.where(suite == "off-library", weight_beyond(results), 1.0)
    own = ["constant", *(n for n in names if n not in COMMON)]
    free = 0, len(own)
    p = held_out(S, y, ["+".join(sorted(c.result["key"]["effects"])) for c in causes], free)
    low = bar(p[known], y[known], weight[known])
    weights = fitted(S, y, free).round(2).tolist()
    common = dict(zip([n for n in names if n in COMMON], weights[2 * len(own) :], strict=True))
    found = [dict(zip(own, weights[k : k + len(own)], strict=True)) | common for k in free]
    if module is not None:
        rows = ["".join(f'    "{name}": {value:g},\n' for name, value in each.items()) for each in found]
        module.write_text(MODULE.format(alone=rows[0], beside=rows[1], bar=low), encoding="utf-8")
    logs = {c.result["name"] for c in causes}
    lines = [f"{len(causes)} causes of {len(logs)} logs, {int(y.sum())} right, {int(known.sum())} decidable.", ""]
    lines += [f"{name:16s} {found[0][name]:6.2f} alone {found[1][name]:6.2f} beside others" for name in found[0]]
    lines += ["", f"bar {low:.2f}"]
    for title, some in (("all", np.ones(len(y), dtype=bool)), ("decidable", known)):
        lines += ["", title, *_at_bars(causes, p, weight, some, sorted({0.3, 0.5, 0.6, 0.7, 0.8, 0.9, low}))]
    return "\n".join(lines)


def _at_bars(
    causes: Sequence[Told], p: np.ndarray, weight: np.ndarray, some: np.ndarray, bars: Sequence[float]
) -> list[str]:
    """Return a table of what bars let pass of some causes."""
    suite, y = np.array([c.suite for c in causes]), np.array([c.right for c in causes])
    logs = np.array([c.result["name"] for c in causes])
    library = sorted({*suite[some]} - {"off-library"})
    beyond = some & (suite == "off-library")
    heads = [f"right ones named: {s}" for s in library]
    lines = ["   ".join(["bar ", "wrong of those named", *heads, "beyond it, any name"])]
    for at in bars:
        named = some & (p >= at)
        wrong = float(np.sum(weight[named] * ~y[named]) / max(np.sum(weight[named]), 1e-12))
        right = [np.mean(p[some & y & (suite == s)] >= at) for s in library]
        foreign = len({*logs[named & beyond]}) / max(len({*logs[beyond]}), 1)
        cells = [f"{at:.2f}", f"{wrong:20.1%}", *(f"{v:{len(h)}.1%}" for v, h in zip(right, heads, strict=True))]
        lines.append("   ".join([*cells, f"{foreign:19.1%}"]))
    return lines


def draw(results: Sequence[Mapping[str, Any]], path: Path) -> None:
    """Draw the risk–coverage curve of cases that were diagnosed as they stand."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    causes = [(_true(r), c) for r in results for c in r.get("diagnosis", {}).get("causes", [])]
    p = np.array([c["confidence"] for _, c in causes])
    y = np.array([bool({*c["effects"]} & true) for true, c in causes])
    order = np.argsort(-p, kind="stable")
    covered, wrong = np.arange(1, len(p) + 1) / len(p), np.cumsum(~y[order]) / np.arange(1, len(p) + 1)
    figure, axes = plt.subplots(figsize=(6.0, 3.6), layout="constrained")
    axes.plot(100 * covered, 100 * wrong)
    axes.axhline(100 * ALPHA, color="0.6", linestyle="--")
    axes.set(xlabel="causes that are named, the most trusted first, %", ylabel="wrong among those named, %")
    figure.savefig(path)
    plt.close(figure)
