"""The causes that a diagnosis has written, as effects of a model."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

from ..errors import ParameterError
from ..requirements import WithLaws
from .common import note

Causes = list[tuple[list[str], list[dict[str, float]]]]
"""Names of the effects of each class, and the parameters of each of them."""


def read_causes(folder: str) -> Causes:
    """Read the causes of the ``diagnosis.json`` in a folder."""
    path = Path(folder) / "diagnosis.json"
    try:
        causes = json.loads(path.read_text(encoding="utf-8"))["causes"]
        return [
            (
                [str(name) for name in cause["effects"]],
                [
                    {k: float(v["value"]) for k, v in found.items()}
                    for found in (cause["parameters"], *cause.get("others", ()))
                ],
            )
            for cause in causes
        ]
    except OSError as error:
        raise ParameterError(
            f"{path} cannot be read: {error.strerror}.",
            "the folder that 'pamid diagnose LOG --sim SIM.toml --out DIR' has written",
            "Correct --diagnosis.",
        ) from None
    except (ValueError, KeyError, TypeError, AttributeError):
        raise ParameterError(
            f"{path} holds no causes as pamid writes them.", "the file of 'pamid diagnose'", "Diagnose the log again."
        ) from None


def hybrid_for(equation: str | None) -> str:
    """Return the hybrid model that holds such causes."""
    return "ThermodynamicPIHM" if equation == "flow" else "StaticPIHM"


def hold_causes(estimator: Any, causes: Causes, args: argparse.Namespace) -> None:
    """Give the causes to an estimator as its effects, and say which it cannot hold."""
    from ..effects._terms import of_causes

    equations = {law.equation for law in estimator.laws()} if isinstance(estimator, WithLaws) else set()
    if "effects" not in estimator.get_params() or not equations:
        raise ParameterError(
            f"--diagnosis is given, and {args.estimator} has no effects.",
            "a hybrid model: StaticPIHM, ThermodynamicPIHM",
            "Leave --estimator out, or name one of them.",
        )
    held, left = of_causes(causes, equations)
    estimator.set_params(effects={e.name: dict(e.values) for e in held} or None)
    if left:
        note(args, f"{args.estimator} cannot hold {', '.join(left)}: its network takes what depends on the state")
    if not held:
        note(args, "nothing of the diagnosis acts in this equation; the model is fitted without effects")
