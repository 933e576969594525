"""What a later diagnosis goes on from: the logs so far, the simulator and library they were held against, the rounds.

The posterior of the earlier logs is their likelihood times the prior. It is kept exactly, as the logs themselves, so
that a hypothesis that nobody thought of before has its right posterior as well.
"""

from __future__ import annotations

import hashlib
import inspect
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...effects import all_effects
from ...errors import IncompatibleError, LogFormatError, LogNotFoundError, PamidError
from ...toml_files import TomlErrors, read_small_text
from ..diagnosis.rivals import Rival
from .conditions import Conditions

if TYPE_CHECKING:
    import pandas as pd

    from ...bench.parameters import BenchParameters
    from ..diagnosis.result import Diagnosis

STATE, LOGS = "state.json", "logs.parquet"
SCHEMA = 2
_ERRORS = TomlErrors(LogNotFoundError, LogFormatError, LogFormatError)
_SHOWN = 6
"""Effects whose confidence a round keeps."""


@dataclass(frozen=True)
class Round:
    """What a diagnosis said after each further log.

    Parameters
    ----------
    logs : list of str
        The logs that came with it.
    seconds : float
        Time recorded so far, s.
    verdict : str
        The verdict.
    confidences : dict of str to float
        Confidence of the likeliest candidates: of several causes in each, else adding to one over the library.
    parameters : dict of str to dict
        For each cause its main parameter: ``parameter``, ``value``, ``low``, ``high``, ``unit``.
    left : float
        Share of the gap's power that the named causes leave; 1 where none is named.
    """

    logs: list[str]
    seconds: float
    verdict: str
    confidences: dict[str, float]
    parameters: dict[str, dict[str, Any]]
    left: float


@dataclass
class History:
    """The logs so far.

    Parameters
    ----------
    params : BenchParameters
        The simulator.
    library : list of str
        Effects that may be causes.
    logs : dict of str to DataFrame
        The logs by name.
    held : dict of str to Conditions
        What held for each.
    rounds : list of Round
        What was said after each further log.
    rivals : list of Rival
        Explanations that the last diagnosis left.
    """

    params: BenchParameters
    library: list[str]
    logs: dict[str, pd.DataFrame] = field(default_factory=dict)
    held: dict[str, Conditions] = field(default_factory=dict)
    rounds: list[Round] = field(default_factory=list)
    rivals: list[Rival] = field(default_factory=list)

    def add(self, found: Diagnosis, logs: Mapping[str, pd.DataFrame], held: Sequence[Conditions]) -> None:
        """Take in further logs and what a diagnosis of all of them says.

        Parameters
        ----------
        found : Diagnosis
            The diagnosis.
        logs : mapping of str to DataFrame
            The logs that came with it.
        held : sequence of Conditions
            What held for each.
        """
        self.logs |= dict(logs)
        self.held |= dict(zip(logs, held, strict=True))
        self.rounds.append(_round(found, list(logs), seconds(self.logs.values())))
        found.rounds = list(self.rounds)
        self.rivals = list(found.rivals)

    def write(self, folder: Path) -> None:
        """Write what a later diagnosis goes on from into a folder."""
        import pandas as pd

        state = {
            "schema": SCHEMA,
            "simulator": _simulator(self.params),
            "library": {name: fingerprint(name) for name in self.library},
            "logs": [
                {"name": name, "day": c.day, "conditions": c.numbers, "rows": len(self.logs[name])}
                for name, c in self.held.items()
            ],
            "rounds": [asdict(r) for r in self.rounds],
            "rivals": [r.as_dict() for r in self.rivals],
        }
        parts = [log.assign(log=name) for name, log in self.logs.items()]
        pd.concat(parts, ignore_index=True).to_parquet(folder / LOGS, index=False)
        state["mark"] = _mark(state, folder / LOGS)
        (folder / STATE).write_text(json.dumps(state, indent=1, allow_nan=False) + "\n", encoding="utf-8")


