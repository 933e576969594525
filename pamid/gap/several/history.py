"""The basis of a later diagnosis: the logs so far, their simulator and library, the rounds.

The posterior of the earlier logs is their likelihood times the prior. It is kept exactly, as the logs themselves, so
that a new hypothesis has its right posterior as well.
"""

from __future__ import annotations

import contextlib
import hashlib
import inspect
import io
import json
import os
import tokenize
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Protocol

import pandas as pd

from ...bench.parameters import BenchParameters
from ...effects import all_effects
from ...errors import IncompatibleError, LogFormatError, LogNotFoundError, PamidError
from ...explained import explained_fields
from ...signals.mapping import LogMapping
from ...signals.readings import impossible
from ...simulators import read_simulator
from ...simulators.catalogue import effect_class
from ...toml_files import TomlErrors, read_small_text
from ..diagnosis.findings import Candidate, Cause
from ..diagnosis.rivals import Rival
from .conditions import Conditions
from .per_log import main_parameter

if TYPE_CHECKING:
    AnySimulator = Any
    """A simulator of the bench or any other: anything with an identity."""

STATE, LOGS = "state.json", "logs.parquet"
_TOLD = frozenset(("parameter", "value", "low", "high", "unit"))
SCHEMA = 2
_ERRORS = TomlErrors(LogNotFoundError, LogFormatError, LogFormatError)
_SHOWN = 6
"""Effects whose confidence a round keeps."""


@dataclass(frozen=True)
class Round:
    """The result of a diagnosis after each further log."""

    logs: list[str]
    """The logs that came with it."""
    seconds: float
    """Time recorded so far, s."""
    verdict: str
    """The verdict."""
    confidences: dict[str, float]
    """Confidence of the likeliest candidates: with several causes in each, otherwise adding to one over the library."""
    parameters: dict[str, dict[str, Any]]
    """For each cause its main parameter: ``parameter``, ``value``, ``low``, ``high``, ``unit``."""
    left: float
    """Share of the gap's power that the named causes leave; 1 where none is named."""


class Answered(Protocol):
    """What a history reads of a diagnosis, and sets."""

    verdict: str
    causes: list[Cause]
    candidates: list[Candidate]
    remainder: dict[str, Any]
    rivals: list[Rival]
    rounds: list[Round]
    history: Any


