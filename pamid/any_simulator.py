"""One way in for every simulator: read it, diagnose its gap, go on with further logs."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from .bench.parameters import BenchParameters
from .effects.registry import chosen_effects
from .errors import ParameterError
from .explained import explained_by
from .face import check_simulator
from .gap.diagnosis.result import Diagnosis
from .gap.several import History, go_on
from .gap.several.conditions import Conditions
from .gap.several.logs import diagnose as together
from .signals.frames import free_names, logs_as_pandas
from .simulators import Simulator, port_effects
from .simulators import read_simulator as read_ported
from .simulators.page import MODELS, simulator_kinds


def read_simulator(path: str | Path, *, trust: bool = False) -> BenchParameters | Simulator:
    """Read a simulator of any kind.

    Parameters
    ----------
    path : path-like
        The simulator file of a bench, a cylinder, a joint or a muscle; the simulator file of a function, equations, a
        python-control system, a MuJoCo model or an FMU; or such a model itself, ``.xml`` or ``.fmu``.
    trust : bool, default=False
        Whether code that the file names (a Python function, an FMU) may run.

    Returns
    -------
    BenchParameters or Simulator
        The simulator, for `evaluate` and `diagnose`.

    Raises
    ------
    UntrustedCodeError
        It names code, and ``trust`` is False.
    SimulatorFileError, ParameterError
        The file is missing, not valid TOML, or contains something invalid.

    Examples
    --------
    >>> import tempfile, pathlib
    >>> import pamid
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     page = pathlib.Path(folder) / "sim.toml"
    ...     _ = page.write_text('kind = "cylinder"' + chr(10) + "[cylinder]" + chr(10) + 'bore = "25 mm"')
    ...     pamid.read_simulator(page).kind
    'cylinder'
    """
    from .systems import read_system
    from .systems.file import kind_of_file

    path = Path(path)
    if path.suffix.lower() in MODELS or (kind := kind_of_file(path)) in simulator_kinds():
        return read_ported(path, trust=trust)
    return BenchParameters.from_toml(path) if kind == "bench" else read_system(path)


@explained_by(together)
def diagnose(
    log: pd.DataFrame | Sequence[pd.DataFrame] | Mapping[str, pd.DataFrame],
    simulator: BenchParameters | Simulator,
    effects: str | Sequence[str] = "all",
    *,
    conditions: Mapping[str, Conditions] | None = None,
    since: History | None = None,
    rows: np.ndarray | None = None,
    alone: bool | None = None,
    seed: int = 0,
    progress: Callable[[str], None] | None = None,
) -> Diagnosis:
    """Diagnose where a simulator of any kind and a log disagree, which effect is the cause, and how far the gap closes.

    Parameters
    ----------
    log : DataFrame, list of DataFrame or mapping of str to DataFrame
        ``trajectory``, ``time`` (s) and the simulator's signals; several logs in a list ("log", "log 2", ...) or by
        name, in the order in which they were recorded. Of several logs causes are shared unless one came or went
        between two days.
    since : History, optional
        An earlier diagnosis to continue: ``diagnosis.history``, or the result of `pamid.gap.several.read_history`. The
        logs are added to it.
    rows : array of bool, shape (n_rows,), optional
        Rows of the log that count, for the simulator file of a cylinder, a joint or a muscle.
    alone : bool, optional
        Whether a log by itself is diagnosed without findings log by log; by default where ``log`` is one DataFrame.

    Returns
    -------
    Diagnosis
        The answer; pass its ``history`` as ``since`` to continue with more logs.

    Raises
    ------
    UnknownOptionError
        The library has no effect of such a name.
    ParameterError
        ``simulator`` is none, ``effects`` with ``since``, or ``rows`` for several logs or another simulator.
    MissingColumnError, ShortTrajectoryError, ExcitationError, IncompatibleError
        The logs cannot be used.

    Examples
    --------
    >>> import pamid
    >>> from pamid.bench import sealed_hold, sine
    >>> bench = pamid.BenchParameters.for_muscle("B")
    >>> leak = [("leakage", {"conductance": 2e-10})]
    >>> first = pamid.simulate(bench, [sine(2, 10, 1500)], effects=leak)
    >>> found = pamid.diagnose(first, bench, ["leakage", "flow_bias"])
    >>> more = pamid.simulate(bench, [sealed_hold(5, 1500)], effects=leak)
    >>> pamid.diagnose({"hold": more}, bench, since=found.history).causes[0].effects
    ('leakage',)
    """
    check_simulator(simulator)
    if since is not None and effects != "all":
        raise ParameterError(
            "Effects are named together with an earlier diagnosis.",
            "the library of the earlier diagnosis, whose posterior is the prior",
            "Leave them out, or diagnose all logs anew.",
        )
    history = since if since is not None else History(simulator, library_of(effects, simulator))
    given = logs_as_pandas(log, history.logs)
    logs = {free_names(1, history.logs)[0]: given} if isinstance(given, pd.DataFrame) else dict(given)
    if rows is not None:
        logs = simulator.counting(logs, rows)
    alone = isinstance(given, pd.DataFrame) if alone is None else alone
    return go_on(history, logs, conditions=conditions, alone=alone, seed=seed, progress=progress)


def library_of(effects: str | Sequence[str], simulator: BenchParameters | Simulator) -> list[str]:
    """Return the names that a choice among the effects stands for, with a kind of simulator."""
    if not simulator.library:
        return sorted(port_effects()) if effects == "all" else [effects] if isinstance(effects, str) else list(effects)
    return chosen_effects(effects, simulator.library)