def read_history(folder: str | Path, params: BenchParameters | None = None) -> History:
    """Read what an earlier diagnosis left.

    Parameters
    ----------
    folder : path-like
        What ``--out`` of the earlier diagnosis named.
    params : BenchParameters, optional
        The simulator of today, which must be that of the earlier one.

    Returns
    -------
    History
        The logs so far.

    Raises
    ------
    LogNotFoundError, LogFormatError
        The folder holds no earlier diagnosis of a bench.
    IncompatibleError
        Simulator or library changed since; the message says what.
    """
    from ...bench.parameters import BenchParameters

    path = Path(folder)
    if not (path / STATE).is_file() or not (path / LOGS).is_file():
        raise LogNotFoundError(
            f"{path} holds no {STATE if not (path / STATE).is_file() else LOGS}.",
            "the folder that --out of an earlier 'pamid diagnose' of a bench named",
            "Name that folder; diagnoses of other systems cannot be gone on from.",
        )
    try:
        state = json.loads(read_small_text(path / STATE, "what an earlier diagnosis left", _ERRORS))
        whole = state["schema"] == SCHEMA and state.pop("mark") == _mark(state, path / LOGS)
    except PamidError:
        raise
    except (ValueError, KeyError, TypeError, AttributeError, OSError, RecursionError) as error:
        raise _broken(path, error) from None
    if not whole:
        raise LogFormatError(
            f"{STATE} or {LOGS} of {path} was changed since, or is of another version.",
            "both as one diagnosis wrote them",
            "Diagnose the logs anew.",
        )
    try:
        then = _parameters(BenchParameters, state["simulator"])
        held = {str(e["name"]): Conditions(dict(e["conditions"]), str(e["day"])) for e in state["logs"]}
        rounds = [Round(**r) for r in state["rounds"]]
        rivals = [_rival(r) for r in state["rivals"]]
        library = {str(k): str(v) for k, v in state["library"].items()}
        table = _table(path / LOGS)
        logs = {name: table[table["log"] == name].drop(columns="log").reset_index(drop=True) for name in held}
        if not held or any(log.empty for log in logs.values()):
            raise ValueError("a log has no rows")
    except PamidError:
        raise
    except (ValueError, KeyError, TypeError, AttributeError, OSError) as error:
        raise _broken(path, error) from None
    _refuse(path, then, params, library)
    return History(then if params is None else params, list(library), logs, held, rounds, rivals)


def _broken(path: Path, error: Exception) -> LogFormatError:
    return LogFormatError(
        f"{path} cannot be gone on from: {type(error).__name__}: {str(error)[:200]}.",
        f"{STATE} and {LOGS} as 'pamid diagnose' wrote them",
        "Diagnose the logs anew.",
    )


def _rival(found: Mapping[str, Any]) -> Rival:
    rival, known = Rival.from_dict(found), all_effects()
    for name, values in rival.effects.items():
        if values.keys() != {p.name for p in known[name].parameters}:
            raise ValueError(f"{name} has other parameters")
    return rival


def _mark(state: Mapping[str, Any], logs: Path) -> str:
    """Return a mark of a state and its logs that changes with either: what a hand has edited is no posterior."""
    text = json.dumps(state, sort_keys=True)
    return hashlib.sha256(text.encode() + hashlib.sha256(logs.read_bytes()).digest()).hexdigest()


def _table(path: Path) -> pd.DataFrame:
    """Read logs as any log is read: within the memory, and nothing but readings that a sensor can give."""
    from pandas.api.types import is_numeric_dtype

    from ...signals.formats.parquet import FORMAT
    from ...signals.log import MAX_BYTES
    from ...signals.mapping import LogMapping
    from ...signals.readings import impossible

    frame = FORMAT.read(path, LogMapping(), MAX_BYTES)[0][0].frame
    for name in (str(c) for c in frame.columns if c not in ("trajectory", "log")):
        if not is_numeric_dtype(frame[name]) or impossible(name, frame[name].to_numpy(dtype=float)).any():
            raise ValueError(f"{name} holds what is no reading")
    return frame


