"""What to record next, after a diagnosis with a simulator of any kind."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from ...errors import ParameterError
from ..diagnosis.rivals import Rival
from .plan import Plan
from .search import plan_next

if TYPE_CHECKING:
    from ..diagnosis.result import Diagnosis
    from ..several.history import History


def next_run(diagnosis: Diagnosis, **options: Any) -> Plan:
    """Return the runs to record next, which best distinguish the explanations that a diagnosis left undecided.

    Where one explanation is left, the runs that best determine its parameters; where no effect is left, those that
    would show effects that the logs could not show.

    Parameters
    ----------
    diagnosis : Diagnosis
        A result of `pamid.diagnose`.
    **options : object
        Those of `pamid.gap.design.search.plan_next`: ``limits``, ``designs``, ``purpose``, ``seed``, ``progress``. Of
        a bench, ``limits`` is a `pamid.gap.design.family.Limits`; of any other simulator the lowest and highest value
        by input, beside ``rates``, ``keep``, ``changes`` of the rig, ``seconds`` and ``runs``.

    Returns
    -------
    Plan
        The runs, and what each outcome would mean; ``set_points()`` is what to drive the rig with.

    Raises
    ------
    ParameterError
        The diagnosis has no history, or its simulator no inputs.

    Examples
    --------
    >>> import pamid
    >>> from pamid.bench import sine
    >>> bench = pamid.BenchParameters.for_muscle("B")
    >>> log = pamid.simulate(bench, [sine(1, 10, 1500), sine(1.5, 8, 1500)], effects=["dead_volume"], seed=0)
    >>> found = pamid.diagnose(log, bench, ["dead_volume", "polytropic_exponent", "gas_temperature"])
    >>> pamid.next_run(found, designs=20).tells
    True
    """
    if diagnosis.history is None:
        raise ParameterError(
            "The diagnosis does not contain its logs and simulator.",
            "one of pamid.diagnose",
            "Diagnose with pamid.diagnose.",
        )
    return next_run_after(diagnosis.history, **options)


def _left(history: History) -> list[Rival]:
    """Return the explanations that are left: none with an effect where the last diagnosis has found no gap."""
    rivals = list(history.rivals)
    if not rivals or not history.rounds or history.rounds[-1].verdict != "none":
        return rivals
    bare = next((r for r in rivals if not r.effects), replace(rivals[0], effects={}, deviations={}))
    return [replace(bare, belief=1.0)]


def next_run_after(history: History, **options: Any) -> Plan:
    """Return the runs to record next, after the logs of a history."""
    last = list(history.held.values())[-1]
    now = {name: log for name, log in history.logs.items() if history.held[name].day == last.day}
    return plan_next(_left(history), now, last.under(history.simulator), library=history.library, **options)
