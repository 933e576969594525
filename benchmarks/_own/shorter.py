"""The same log with the library cut to a half and to a quarter, the truth kept: an answer must not change."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np

from benchmarks._answers import Record, short
from benchmarks.any_simulator import generator
from benchmarks.any_simulator.nominal import PORTS, simulator_of

from .ask import ask, names_of

SHARES = {"half": 0.5, "quarter": 0.25}


def specs(cases: int, seed: int) -> list[generator.Spec]:
    """Return cases of the check on any simulator, plants in turn."""
    suites, plants = ("single", "single", "single", "single", "none"), list(generator.PLANTS)
    return [generator.Spec(suites[k // 4 % 5], plants[k % 4], k // 20 * 4 + k // 4 % 5 % 4, seed) for k in range(cases)]


def solve(spec: generator.Spec) -> Record:
    """Return whether the answer to a case is the same with shorter libraries."""
    case = generator.make(spec)
    rng = np.random.default_rng([spec.seed, spec.number, 7])
    with tempfile.TemporaryDirectory() as folder:
        simulator = simulator_of(case.plant, Path(folder))
        whole = ask(case.log, simulator)
        library = sorted(k for k in whole["scores"] if k.split("@")[1])
        true = truth(case.key, library)
        answers = {"whole": whole}
        kept = {"whole": set(library)}
        for name, share in SHARES.items():
            others = [k for k in library if k not in true]
            some = [others[k] for k in rng.permutation(len(others))[: round(share * len(library))]]
            kept[name] = {*true, *some}
            answers[name] = ask(case.log, simulator, sorted(kept[name]))
    changed = {n: not same(whole, answers[n], kept[n]) for n in SHARES}
    told = " | ".join(f"{n} ({len(kept[n])}) {short(a)}" for n, a in answers.items())
    return {
        "right": not any(changed.values()), "changed": changed, "true": sorted(true),
        "said": f"{case.key['effect']}@{case.key['port']}: {told}",
    }  # fmt: skip


def truth(key: Record, library: list[str]) -> set[str]:
    """Return the names that are the cause of a case, at whichever port of one joint."""
    from benchmarks.any_simulator.report import _same_port

    port = PORTS.get(key["plant"], {}).get(key["port"], key["port"])
    return {
        n for n in library if n.split("@")[0] == key["effect"] and _same_port(n.split("@")[1], key | {"port": port})
    }


def same(whole: Record, other: Record, kept: set[str]) -> bool:
    """Return whether two answers agree in as far as the second could say what the first says."""
    if whole["verdict"] in ("none", "unknown") or other["verdict"] in ("none", "unknown"):
        return bool(whole["verdict"] == other["verdict"])
    first = [names & kept for names in names_of(whole)]
    left = names_of(other)
    for names in first:
        match = next((n for n in left if n & names), None)
        if match is None:
            return False
        left.remove(match)
    return not left


def captured(spec: generator.Spec) -> tuple[generator.Case, Any]:
    """Return a case, and what truly happened while its log was recorded."""
    made: list[Any] = []
    plain = generator.log_of

    def kept(plant: Any, record: Any, rng: Any) -> Any:
        made.append(record)
        return plain(plant, record, rng)

    with mock.patch.object(generator, "log_of", kept):
        return generator.make(spec), made[0]


def jobs(cases: int, seed: int) -> list[tuple[str, Callable[[], Record]]]:
    """Return the cases."""
    return [(f"library {s.name}", partial(solve, s)) for s in specs(cases, seed)]


def line(record: Record) -> str:
    """Return a case in one line."""
    return f"{'same' if record['right'] else 'CHANGED'} {record['said']}"


def summary(records: list[Record]) -> list[str]:
    """Return what they come to."""
    done = [r for r in records if "right" in r]
    parts = [f"{n} of the library: {sum(r['changed'][n] for r in done)} of {len(done)}" for n in SHARES]
    return [f"answers that change with a {', a '.join(parts)}"]
