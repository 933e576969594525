"""A diagnosis of every verdict, made by hand on a simulated log."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd

from pamid.bench import BenchParameters
from pamid.equations import all_equations, residuals
from pamid.gap.diagnosis.findings import (
    Band,
    Candidate,
    Cause,
    Closure,
    EquationFinding,
    NextExperiment,
    ParameterEstimate,
    Region,
    TrajectoryShare,
)
from pamid.gap.diagnosis.result import Diagnosis

TRUE = ("coulomb_friction", {"amplitude": 6.0, "presliding": 5e-4})
VERDICTS = ("cause", "class", "several", "unknown", "none")


def windows_of(log: pd.DataFrame, nominal: BenchParameters, corrected: BenchParameters) -> pd.DataFrame:
    """The table that a diagnosis keeps: residuals of both simulators with the state at each window."""
    gain = nominal.joint.pulley_radius / nominal.muscle.rest_length
    runs = dict(iter(log.groupby("trajectory", sort=False)))
    frames = []
    pairs = zip(residuals(log, nominal), residuals(log, corrected), strict=True)
    for (run, name, before), (_, _, after) in pairs:
        rows, time = runs[run], runs[run]["time"].to_numpy()
        kept = np.isin(np.round(before.time, 6), np.round(after.time, 6))
        for k, side in enumerate(all_equations()[name].sides):
            muscle = side if side in "12" else "1"
            eps = nominal.muscle.initial_contraction + gain * rows["q"].to_numpy() * (1 if muscle == "1" else -1)
            P = rows[f"P{muscle}"].to_numpy()
            state = {"eps": eps, "deps": np.gradient(eps, time), "P": P, "dP": np.gradient(P, time)}
            state |= {"u": rows[f"u{muscle}"].to_numpy(), "q": rows["q"].to_numpy()}
            frames.append(
                pd.DataFrame(
                    {
                        "trajectory": run,
                        "time": after.time,
                        "equation": name,
                        "side": side,
                        **{c: np.interp(after.time, time, v) for c, v in state.items()},
                        "measured": before.measured[kept, k],
                        "before": before.value[kept, k],
                        "after": after.value[:, k],
                        "noise": after.noise[:, k],
                    }
                )
            )
    return pd.concat(frames, ignore_index=True)


def diagnosis_of(verdict: str, material: tuple[BenchParameters, BenchParameters, pd.DataFrame]) -> Diagnosis:
    nominal, corrected, windows = material
    friction = Cause(
        ("coulomb_friction",),
        "force",
        0.93,
        0.95,
        (0.92, 0.97),
        {
            "amplitude": ParameterEstimate(5.94, "N", (5.7, 6.2)),
            "presliding": ParameterEstimate(4.8e-4, "-", (2.1e-4, np.inf)),
        },
    )
    gas = Cause(
        ("leakage",),
        "flow",
        0.88,
        0.31,
        (0.22, 0.40),
        {"conductance": ParameterEstimate(2.1e-10, "m^3/(s Pa)", (1.9e-10, 2.4e-10))},
    )
    causes = {
        "cause": [friction],
        "class": [
            replace(
                friction,
                effects=("coulomb_friction", "hysteresis"),
                distinguished_by="a triangle of small amplitude within the presliding range",
            )
        ],
        "several": [replace(friction, share=0.62, share_ci90=(0.55, 0.70)), gas],
        "unknown": [],
        "none": [],
    }[verdict]
    told = {name for c in causes for name in c.effects} or {verdict}
    library = {
        "coulomb_friction": (410.0, 0.95), "hysteresis": (402.0, 0.90), "stribeck_friction": (350.0, 0.82),
        "viscous_friction": (120.0, 0.31), "leakage": (90.0, 0.24), "creep": (20.0, 0.05), "force_lag": (15.0, 0.04),
        "dead_volume": (1.0, 0.01), "bladder_elasticity": (-2.0, 0.0), "none": (0.0, 0.0), "unknown": (3.0, 0.0),
    }  # fmt: skip
    candidates = [
        Candidate(
            name,
            0.93 / len(told) if name in told else 0.07 / (len(library) - len(told)),
            score,
            closed,
            "" if name in told else f"closes {100 * closed:.0f} % where the best closes 95 %",
        )
        for name, (score, closed) in library.items()
    ]
    order = {"cause": 0.97, "class": 0.97, "several": 0.63, "unknown": 0.97, "none": 0.25}[verdict]
    equations = [
        EquationFinding("force", order, 1e-4 if verdict != "none" else 0.62, 3.2 if verdict != "none" else 0.04),
        EquationFinding("flow", (1 - order) * 0.9, 0.02 if verdict == "several" else 0.41, 0.2),
        EquationFinding("valve", (1 - order) * 0.1, 0.77, 0.05),
        EquationFinding("joint", 0.0, 0.55, 0.02),
    ]
    none = verdict == "none"
    shares = {"sine-4-15": 0.41, "triangle-4-20": 0.34, "sine-10-8": 0.2, "step-0-12": 0.05}
    return Diagnosis(
        verdict=verdict,
        p_value=0.41 if none else 0.0005,
        equations=equations,
        regions=[] if none else [Region("force", "eps1 > 0.138 and deps1 > 0", 0.61, 0.17)],
        bands=[] if none else [Band("force", 0, 2, 0.83), Band("force", 2, 8, 0.14), Band("force", 8, 25, 0.03)],
        trajectories=[] if none else [TrajectoryShare(n, s) for n, s in shares.items()],
        candidates=candidates,
        causes=causes,
        closure=[
            Closure("force", 5.82, 1.43 if causes else 5.82, 0.62, 0.95 if causes else 0.0, (0.92, 0.97), "N"),
            Closure("flow", 4.1e-6, 3.9e-6, 3.8e-6, 0.31 if causes else 0.0, (0.1, 0.5), "kg/s"),
            Closure("joint", 0.21, 0.2, 0.2, 0.0, (0.0, 0.3), "N m"),
        ],
        next_run=None
        if verdict in ("cause", "none")
        else NextExperiment(
            {"kind": "triangle", "frequency": 0.5, "amplitude": 4, "seconds": 20},
            ("coulomb_friction", "hysteresis"),
            5.0,
            "Nested reversals show whether the force remembers more than the last one.",
        ),
        notes=["The noise floor rests on the samples' own scatter, since no run is repeated."],
        nominal=nominal,
        corrected=corrected if causes else nominal,
        windows=windows if not none else windows.assign(before=windows["after"]),
        leftover={"depends_on": ["eps", "deps"], "form": "-0.8 eps^2 - 3.1 deps", "predictable_share": 0.72}
        if verdict == "unknown"
        else {},
    )