@explained_fields
@dataclass
class History:
    """The logs so far.

    Examples
    --------
    >>> from pamid.bench import BenchParameters
    >>> from pamid.gap.several import History
    >>> History(BenchParameters.for_muscle("B"), ["leakage", "flow_bias"]).rounds
    []
    """

    simulator: Annotated[AnySimulator, "The simulator, BenchParameters or Simulator."]
    library: Annotated[
        list[str],
        'Effects that may be causes; at ports their names there, such as ``"viscous_friction"`` at every joint.',
    ]
    logs: Annotated[dict[str, pd.DataFrame], "The logs by name."] = field(default_factory=dict)
    held: Annotated[dict[str, Conditions], "Conditions of each."] = field(default_factory=dict)
    rounds: Annotated[list[Round], "The result after each further log."] = field(default_factory=list)
    rivals: Annotated[list[Rival], "Explanations that the last diagnosis left."] = field(default_factory=list)
    page: Annotated[str, "The file that a simulator with ports was read from, so that a later command finds it."] = ""
    columns: Annotated[str, "The mapping that the last log was read with, for a later log."] = ""
    encoding: Annotated[str, "Its encoding, where it was given."] = ""

    def add(self, found: Answered, logs: Mapping[str, pd.DataFrame], held: Sequence[Conditions]) -> None:
        """Add further logs and the diagnosis of all of them."""
        self.logs |= dict(logs)
        self.held |= dict(zip(logs, held, strict=True))
        self.rounds.append(_round(found, list(logs), seconds(self.logs.values())))
        found.rounds, found.history = list(self.rounds), self
        self.rivals = list(found.rivals)

    def write(self, folder: str | Path, home: str | Path | None = None) -> None:
        """Write the basis of a later diagnosis into a folder, which is moved to `home` where that is another one."""
        folder, home, simulator = Path(folder), Path(home or folder), self.simulator.identity()
        at_ports = not self.simulator.library
        page = self.page if "kind" in simulator else ""  # a bench is rebuilt from its identity
        state = {
            "schema": SCHEMA,
            "simulator": {**simulator, **_seen_from(home, page=page)},
            "read": {**_seen_from(home, columns=self.columns), "encoding": self.encoding},
            "library": {name: fingerprint(name, at_ports) for name in self.library},
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


def _seen_from(folder: Path, **files: str) -> dict[str, str]:
    """Return the paths of files as seen from a folder, which may travel with them."""
    return {name: os.path.relpath(file, folder.resolve()) for name, file in files.items() if file}


def read_history(
    folder: str | Path, simulator: AnySimulator | None = None, *, read: Callable[[str], AnySimulator] | None = None
) -> History:
    """Read the history that an earlier diagnosis wrote.

    Parameters
    ----------
    folder : path-like
        What ``--out`` of the earlier diagnosis named.
    simulator : BenchParameters or Simulator, optional
        The simulator of today, which must be that of the earlier one.
    read : callable, optional
        Reads the file of the earlier simulator where none is given and it was not of the bench;
        `pamid.simulators.read_simulator` by default.

    Returns
    -------
    History
        The logs so far.

    Raises
    ------
    LogNotFoundError, LogFormatError
        The folder holds no earlier diagnosis.
    IncompatibleError
        Simulator or library changed since; the message says what.
    UntrustedCodeError
        The earlier simulator is code that is not trusted.

    Examples
    --------
    >>> import tempfile
    >>> import pamid
    >>> from pamid.bench import sine
    >>> from pamid.gap.several import read_history
    >>> bench = pamid.BenchParameters.for_muscle("B")
    >>> log = pamid.simulate(bench, [sine(2, 10, 800)], effects=["leakage"], seed=0)
    >>> found = pamid.diagnose(log, bench, ["leakage", "flow_bias"])
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     found.history.write(folder)
    ...     read_history(folder).library
    ['leakage', 'flow_bias']
    """
    path = Path(folder)
    if not (path / STATE).is_file() or not (path / LOGS).is_file():
        raise LogNotFoundError(
            f"{path} holds no {STATE if not (path / STATE).is_file() else LOGS}.",
            "the output folder of an earlier 'pamid diagnose'",
            "Name that folder.",
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
            f"{STATE} or {LOGS} of {path} has changed since, or is from another version.",
            "both files as the same diagnosis wrote them",
            "Diagnose the logs anew.",
        )
    try:
        then = state["simulator"]
        said = state.get("read", {})
        page, columns = (os.path.normpath(path / p) if p else "" for p in (then.get("page"), said.get("columns")))
        held = {str(e["name"]): Conditions(dict(e["conditions"]), str(e["day"])) for e in state["logs"]}
        rounds = [_read_round(r) for r in state["rounds"]]
        library = {str(k): str(v) for k, v in state["library"].items()}
        table = _table(path / LOGS, "kind" not in then)
        logs = {name: table[table["log"] == name].drop(columns="log").reset_index(drop=True) for name in held}
        if not held or any(log.empty for log in logs.values()):
            raise ValueError("a log has no rows")
        if any(e["rows"] != len(logs[str(e["name"])]) for e in state["logs"]):
            raise ValueError("a log has another number of rows")
        now = simulator if simulator is not None else _simulator_of(then, page, read)
        rivals = [_rival(r, not now.library) for r in state["rivals"]]
        changed = _changed(then, now, library)
    except PamidError:
        raise
    except (ValueError, KeyError, TypeError, AttributeError, OSError) as error:
        raise _broken(path, error) from None
    if changed:
        more = f" and {len(changed) - 6} more" if len(changed) > 6 else ""
        raise IncompatibleError(
            f"Since the diagnosis in {path}, {'; '.join(changed[:6])}{more}.",
            "the simulator and library of the earlier diagnosis, whose posterior is the prior of this one",
            "Take the earlier simulator, or diagnose all logs anew without --since.",
        )
    return History(now, list(library), logs, held, rounds, rivals, page, columns, str(said.get("encoding", "")))


def _simulator_of(then: Mapping[str, Any], page: str, read: Callable[[str], AnySimulator] | None) -> AnySimulator:
    """Return the simulator of an earlier diagnosis: the bench's numbers, or the file that it was read from."""
    if "kind" not in then:
        changes = {**then["numbers"], "name": then["name"], "tolerance": then["tolerance"]}
        return BenchParameters.for_muscle("B").replace(
            **changes, effects=tuple((n, dict(v)) for n, v in then["effects"])
        )
    if not page or not Path(page).is_file():
        raise LogNotFoundError(
            f"The simulator of the earlier diagnosis {f'({page}) does not exist' if page else 'was made in Python'}.",
            "the simulator file of the earlier diagnosis",
            "Name it with --sim.",
        )
    return (read or read_simulator)(page)


def _broken(path: Path, error: Exception) -> LogFormatError:
    return LogFormatError(
        f"The diagnosis in {path} cannot be continued: {type(error).__name__}: {str(error)[:200]}.",
        f"{STATE} and {LOGS} as 'pamid diagnose' wrote them",
        "Diagnose the logs anew.",
    )


def _read_round(found: Mapping[str, Any]) -> Round:
    told = Round(**found)
    for name, said in told.parameters.items():
        if missing := _TOLD - said.keys():
            raise KeyError(f"{name} has no {', '.join(sorted(missing))}")
    return told


def _rival(found: Mapping[str, Any], at_ports: bool) -> Rival:
    rival = Rival.from_dict(found)
    for name, values in rival.effects.items():
        known = {p.name for p in effect_class(name, at_ports).parameters}
        if not (values.keys() <= known if "@" in name else values.keys() == known):
            raise ValueError(f"{name} has other parameters")
    return rival


def _mark(state: Mapping[str, Any], logs: Path) -> str:
    """Return a hash of a state and its logs: an edited state is not a posterior."""
    text = json.dumps(state, sort_keys=True)
    return hashlib.sha256(text.encode() + hashlib.sha256(logs.read_bytes()).digest()).hexdigest()


def _table(path: Path, bench: bool) -> pd.DataFrame:
    """Read logs like any log: within the memory limit, and only possible readings."""
    from pandas.api.types import is_numeric_dtype

    from ...signals.formats.parquet import FORMAT
    from ...signals.log import MAX_BYTES

    frame = FORMAT.read(path, LogMapping(), MAX_BYTES)[0][0].frame
    if lacking := {"trajectory", "time", "log", *(("q",) if bench else ())} - set(frame.columns):
        raise KeyError(f"the logs have no {', '.join(sorted(lacking))}")
    for name in (str(c) for c in frame.columns if c not in ("trajectory", "log")):
        if not is_numeric_dtype(frame[name]) or (bench and impossible(name, frame[name].to_numpy(dtype=float)).any()):
            raise ValueError(f"{name} contains values that are not readings")
    return frame


def _changed(then: Mapping[str, Any], now: AnySimulator, library: Mapping[str, str]) -> list[str]:
    """Return the differences between the simulator and library of an earlier diagnosis and today's."""
    a, b = _flat(then), _flat(now.identity())
    changed = [f"{k} was {a.get(k, 'absent')} and is {b.get(k, 'absent')}" for k in {**a, **b} if a.get(k) != b.get(k)]
    for name, mark in library.items():
        try:
            if fingerprint(name, not now.library) != mark:
                changed.append(f"the effect {name} differs")
        except KeyError:
            changed.append(f"the effect {name} is no longer there")
    return changed


def fingerprint(name: str, at_ports: bool) -> str:
    """Return a hash of an effect's parameters and code; its form at ports may take a part of the library's."""
    effect, library = effect_class(name, at_ports), all_effects().values()
    numbers = [replace(p, description="") for p in effect.parameters]
    said = [repr(numbers), repr(effect.equations), repr(effect.prior)]
    for part in [c for c in effect.__mro__ if c is effect or c in library]:
        for own in vars(part).values():
            own = getattr(own, "fget", getattr(own, "__func__", own))
            if inspect.isfunction(own):
                with contextlib.suppress(OSError, TypeError):  # where there is no source, its name has to do
                    said.append(_bare(inspect.getsource(own)))
        said.append(part.__qualname__)
    return hashlib.sha256("\n".join(said).encode()).hexdigest()[:16]


def _bare(source: str) -> str:
    """Return code without comments and docstrings, which change no answer."""
    found, fresh = [], True
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type in (tokenize.COMMENT, tokenize.NL):
            continue
        if not (fresh and token.type == tokenize.STRING):
            found.append(token.string)
        fresh = token.type in (tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT)
    return " ".join(found)


def seconds(logs: Any) -> float:
    """Return the total time of logs, s."""
    total = 0.0
    for log in logs:
        times = log.groupby("trajectory", sort=False)["time"]
        total += float((times.last() - times.first()).sum())
    return total


def _round(found: Answered, logs: list[str], recorded: float) -> Round:
    parameters = {}
    for cause in found.causes:
        kind = effect_class(cause.effects[0], bool(cause.where))
        main = main_parameter(kind, {k: p.value for k, p in cause.parameters.items()})
        p = cause.parameters[main]
        low, high = (v if abs(v) < float("inf") else None for v in p.ci90)
        parameters[_said(cause.effects[0], cause.where[0] if cause.where else "")] = {
            "parameter": main, "value": p.value, "low": low, "high": high, "unit": p.unit
        }  # fmt: skip
    left = float(found.remainder.get("share", 1.0)) if found.causes else 1.0
    return Round(logs, recorded, found.verdict, _confidences(found), parameters, left)


def _confidences(found: Answered) -> dict[str, float]:
    """Return the confidence of the likeliest candidates; each of several causes may be sure by itself."""
    sure = {_said(c.effect, c.where): c.confidence for c in found.candidates[:_SHOWN]}
    for cause in found.causes if found.verdict == "several" else []:
        ports = cause.where or ("",) * len(cause.effects)
        names = [_said(*at) for at in zip(cause.effects, ports, strict=True)]
        total = sum(sure.get(name, 0.0) for name in names)
        sure |= {name: cause.confidence * sure[name] / total for name in names if sure.get(name, 0.0) > 0.0}
    return dict(sorted(sure.items(), key=lambda item: -item[1]))


def _said(name: str, where: str) -> str:
    """Return an effect with its port, if it has one, as text."""
    return f"{name} at {where}" if where else name


def _flat(found: Mapping[str, Any]) -> dict[str, Any]:
    effects = {f"the simulator's effect {n}": v for n, v in found["effects"]}
    tolerance = {f"the tolerance of {n}": v for n, v in found["tolerance"].items()}
    ports = {f"the port {n}": v for n, v in found.get("ports", {}).items()}
    return {"name": found["name"], **found["numbers"], **tolerance, **effects, **ports}
