"""Logs of a bench, a cylinder and a joint that have effects which their pages lack."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

Logs = tuple[pd.DataFrame, pd.DataFrame]
TIME = np.arange(0.0, 8.0, 0.004)


def bench(effects: list[str], rng: np.random.Generator, folder: Path) -> Logs:
    """Return the log of a bench and other runs of it."""
    from pamid.bench import BenchParameters, simulate, sine, triangle

    nominal = BenchParameters.for_muscle("B")
    nominal.to_toml(folder / "sim.toml")
    seeds = [int(s) for s in rng.integers(1 << 30, size=2)]
    first = [sine(2, 10, 800), sine(5, 12, 800), triangle(0.4, 15, 800)]
    later = [sine(3, 12, 800), triangle(0.7, 10, 800)]
    return tuple(
        simulate(nominal, runs, effects=list(effects), seed=seed)
        for runs, seed in zip((first, later), seeds, strict=True)
    )


def _runs(make, speeds: tuple[float, ...], rng: np.random.Generator) -> pd.DataFrame:
    parts = [make(w, rng).assign(trajectory=f"run {w:g}", time=TIME) for w in speeds]
    return pd.concat(parts, ignore_index=True)


def _both(make, rng: np.random.Generator) -> Logs:
    return _runs(make, (1.0, 2.3, 4.0), rng), _runs(make, (1.6, 3.1), rng)


def cylinder(effects: list[str], rng: np.random.Generator, folder: Path) -> Logs:
    """Return the log of a cylinder whose seal drags, and other runs of it."""
    (folder / "sim.toml").write_text('kind = "cylinder"\n[cylinder]\nbore = "25 mm"\n')

    def make(w: float, rng: np.random.Generator) -> pd.DataFrame:
        x, v = 0.05 + 0.04 * np.sin(w * TIME), 0.04 * w * np.cos(w * TIME)
        P = 4e5 + 5e4 * np.sin(0.7 * w * TIME)
        F = (P - 101_325.0) * np.pi / 4 * 0.025**2 + 0.3 * rng.standard_normal(len(TIME))
        F -= 200.0 * v * ("viscous_friction" in effects) + 6.0 * ("force_bias" in effects)
        F -= 12.0 * np.tanh(v / 1e-3) * ("coulomb_friction" in effects)
        return pd.DataFrame({"x": x, "P": P, "F": F})

    return _both(make, rng)


def joint(effects: list[str], rng: np.random.Generator, folder: Path) -> Logs:
    """Return the log of a joint with friction, and other runs of it; the page leaves inertia or gravity to the log."""
    left = '"fit"' if "fit" in effects else "0.02"
    (folder / "sim.toml").write_text(f'kind = "joint"\n[joint]\nunit = "N m"\ninertia = {left}\ngravity = 0.8\n')

    def make(w: float, rng: np.random.Generator) -> pd.DataFrame:
        q, dq, ddq = 0.5 * np.sin(w * TIME), 0.5 * w * np.cos(w * TIME), -0.5 * w * w * np.sin(w * TIME)
        drive = 0.02 * ddq + 0.8 * np.sin(q) + 0.004 * rng.standard_normal(len(TIME))
        drive += 0.05 * dq * ("viscous_friction" in effects) + 0.08 * np.tanh(dq / 0.01) * (
            "coulomb_friction" in effects
        )
        return pd.DataFrame({"q": q, "drive": drive})

    return _both(make, rng)
