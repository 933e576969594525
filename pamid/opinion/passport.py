"""A parameter passport: numbers with intervals, the log on which they hold, what it leaves open; other rigs test it."""

import html
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any, Self

import numpy as np
import pandas as pd

from ..errors import ParameterError, SimulatorFileError, SimulatorNotFoundError, SimulatorSyntaxError
from ..explained import explained_fields
from ..file_sets import replacing_together
from ..names import refuse_others
from ..simulators import Simulator
from ..toml_files import TomlErrors, read_toml, toml_lines
from .estimates import freed, settled
from .judge import LEVEL, NEGLIGIBLE, Opinion

_ERRORS = TomlErrors(SimulatorNotFoundError, SimulatorFileError, SimulatorSyntaxError)
_STYLE = (
    "body{font:15px/1.45 system-ui,sans-serif;max-width:60em;margin:2em auto;padding:0 1em;color:#1b1b1b}"
    "table{border-collapse:collapse;margin:1em 0}td,th{padding:.3em .8em;border-bottom:1px solid #ccc;text-align:left}"
    ".absorbed,.differs{color:#a40000}.open{color:#8a5a00}.holds,.agrees{color:#0a5c1f}"
    "@media(prefers-color-scheme:dark){body{background:#181818;color:#e6e6e6}.absorbed,.differs{color:#ff8a80}"
    ".open{color:#ffd180}.holds,.agrees{color:#9be7a6}}"
)


@dataclass(frozen=True)
class Entry:
    """A number of a passport."""

    value: float
    """As the log has it, beside what was missing."""
    low: float
    high: float
    """Its 90 % interval; infinite where the log does not determine it."""
    unit: str
    """Its unit."""
    status: str
    """See `Judgement`."""
    fitted: float
    """As the tool fitted it."""


@dataclass(frozen=True)
class RigCheck:
    """What another log said of a passport."""

    name: str
    """The log."""
    status: dict[str, str]
    """For each number ``"agrees"``, ``"differs"`` or ``"open"``."""
    values: dict[str, tuple[float, float]]
    """The log's own value and the half width of its 90 % interval."""
    outside: list[str] = field(default_factory=list)
    """Signals that leave the range on which the passport holds."""


