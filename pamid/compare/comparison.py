"""What a comparison found: one row an estimator, their held-out predictions, and the fitted estimators of one fold."""

import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import pandas as pd

from ..errors import UnknownOptionError
from ..explained import explained_fields
from ..file_sets import replacing_together
from ..files import write_whole
from ..json_data import json_ready

BASELINE = "baseline (mean)"
"""Row of the table that predicts the mean of the training runs."""


@dataclass(frozen=True)
class Score:
    """One estimator in a comparison."""

    estimator: str
    """Its label."""
    rmse: float = math.nan
    rmse_low: float = math.nan
    rmse_high: float = math.nan
    """Root mean square error on unseen runs, with its 90 % interval over runs, in the unit of the target."""
    nrmse: float = math.nan
    """`rmse` over the standard deviation of the target."""
    behind: float = math.nan
    behind_low: float = math.nan
    behind_high: float = math.nan
    """By how much `rmse` exceeds that of the best estimator, with its interval on the same draws."""
    differs: bool = False
    """Whether that interval leaves out zero."""
    fit_seconds: float = math.nan
    """Time of one fit, s, mean over the folds."""
    predict_ms_per_1000: float = math.nan
    """Time to predict 1000 rows, ms."""
    n_parameters: int | None = None
    """Numbers that the fit has set; of those that a sparse fit keeps, the mean over the folds."""
    n_fit_rows: int = 0
    """Rows of the largest fit."""
    error: str = ""
    """Why it failed; empty if it did not."""
    warnings: tuple[str, ...] = ()
    """What it warned of."""

    @property
    def fit(self) -> float:
        """100 % less `nrmse`, as in MATLAB's compare, on unseen runs."""
        return 100.0 * (1.0 - self.nrmse)


