"""Causes whose size the log leaves open down to none: nothing that an interval does not exclude is a finding.

A law may level off where it explains a log, as an inertia does beyond which nothing moves. The factor about the fit
then looks certain, see `pamid.gap.diagnosis.signs`, while the size reaches from no change to any.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from ...effects import Effect, Parameter
from .closure import Clusters
from .findings import ParameterEstimate
from .open_set import Trust


def sized(
    trust: Mapping[str, Trust], clusters: Clusters, parameters: Mapping[str, Mapping[str, ParameterEstimate]]
) -> dict[str, Trust]:
    """Return the evidence for each name, those marked whose size the log does not tell from none."""
    if not clusters.knows_scatter:
        return dict(trust)
    effects = clusters.evidence.effects
    open_ = {name for name, estimates in parameters.items() if _open(effects[name], estimates)}
    return {name: replace(found, sized=name not in open_) for name, found in trust.items()}


def _open(effect: type[Effect], estimates: Mapping[str, ParameterEstimate]) -> bool:
    """Return whether the interval of a parameter without which an effect is none reaches there, or to both ends."""
    for p in effect.parameters:
        low, high = estimates[p.name].ci90
        if low <= 0.0 <= high and vanishes(effect, p):
            return True
        if low <= p.lower and p.upper <= high and _only(effect, p):
            return True
    return False


def vanishes(effect: type[Effect], p: Parameter) -> bool:
    """Return whether an effect changes nothing where a parameter is 0, whatever the others are.

    Of several terms that add up, none is the whole effect. A limit is none where signals end, which its place alone
    does not tell.
    """
    return not (p.idle or p.idle_below) and ([q for q in effect.parameters if q.linear] == [p] or _only(effect, p))


def _only(effect: type[Effect], p: Parameter) -> bool:
    """Return whether a parameter is an effect's only size."""
    return [q for q in effect.parameters if not (q.share or q.skew or q.before)] == [p]
