"""Diagnose several logs of any simulator with ports together."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
import pandas as pd
from threadpoolctl import threadpool_limits

from ...errors import IncompatibleError
from ...simulators.base import Simulator
from ...simulators.sizes import SignalSizes
from ..at_ports import told
from ..diagnosis.result import Diagnosis
from ..inference.first_order import FirstOrder
from ..one_equation import fitted_together
from ..readings import settled
from ..residuals.ports import PortEvidence
from ..residuals.untested import untested
from ..simulated import evidence_of, learn
from .conditions import Conditions, conditions_of
from .engine import naming, refuse_twice, sized, together
from .stacked import Log


def diagnose_port_logs(
    logs: Mapping[str, pd.DataFrame],
    simulator: Simulator,
    effects: str | Sequence[str],
    conditions: Mapping[str, Conditions] | None,
    seed: int,
    say: Callable[[str], None],
) -> Diagnosis:
    """Diagnose several logs of one simulator with ports together."""
    refuse_twice(logs)
    names, held = list(logs), conditions_of(list(logs), conditions)
    each = _evidence(logs, simulator, held, say)
    places = {k: p for e in reversed(each) for k, p in e.placements.items()}
    asked = each[-1].library(effects, places)
    with threadpool_limits(1):
        library = [k for k in asked if any(e.has(k) and e.touched([k]) for e in each)]
        kept = [set(settled(e, e.log, simulator, [k for k in library if e.has(k)], say)) for e in each]
        library = [k for k in library if any(k in some for some in kept)]
        close, shares, interrupted = dict[str, None](), list[float](), False
        for name, one, some in zip(names, each, kept, strict=True):
            say(f"estimate what could be explained of {name}")
            names_here = [k for k in library if k in some]
            known = learn(one, names_here, say)
            shares.append(known.share)
            first = FirstOrder(one, [k for k in names_here if known.templates.get(k)], None, known.templates)
            close |= dict.fromkeys(first.templates[s.templates[0]].effect for s in first.screen(1).contenders)
            if interrupted := known.interrupted:  # of the others nothing is known, and who waits no longer wants it
                library = list(close)
                break
        notes = [*each[0].heard(float(np.mean(shares))), *untested(each[-1], effects)]
        notes += [f"{name}: {text}" for name, one in zip(names, each, strict=True) for text in one.notes]
    kinds, rng = {k: p.effect for k, p in places.items()}, np.random.RandomState(seed)
    stacked = [Log(n, e, c.day) for n, e, c in zip(names, each, held, strict=True)]
    found, verdict, stack = together(
        stacked, library, kinds, notes, rng, say, close=list(close), interrupted=interrupted
    )
    if verdict is None:
        return found
    found = replace(found, logs=sized(found.logs, [(e.log.n, len(e.log.names)) for e in each], held))
    return told(found, each[-1], stack)


def _evidence(
    logs: Mapping[str, pd.DataFrame], simulator: Simulator, held: Sequence[Conditions], say: Callable[[str], None]
) -> list[PortEvidence]:
    """Return the evidence of each log, computed in the same way; an error names its log."""
    found: list[PortEvidence] = []
    longest, under = max(logs, key=lambda name: len(logs[name])), [c.under(simulator) for c in held]
    under = fitted_together(logs, under)
    for (name, log), its in zip(logs.items(), under, strict=True):
        with naming(name):
            found.append(evidence_of(log, its, refit=name == longest, say=say))
    if len({type(e) for e in found}) > 1:  # the log with the fewest states decides how all are evaluated
        found = [
            evidence_of(log, its, refit=name == longest, simulated=True, say=say)
            for (name, log), its in zip(logs.items(), under, strict=True)
        ]
    _refuse_strangers(dict(zip(logs, found, strict=True)))
    first = found[list(logs).index(longest)]
    joined = SignalSizes.together([e.sizes for e in found])
    for one in found:
        if one is not first:
            one.begin_as(first)
        one.measure_as(joined)
    return found


def _refuse_strangers(found: Mapping[str, PortEvidence]) -> None:
    """Raise where a log has no equation in common with another one: no cause could be shared."""
    (first, one), *others = found.items()
    for name, other in others:
        if not set(one.equations) & set(other.equations):
            raise IncompatibleError(
                f"{first} allows {', '.join(one.equations)}, {name} allows {', '.join(other.equations)}.",
                "logs with a common equation",
                "Map the columns of both logs alike, or diagnose them one by one.",
            )