@explained_fields
@dataclass
class Comparison:
    """Estimators of one equation, scored on runs unseen by their fits; the best comes first.

    Examples
    --------
    >>> from pamid.bench import BenchParameters, simulate, sine, unfold
    >>> from pamid.compare import compare
    >>> bench = BenchParameters.for_muscle("B")
    >>> table = unfold(simulate(bench, [sine(w, 10.0, 400) for w in (2.0, 4.0, 8.0)]), bench)
    >>> result = compare(table, "force", ["PolynomialForce", "GeometricForce(chou_hannaford)"], cv=3)
    >>> result.best.rmse < result["PolynomialForce(area)"].rmse, result.unit
    (True, 'N')
    """

    equation: Annotated[str, '``"force"``, ``"flow"``, ``"inverse"`` or ``"dynamic"``.']
    unit: Annotated[str, "Unit of the target."]
    scores: Annotated[list[Score], "One per estimator, by increasing error; those that failed last."]
    rows: Annotated[
        pd.DataFrame,
        "The scored rows: ``trajectory``, ``run``, ``time``, ``eps``, ``deps``, ``P``, ``dP`` and ``measured``.",
    ]
    predictions: Annotated[
        dict[str, np.ndarray], "Held-out prediction of each estimator on these rows; shape (n_scored_rows,)."
    ]
    fitted: Annotated[dict[str, Any], "Each estimator as the first fold fitted it."]
    noise_floor: Annotated[
        float, "Root mean square error that sensor noise alone would leave with a perfect model; NaN if not known."
    ]
    n_folds: Annotated[int, "How many."]
    n_runs: Annotated[int, "How many."]
    notes: Annotated[list[str], "What was done to the data."] = field(default_factory=list)

    @property
    def best(self) -> Score:
        """The estimator with the least held-out error."""
        return self.scores[0]

    def __getitem__(self, label: str) -> Score:
        """Return the score of one estimator by its label."""
        for score in self.scores:
            if score.estimator == label:
                return score
        raise UnknownOptionError(
            f"{label!r} was not compared.", f"one of {', '.join(s.estimator for s in self.scores)}", "Correct the name."
        )

    def to_frame(self) -> pd.DataFrame:
        """Return the table: one row per estimator, the columns of `Score` but its warnings, and ``fit`` in per cent."""
        found = pd.DataFrame([asdict(s) for s in self.scores]).drop(columns="warnings")
        found.insert(list(found.columns).index("nrmse") + 1, "fit", [s.fit for s in self.scores])
        return found

    def to_dict(self) -> dict[str, Any]:
        """Return everything but the predictions as plain numbers and text; numbers that are not known are None.

        The keys are ``equation``, ``unit``, ``n_folds``, ``n_runs``, ``n_scored_rows``, ``noise_floor``, ``notes``,
        ``estimators``.
        """
        return {
            "equation": self.equation,
            "unit": self.unit,
            "n_folds": self.n_folds,
            "n_runs": self.n_runs,
            "n_scored_rows": len(self.rows),
            "noise_floor": json_ready(self.noise_floor),
            "notes": list(self.notes),
            "estimators": [json_ready(asdict(s) | {"fit": s.fit}) for s in self.scores],
        }

    def __str__(self) -> str:
        """Return the table as text."""
        header = [
            "estimator", f"rmse / {self.unit}", "90 % interval", "fit / %", "behind the best", "",
            "fit / s", "predict / ms", "parameters",
        ]  # fmt: skip
        lines = [header, *(_cells(s) for s in self.scores if not s.error)]
        widths = [max(len(line[k]) for line in lines) for k in range(len(header))]
        left = {0, 2, 4, 5}
        text = [
            "  ".join(
                c.ljust(w) if k in left else c.rjust(w) for k, (c, w) in enumerate(zip(line, widths, strict=True))
            )
            for line in lines
        ]
        text += [f"{s.estimator}: failed: {s.error}" for s in self.scores if s.error]
        text.append("")
        text.append(
            f"{len(self.rows)} rows of {self.n_runs} runs, each predicted by a fit on the others "
            f"({self.n_folds} folds); intervals over runs; * differs from the best; predict: per 1000 rows"
        )
        if math.isfinite(self.noise_floor):
            text.append(f"noise floor: the sensors' noise alone leaves about {_number(self.noise_floor)} {self.unit}")
        return "\n".join(line.rstrip() for line in [*text, *self.notes])

    def write(self, folder: str | Path) -> list[Path]:
        """Write the table as ``comparison-<equation>.csv`` and ``.json`` into a folder, created if missing; return the
        files.

        Each is written whole or not at all; an `OutputError` says that the folder or a file cannot be written.
        """
        target = Path(folder)
        data = json.dumps(self.to_dict(), indent=2, ensure_ascii=False, allow_nan=False)
        contents = {"csv": self.to_frame().to_csv(index=False), "json": data + "\n"}
        names = {kind: f"comparison-{self.equation}.{kind}" for kind in contents}
        with replacing_together(target, names.values(), parents=True) as stage:
            for kind, text in contents.items():
                write_whole(stage / names[kind], text)
        return [target / name for name in names.values()]


def _cells(s: Score) -> list[str]:
    return [
        s.estimator,
        _number(s.rmse),
        f"{_number(s.rmse_low)} to {_number(s.rmse_high)}",
        f"{s.fit:.2f}",
        "-" if s.behind == 0 else f"{_number(s.behind)} ({_number(s.behind_low)} to {_number(s.behind_high)})",
        "*" if s.differs else "",
        f"{s.fit_seconds:.2f}",
        f"{s.predict_ms_per_1000:.2f}",
        "" if s.n_parameters is None else str(s.n_parameters),
    ]


def _number(value: float) -> str:
    return f"{value:.3g}" if math.isfinite(value) else "-"


def ranked(scores: Mapping[str, Score]) -> list[Score]:
    """Order scores by rising error, failures last."""
    return sorted(scores.values(), key=lambda s: (bool(s.error), s.rmse if math.isfinite(s.rmse) else math.inf))
