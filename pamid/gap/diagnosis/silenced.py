"""Parameters of which a log tells only that the equation says nothing: without bound, each explains as much.

With ten thousand times its inductance a coil's current never changes, whatever drives it. That explains a current that
follows its drive at once as well as any wrong term of its equation does, since a rate hardly shows in the log then.
"""

from __future__ import annotations

import numpy as np

from ...effects import Parameter
from ...simulators.reciprocity import SAME
from ...simulators.structure import spread_numbers
from ..inference.competition import Competition
from ..inference.hypotheses import Hypothesis
from ..residuals.ports import PortEvidence
from ..residuals.protocol import ResidualSource
from ..settings import LEAST_GAIN


def silenced(competition: Competition, best: Hypothesis) -> set[str]:
    """Return the causes that explain no more than their equation's silence does."""
    evidence, fit, found = competition.evidence, best.fit, set[str]()
    if evidence.simulates or evidence.exact:  # what stands still in a simulation is missed by all that moves
        return found
    for name, values in fit.spec.items():
        for p in evidence.effects[name].parameters:
            if not p.factor or not values.get(p.name, 0.0) > 0.0 or not _silences(evidence, name, p):
                continue
            far = competition.fitter.at({**fit.spec, name: {**values, p.name: p.upper}})
            if far.loglik > fit.loglik - LEAST_GAIN:
                found.add(name)
    return found


def _silences(evidence: ResidualSource, name: str, p: Parameter) -> bool:
    """Return whether all rates that a parameter changes vanish where it is large."""
    if not isinstance(evidence, PortEvidence) or evidence.simulator.form != "ode":
        return False
    place, simulator = evidence.placements[name], evidence.simulator
    if place.at not in simulator.parameters:
        return False
    signals, t = evidence.signals(), evidence.log.t
    x, u = (np.array([signals[n] for n in some]).reshape(-1, len(t)) for some in (simulator.states, simulator.inputs))
    far = simulator.with_({place.at: (1.0 + p.upper) * simulator.parameters[place.at].value})
    with np.errstate(all="ignore"):
        was, now = (one.rate(t, x, u, spread_numbers(one, len(t))) for one in (simulator, far))
    sizes = [np.max(np.abs(rates), axis=1) for rates in (was, now)]
    changed = np.max(np.abs(now - was), axis=1) > SAME * sizes[0]
    return bool(np.any(changed) and np.all(sizes[1][changed] < SAME * sizes[0][changed]))  # a term that stays is larger
