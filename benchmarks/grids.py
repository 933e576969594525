"""How much of an effect the points of its grid explain: what a search to first order may miss between them.

Effects of random size and shape are added to a log without a gap, three to three hundred times the noise, and the best
template of the same effect is fitted to the gap. Printed are the smallest and the median share of its square that this
explains, by kind of log. Run with ``python benchmarks/grids.py``; ``--draws N`` takes more of each effect.
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Iterator
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from scipy.optimize import lsq_linear

from pamid.bench import BenchParameters, simulate, sine, step, triangle
from pamid.effects import Effect, Parameter, all_effects
from pamid.gap.inference.sensitivity import Template, templates
from pamid.gap.residuals.bench import Evidence
from pamid.gap.residuals.on_equation import OnEquation, strain_scale
from pamid.gap.residuals.single import SignalEvidence, Stated

SMALL, LARGE = 3.0, 300.0
"""Size of an effect, in standard deviations of the noise."""
RUNS, ROWS, DT = 5, 1600, 0.005
KINDS = {
    "muscle": ("force", ("muscle",)),
    "cylinder": ("force", ("actuator", "muscle")),
    "joint": ("torque", ("joint", "motor")),
}


def drawn(effect: type[Effect], reached: Any, rng: np.random.Generator) -> dict[str, float]:
    """Return random values of an effect's parameters, those of a log's own limits within these."""

    def value(p: Parameter) -> float:
        if p.before:
            return 0.0
        if p.skew:
            return float(rng.uniform(-0.4, 0.4))
        if p.share:
            return float(rng.uniform(p.lower, p.upper))
        if p.nominal == 0.0:
            return 0.3 * float(rng.uniform(p.lower, p.upper))
        if p.idle:
            return p.upper - (p.upper - p.lower) * float(np.exp(rng.uniform(np.log(0.02), 0.0)))
        sign = rng.choice([-1.0, 1.0]) if p.lower < 0.0 else 1.0
        return float(np.clip(sign * abs(p.nominal) * np.exp(rng.uniform(-3.0, 3.0)), p.lower, p.upper))

    return {p.name: value(reached(p)) for p in effect.parameters}


def explained(found: list[Template], gap: np.ndarray, J: np.ndarray) -> float:
    """Return the share of a gap's square that the best template explains, beside what tolerances take up."""
    Q = np.linalg.qr(J)[0] if J.shape[1] else np.zeros((len(gap), 0))
    gap = gap - Q @ (Q.T @ gap)
    shares = [0.0]
    for t in found:
        columns = t.columns - Q @ (Q.T @ t.columns)
        shares.append(1.0 - 2.0 * lsq_linear(columns, gap, (t.lower, t.upper)).cost / float(gap @ gap))
    return max(shares)


def of_bench(draws: int, rng: np.random.Generator) -> Iterator[tuple[str, list[float]]]:
    """Yield each effect of a bench with the shares that its grid explains."""
    nominal = BenchParameters.for_muscle("B").replace(tolerance={"rest_diameter": 0.005, "sonic_conductance": 0.02})
    runs = [sine(2, 15, 2000), sine(6, 10, 2000), step(0, 25, 2000), triangle(3, 12, 2000)]
    evidence = Evidence(simulate(nominal, runs, seed=0), nominal)
    Q = np.linalg.qr(evidence.J)[0]
    for name, effect in all_effects().items():
        if "bench" not in effect.kinds:
            continue
        found, shares = templates(evidence, name), []
        for _ in range(20 * draws if found else 0):
            gap = evidence.z({name: drawn(effect, evidence.reached, rng)}) - evidence.z0
            size = float(np.linalg.norm(gap - Q @ (Q.T @ gap))) / np.sqrt(len(gap))
            if SMALL / 30.0 < size < LARGE / 30.0:  # many windows hold what single ones need not
                shares.append(explained(found, gap, evidence.J))
            if len(shares) == draws:
                break
        yield name, shares


