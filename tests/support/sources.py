"""Logs of muscles of one shape, and models fitted to the first."""

from __future__ import annotations

import warnings

import numpy as np
import pandas as pd
from pamid.estimators import (
    JointPIHM,
    StaticPIHM,
    ThermodynamicPIHM,
)

from pamid.laws.quasi_static import QuasiStaticForce
from pamid.laws.thermodynamic import ThermodynamicFlow
from pamid.signals.state import State
from pamid.volume.contact import ContactVolume
from pamid.volume.scaled import ScaledVolume

SIGNALS = ["eps", "deps", "P", "dP"]
MUSCLE_A = ContactVolume(0.2, 6e-4, 0.3, -0.2, 5e4, 0.05, 2e4, 1.6e-5)


def table(seed=0, runs=6, rows=50, *, factor=1.0, dead=0.0, length=0.2, noise=0.0):
    """Runs of a muscle similar to A: signals, force and flow."""
    rng = np.random.default_rng(seed)
    parts = []
    for k in range(runs):
        t = np.linspace(0, 5, rows)
        a, f, phase = rng.uniform(0.02, 0.08), rng.uniform(1, 3), rng.uniform(0, 6)
        b, g = rng.uniform(5e4, 1e5), rng.uniform(2, 5)
        eps, deps = 0.12 + a * np.sin(f * t + phase), a * f * np.cos(f * t + phase)
        P, dP = 3e5 + b * np.sin(g * t), b * g * np.cos(g * t)
        parts.append(pd.DataFrame({"trajectory": f"run {k}", "eps": eps, "deps": deps, "P": P, "dP": dP}))
    out = pd.concat(parts, ignore_index=True)
    state = State(*(out[s].to_numpy() for s in SIGNALS))
    jet = ScaledVolume(MUSCLE_A, factor, dead).jet(state)
    out["F"] = QuasiStaticForce(length).predict(*jet, state)
    out["mdot"] = ThermodynamicFlow().predict(*jet, state)
    for target in ("F", "mdot"):
        out[target] += noise * out[target].std() * rng.normal(size=len(out))
    return out


def fitted(kind, volume_model="anchored", **options):
    common = {"volume_model": volume_model, "hidden_layer_sizes": (8, 8), "max_iter": 25, "random_state": 0}
    model, data = kind(0.2, 0.01, **(common | options)), table()
    target = {StaticPIHM: "F", ThermodynamicPIHM: "mdot", JointPIHM: ["F", "mdot"]}[kind]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return model.fit(data[SIGNALS], data[target])