def _refuse(path: Path, then: BenchParameters, now: BenchParameters | None, library: Mapping[str, str]) -> None:
    """Raise if simulator or library are not those of the earlier diagnosis."""
    changed = []
    if now is not None and now != then:
        a, b = _flat(_simulator(then)), _flat(_simulator(now))
        changed += [
            f"{k} was {a.get(k, 'not there')} and is {b.get(k, 'not there')}"
            for k in {**a, **b}
            if a.get(k) != b.get(k)
        ]
    known = all_effects()
    for name, mark in library.items():
        if name not in known:
            changed.append(f"the effect {name} is no longer there")
        elif fingerprint(name) != mark:
            changed.append(f"the effect {name} is another one")
    if changed:
        more = f" and {len(changed) - 6} more" if len(changed) > 6 else ""
        raise IncompatibleError(
            f"Since the diagnosis in {path}, {'; '.join(changed[:6])}{more}.",
            "the simulator and library of the earlier diagnosis, whose posterior is the prior of this one",
            "Take the earlier simulator, or diagnose all logs anew without --since.",
        )


def fingerprint(name: str) -> str:
    """Return a mark of an effect that changes with its parameters or its code."""
    effect = all_effects()[name]
    said = [repr(effect.parameters), repr(effect.equations), repr(effect.prior)]
    try:
        said.append(inspect.getsource(effect))
    except (OSError, TypeError):
        said.append(effect.__qualname__)
    return hashlib.sha256("\n".join(said).encode()).hexdigest()[:16]


def seconds(logs: Any) -> float:
    """Return the time that logs hold together, s."""
    total = 0.0
    for log in logs:
        times = log.groupby("trajectory", sort=False)["time"]
        total += float((times.last() - times.first()).sum())
    return total


def _round(found: Diagnosis, logs: list[str], recorded: float) -> Round:
    from .per_log import main_parameter

    parameters = {}
    for cause in found.causes:
        main = main_parameter(cause.effects[0], {k: p.value for k, p in cause.parameters.items()})
        p = cause.parameters[main]
        low, high = (v if abs(v) < float("inf") else None for v in p.ci90)
        parameters[cause.effects[0]] = {
            "parameter": main, "value": p.value, "low": low, "high": high, "unit": p.unit
        }  # fmt: skip
    left = float(found.remainder.get("share", 1.0)) if found.causes else 1.0
    return Round(logs, recorded, found.verdict, _confidences(found), parameters, left)


def _confidences(found: Diagnosis) -> dict[str, float]:
    """Return the confidence of the likeliest candidates; each of several causes may be sure by itself."""
    sure = {c.effect: c.confidence for c in found.candidates[:_SHOWN]}
    for cause in found.causes if found.verdict == "several" else []:
        total = sum(sure.get(name, 0.0) for name in cause.effects)
        sure |= {name: cause.confidence * sure[name] / total for name in cause.effects if sure.get(name, 0.0) > 0.0}
    return dict(sorted(sure.items(), key=lambda item: -item[1]))


def _simulator(params: BenchParameters) -> dict[str, Any]:
    return {
        "name": params.muscle.name,
        "numbers": params.values(),
        "tolerance": dict(params.tolerance),
        "effects": [[name, dict(values)] for name, values in params.effects],
    }


def _parameters(kind: type[BenchParameters], found: Mapping[str, Any]) -> BenchParameters:
    changes: dict[str, Any] = {**found["numbers"], "name": found["name"], "tolerance": found["tolerance"]}
    return kind.for_muscle("B").replace(**changes, effects=tuple((n, dict(v)) for n, v in found["effects"]))


def _flat(found: Mapping[str, Any]) -> dict[str, Any]:
    effects = {f"the simulator's effect {n}": v for n, v in found["effects"]}
    tolerance = {f"the tolerance of {n}": v for n, v in found["tolerance"].items()}
    return {"name": found["name"], **found["numbers"], **tolerance, **effects}