def signals(kind: str, rng: np.random.Generator) -> tuple[dict[str, np.ndarray], np.ndarray, np.ndarray]:
    """Return signals of one equation, its model's target and the trajectory of each row."""
    parts: dict[str, list[np.ndarray]] = {"time": [], "position": [], "pressure": []}
    for _ in range(RUNS):
        time = DT * np.arange(ROWS)
        for name in parts:
            waves = sum(np.sin(2 * np.pi * f * time + a) for f, a in rng.uniform((0.2, 0.0), (1.5, 6.0), (3, 2)))
            parts[name].append(time if name == "time" else waves / np.abs(waves).max())
    table = {name: np.concatenate(x) for name, x in parts.items()}
    codes = np.repeat(np.arange(RUNS), ROWS)
    table["position"] = {"muscle": 0.12, "cylinder": 0.2, "joint": 1.0}[kind] * (1.0 + table["position"])
    table["velocity"] = np.concatenate([np.gradient(x, DT) for x in np.split(table["position"], RUNS)])
    if kind == "joint":
        del table["pressure"]
        return table, 3.0 * np.sin(table["position"]) + 0.2 * table["velocity"], codes
    table["pressure"] = 3.5e5 + 2e5 * table["pressure"]
    table["pressure_rate"] = np.concatenate([np.gradient(x, DT) for x in np.split(table["pressure"], RUNS)])
    area = 8e-4 * (3.6 * (1 - table["position"]) ** 2 - 0.9) if kind == "muscle" else 1.5e-3
    return table, (table["pressure"] - 1e5) * area, codes


def of_one_equation(kind: str, draws: int, rng: np.random.Generator) -> Iterator[tuple[str, list[float]]]:
    """Yield each effect of a muscle, cylinder or joint with the shares that its grid explains."""
    target_kind, kinds = KINDS[kind]
    table, target, codes = signals(kind, rng)
    equation = OnEquation(table, lambda _: target, DT, np.flatnonzero(np.diff(codes, prepend=-1)), target_kind)
    noise, scale = 0.004 * float(np.std(target)), strain_scale(table["position"], kind == "muscle")

    def held(y: np.ndarray, gap: float) -> Any:
        stated, names = Stated(equation, y), [str(k) for k in range(RUNS)]
        found = SignalEvidence(stated, names, position=scale, contraction=kind == "muscle")
        found.measure_as(found.sizes._replace(gaps={equation.kind: gap}))
        return found

    usual = 0.05 * float(np.std(target))
    plain = held(target, usual)
    for name, effect in all_effects().items():
        if not set(effect.kinds) & set(kinds) or not plain.touched([name]):
            continue
        shares: list[float] = []
        for _ in range(20 * draws):
            spec = {name: drawn(plain.effects[name], plain.reached, rng)}
            added = equation.modelled(plain.active(spec)) - target
            size = float(np.sqrt(np.mean(np.square(added))))
            if SMALL * noise < size < LARGE * noise:
                evidence = held(target + added + rng.normal(0.0, noise, len(target)), size)
                shares.append(explained(templates(evidence, name), -evidence.z0, evidence.J))
            if len(shares) == draws:
                break
        yield name, shares


def main() -> None:
    """Print a line for each effect of each kind of log."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--draws", type=int, default=10, help="gaps of each effect")
    parser.add_argument("--seed", type=int, default=0, help="seed of the draws")
    args = parser.parse_args()
    rng = np.random.default_rng(args.seed)
    for kind in ("bench", *KINDS):
        found = of_bench(args.draws, rng) if kind == "bench" else of_one_equation(kind, args.draws, rng)
        print(f"{kind:28s} {'gaps':>5s} {'least':>6s} {'median':>7s}")
        for name, shares in found:
            low = f"{min(shares):6.2f} {np.median(shares):7.2f}" if shares else "     –       –"
            print(f"  {name:26s} {len(shares):5d} {low}", flush=True)


if __name__ == "__main__":
    main()
