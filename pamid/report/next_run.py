"""A plan in words: expected results, and the meaning of each outcome."""

import math
from collections.abc import Sequence

from ..gap.design.plan import AS_IT_IS, TELLS, Plan
from ..gap.settings import MATERIAL
from . import causes
from .quantities import capital, parameter


def summary(plan: Plan) -> str:
    """Return the plan in one or two sentences."""
    if plan.purpose == "none":
        return "Nothing is undecided, and no named cause has parameters that a run could determine."
    said = [named(n) for n in plan.explanations]
    if plan.purpose == "unseen":
        listed = ", ".join(said[1:])
        now = "The next run is designed to show them." if plan.tells else "No run within the limits would show them."
        return f"The logs need no effect, but some would hardly have shown at their typical size: {listed}. {now}"
    if plan.purpose == "parameters":
        if not plan.tells:
            return f"Only {said[0]} remains, and no run within the limits would narrow its parameters by much."
        return f"Only {said[0]} remains: the next run determines its parameters."
    undecided = f"Undecided: {', '.join(f'{s} ({b:.0%})' for s, b in zip(said, plan.beliefs, strict=True))}."
    if not plan.tells:
        longer = "A longer one does not either."
        if math.isfinite(plan.needed):
            like = f" ({plan.closest[0].words.rpartition(', ')[0]})" if len(plan.closest) == 1 else ""
            longer = f"A run of about {plan.needed:.0f} s would{like}."
        return (
            f"{undecided} No run of {plan.limits.seconds:g} s within the limits distinguishes the likeliest one from "
            f"the others. {longer} Widen a limit ({plan.limits.options}), log another signal, or treat them as one "
            "cause."
        )
    hardest = min(e.nats for e in plan.expected)
    clear = f"The pair that is hardest to distinguish is expected to differ by {hardest:.3g} nats"
    return f"{undecided} {clear}{'' if not plan.alike else ', which is too little'}; 3 nats are odds of 20 to 1."


def outcomes(plan: Plan) -> list[str]:
    """Return the meaning of each outcome, and what would stay open."""
    found = []
    if plan.purpose == "unseen":
        for e in plan.expected if plan.runs else []:
            clear = f"the simulator without it falls behind by {e.nats:.3g} nats, most in the {e.equation} equation"
            said = clear if e.nats >= TELLS else "it would not show in this run"
            found.append(f"If the system has {named(e.truth)}, {said}.")
        return found
    for truth in plan.explanations:
        mine = [e for e in plan.expected if e.truth == truth]
        if not plan.runs or not mine:
            continue
        closest = min(mine, key=lambda e: e.nats)
        far = max(mine, key=lambda e: e.size)
        found.append(
            f"If it is {named(truth)}, {named(closest.rival)} falls behind it by {closest.nats:.3g} nats "
            f"({closest.low:.3g} to {closest.high:.3g}), and the {far.equation} error that {named(far.rival)} leaves "
            f"is {far.size:.2g} times the noise."
        )
    for alike in _classes(plan.alike):
        told = [named(n) for n in alike]
        together = f"{', '.join(told[:-1])} and {told[-1]}"
        found.append(f"{capital(together)} would stay one class: no run within the limits tells them apart.")
    if plan.runs and plan.expected:
        found.append("If all of them leave more than noise, the cause is another one: diagnose with the whole library.")
    return found


def _classes(pairs: Sequence[tuple[tuple[str, ...], tuple[str, ...]]]) -> list[list[tuple[str, ...]]]:
    """Return sets of explanations of which every two are a pair; each pair is in one."""
    alike, found = {frozenset(pair) for pair in pairs}, list[list[tuple[str, ...]]]()
    for pair in pairs:
        if any(set(pair) <= set(known) for known in found):
            continue
        own = list(pair)
        for name in dict.fromkeys(n for p in pairs for n in p):
            if name not in own and all(frozenset((name, other)) in alike for other in own):
                own.append(name)
        found.append(own)
    return found


def headroom(plan: Plan) -> str:
    """Return how much the choice of the run matters, and whether a change of the rig would tell more."""
    if plan.purpose in ("none", "unseen") or not plan.designs:
        return ""
    best, usual = plan.changed.get(AS_IT_IS, plan.clarity), plan.usual
    said = [f"The best of {plan.designs} runs gives {best:.2g} nats, a random run {usual:.2g}."]
    if math.isfinite(plan.right):
        said.append(
            f"The right one is then expected to come first in {plan.right:.0%} of cases; after a random run, in "
            f"{plan.right_usual:.0%}."
        )
    if best - usual < MATERIAL * best:
        said.append("The choice of the run hardly matters: any with as much motion would do.")
    others = {words: nats for words, nats in plan.changed.items() if words != AS_IT_IS}
    most = max(others, key=lambda words: others[words], default="")
    if others and others[most] - best > MATERIAL * best:
        said.append(f"With {most} the best run has {others[most]:.2g} nats{': change the system' if plan.rig else ''}.")
        said += [] if plan.rig else ["If this change of the system is possible, declare it (--change)."]
    elif others:
        said.append(f"None of these changes of the system would tell more: {', '.join(others)}.")
    if not plan.tells and plan.purpose == "discriminate" and not plan.rig:
        said.append("Only a change of the system tells them apart: another mass, load or gain, or another sensor.")
    return " ".join(said)


def named(names: tuple[str, ...]) -> str:
    """Return a set of effects as words."""
    return " and ".join(causes.named(*n.partition("@")[::2]) for n in names) or "no effect"


def parameter_named(name: str) -> str:
    """Return a parameter of an effect as words."""
    effect, _, own = name.rpartition(".")
    return f"{named((effect,))}: {parameter(own)}"
