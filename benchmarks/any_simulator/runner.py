"""One case after the other: the answers of pamid and its rivals, written as they come."""

from __future__ import annotations

import json
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from pamid.gap import diagnose_simulator
from pamid.gap.simulated import evidence_of
from pamid.simulators import Simulator

from .generator import Case, Spec, make
from .nominal import PORTS, simulator_of
from .rivals import parameter_fit, trees


def solve(spec: Spec, rivals: bool = True) -> dict[str, Any]:
    """Return the key of a case and what each method says."""
    case = make(spec)
    with tempfile.TemporaryDirectory() as folder:
        simulator = simulator_of(case.plant, Path(folder))
        found = {"key": case.key, "pamid": _pamid(case, simulator)}
        if rivals:
            evidence, future = evidence_of(case.log, simulator), evidence_of(case.future, simulator)
            found["parameter fit"] = parameter_fit(evidence, future)
            found["boosted trees"] = trees(evidence, future)
    own = PORTS.get(spec.plant, {})
    found["key"]["port"] = own.get(found["key"]["port"], found["key"]["port"])
    return found


def _pamid(case: Case, simulator: Simulator) -> dict[str, Any]:
    begun = time.perf_counter()
    d = diagnose_simulator(case.log, simulator, seed=0)
    seconds = time.perf_counter() - begun
    first = max(d.candidates, key=lambda c: c.confidence)
    closed = None
    if d.corrected is not None:
        before, after = (float(np.mean(_in_noise(case, simulator, s))) for s in (simulator, d.corrected))
        closed = 1.0 - after / before if before > 0 else None
    return {
        "verdict": d.verdict, "p": d.p_value, "effect": first.effect, "port": first.where or "",
        "confidence": first.confidence, "named": any(c.grade != "family" for c in d.causes),
        "reserved": d.with_reserve,
        "gap": d.verdict != "none", "closed": closed, "seconds": seconds,
        "causes": [{"effects": list(c.effects), "where": list(c.where), "share": c.share,
                    "parameters": {k: p.value for k, p in c.parameters.items()}} for c in d.causes],
        "predicted": {c.equation: c.closed_share for c in d.closure},
    }  # fmt: skip


def _in_noise(case: Case, nominal: Simulator, simulator: Simulator) -> np.ndarray:
    """Return squares of what a simulator leaves of runs without noise, each equation in its own size."""
    evidence, base = evidence_of(case.future, simulator), evidence_of(case.future, nominal)
    parts = zip(evidence.parts, base.parts, strict=True)
    return np.concatenate([np.square(evidence.value[a] / (np.std(base.measured[b]) or 1.0)) for a, b in parts])


def run(specs: list[Spec], folder: Path, rivals: bool = True) -> None:
    """Run the cases that have no result yet."""
    folder.mkdir(parents=True, exist_ok=True)
    for spec in specs:
        path = folder / f"{spec.name}.json"
        if path.is_file():
            continue
        begun = time.perf_counter()
        found = solve(spec, rivals)
        path.write_text(json.dumps(found, indent=1, default=float), encoding="utf-8")
        key, said = found["key"], found["pamid"]
        print(
            f"{spec.name}: {key['effect']}@{key['port']} ({key['nats']:.3g} nats, margin {key['margin']:.3g}"
            f"{'' if key['decidable'] else ', open'}) -> {said['verdict']}: {said['effect']}@{said['port']} "
            f"{said['confidence']:.2f}, p {said['p']:.1g}, {said['seconds']:.0f} of "
            f"{time.perf_counter() - begun:.0f} s",
            flush=True,
        )