@explained_fields
@dataclass(frozen=True)
class Passport:
    """Numbers of a simulator with what a log says about them.

    Examples
    --------
    >>> from pamid.opinion import Passport
    >>> from pamid.opinion.passport import Entry
    >>> known = Passport({"mass": Entry(2.0, 1.98, 2.02, "kg", "holds", 2.01)}, {"F": (-8.0, 8.0)})
    >>> Passport.from_text(known.text()) == known
    True
    """

    numbers: Annotated[dict[str, Entry], "By name."]
    ranges: Annotated[dict[str, tuple[float, float]], "Range of each signal of the log."] = field(default_factory=dict)
    flat: Annotated[list[dict[str, float]], "Directions that the log leaves open: relative weights by name."] = field(
        default_factory=list
    )
    agreement: Annotated[
        float | None, "Probability that the numbers differ as much between its runs by chance; NaN of one run."
    ] = None
    missing: Annotated[list[str], "Effects that the simulator lacked."] = field(default_factory=list)
    log: Annotated[str, "Name of the log."] = ""
    rigs: Annotated[list[RigCheck], "Other logs that it was checked on."] = field(default_factory=list)

    @classmethod
    def of(cls, opinion: Opinion, log: str = "") -> Self:
        """Return the passport that an opinion gives, with the name of its log."""
        numbers = {j.name: Entry(j.value, *j.ci90, j.unit, j.status, j.fitted) for j in opinion.numbers}
        agreement = None if np.isnan(opinion.agreement) else opinion.agreement
        flat = [dict(f.weights) for f in opinion.flat]
        return cls(numbers, dict(opinion.ranges), flat, agreement, list(opinion.missing), log)

    # --- another log ----------------------------------------------------------------------------------------
    def check(self, log: pd.DataFrame, simulator: Simulator, name: str) -> Self:
        """Return the passport with one more `RigCheck`, on another rig's log under a name.

        The simulator has its missing effects, where there were any (``corrected.toml``). A `ParameterError` says that
        the passport names no number that a fit could move, or one that the simulator does not have.
        """
        from scipy.stats import norm

        values, known = {n: e.value for n, e in self.numbers.items() if e.value != 0.0}, simulator.fit_numbers()
        if not values:
            raise ParameterError("The passport holds no number but zeros.", "numbers", "Fit some first.")
        refuse_others(values, known, "The passport has", remedy="Name the simulator of the passport.")
        found = settled(log, freed(simulator, values), list(values))
        z = float(norm.isf(LEVEL / (2.0 * max(len(found.names), 1))))
        open_ = {n for d in found.flat for n, w in d.weights.items() if abs(w) > 0.3}
        status, there = {}, {}
        for n, value, error in zip(found.names, found.values, found.errors, strict=True):
            mine = self.numbers[n]
            own = (mine.high - mine.low) / 3.29 if np.isfinite(mine.high - mine.low) else 0.0
            far = abs(value - mine.value) > z * float(np.hypot(error, own)) + NEGLIGIBLE * abs(mine.value)
            status[n] = "open" if n in open_ else "differs" if far else "agrees"
            there[n] = (float(value), 1.645 * float(error))
        outside = [c for c, (a, b) in self.ranges.items() if c in log and _leaves(log[c], a, b)]
        return replace(self, rigs=[*self.rigs, RigCheck(name, status, there, outside)])

    # --- files ----------------------------------------------------------------------------------------------
    def text(self) -> str:
        """Return the passport as TOML."""
        lines = ["# Parameter passport: what a log supports. Intervals hold 90 %.", "[passport]"]
        lines += toml_lines({"log": self.log, "missing": self.missing})
        lines += [] if self.agreement is None else toml_lines({"agreement_of_runs": self.agreement})
        lines += ["", "[range]", *toml_lines(self.ranges), "", "[numbers]"]
        lines += toml_lines({name: vars(entry) for name, entry in self.numbers.items()})
        for weights in self.flat:
            lines += ["", "[[flat]]", *toml_lines(weights)]
        for rig in self.rigs:
            lines += ["", "[[rigs]]", *toml_lines(vars(rig))]
        return "\n".join(lines) + "\n"

    @classmethod
    def from_text(cls, text: str) -> Self:
        """Return the passport of a TOML text."""
        return cls._of(tomllib.loads(text))

    @classmethod
    def read(cls, path: str | Path) -> Self:
        """Return the passport of a file; raise a `SimulatorFileError` where it cannot be read or is not a passport."""
        return cls._of(read_toml(path, "a passport", _ERRORS))

    @classmethod
    def _of(cls, table: Mapping[str, Any]) -> Self:
        try:
            head = table["passport"]
            return cls(
                {n: Entry(**e) for n, e in table["numbers"].items()},
                {c: (float(a), float(b)) for c, (a, b) in table.get("range", {}).items()},
                [dict(f) for f in table.get("flat", [])],
                head.get("agreement_of_runs"),
                list(head.get("missing", [])),
                str(head.get("log", "")),
                [RigCheck(r["name"], dict(r["status"]), {k: (float(v), float(e)) for k, (v, e) in r["values"].items()},
                     list(r.get("outside", []))) for r in table.get("rigs", [])],
            )  # fmt: skip
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            raise SimulatorSyntaxError(
                f"This is not a passport: {type(error).__name__} {error}.",
                "tables [passport], [range], [numbers]",
                "Name the passport.toml that 'pamid diagnose --after' wrote.",
            ) from None

    def page(self) -> str:
        """Return the passport as a self-contained HTML page."""
        e = html.escape
        rows = [
            f"<tr><td>{e(n)}</td><td>{x.value:.5g} {e(x.unit)}</td><td>{_interval(x)}</td><td>{x.fitted:.5g}</td>"
            f'<td class="{e(x.status)}">{e(x.status)}</td>'
            + "".join(f'<td class="{e(r.status.get(n, ""))}">{_rig(r, n)}</td>' for r in self.rigs) + "</tr>"
            for n, x in self.numbers.items()
        ]  # fmt: skip
        heads = "".join(f"<th>{e(h)}</th>" for h in ("number", "value", "90 % interval", "as fitted", "status"))
        heads += "".join(f"<th>{e(r.name)}</th>" for r in self.rigs)
        said = [f"Log: {e(self.log) or 'unnamed'}."]
        said += [f"Missing in the simulator: {e(', '.join(self.missing))}."] if self.missing else []
        if self.agreement is not None:
            said.append(f"Probability that runs differ as much by chance: {self.agreement:.2g}.")
        open_ = [" with ".join(f"{n} by {100 * w:+.0f} %" for n, w in d.items()) for d in self.flat]
        said += [f"Not determined by this log: changes of {e(text)}." for text in open_]
        said += [f"{e(r.name)} leaves the range of {e(', '.join(r.outside))}." for r in self.rigs if r.outside]
        spans = "".join(f"<tr><td>{e(c)}</td><td>{a:.4g} to {b:.4g}</td></tr>" for c, (a, b) in self.ranges.items())
        return (
            f'<!doctype html><html lang="en"><meta charset="utf-8"><title>Parameter passport</title><style>{_STYLE}'
            f"</style><h1>Parameter passport</h1>{''.join(f'<p>{s}</p>' for s in said)}<table><tr>{heads}</tr>"
            f"{''.join(rows)}</table><h2>Range on which it holds</h2><table><tr><th>signal</th><th>range</th></tr>"
            f"{spans}</table></html>\n"
        )

    def write(self, folder: Path) -> list[Path]:
        """Write ``passport.toml`` and ``passport.html`` into a folder, and return them."""
        texts = self.texts()
        with replacing_together(folder, texts, parents=True) as stage:
            for name, text in texts.items():
                (stage / name).write_text(text, encoding="utf-8")
        return [folder / name for name in texts]

    def texts(self) -> dict[str, str]:
        """Return the contents of its files, by their names."""
        return {"passport.toml": self.text(), "passport.html": self.page()}


def _leaves(values: pd.Series, low: float, high: float) -> bool:
    """Return whether a signal goes beyond a range by more than a tenth of it."""
    room = 0.1 * (high - low)
    return bool(values.min() < low - room or values.max() > high + room)


def _interval(x: Entry) -> str:
    return f"{x.low:.5g} to {x.high:.5g}" if np.isfinite(x.high - x.low) else "not determined by this log"


def _rig(rig: RigCheck, name: str) -> str:
    if name not in rig.values:
        return "–"
    value, half = rig.values[name]
    return f"{value:.4g} ± {half:.2g}, {html.escape(rig.status[name])}"
