"""Small saved models, and files of them that are changed by hand."""

from __future__ import annotations

import json
import zipfile
from pathlib import Path

import numpy as np
import pandas as pd
from sklearn.linear_model import Ridge
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from pamid.persistence import save


def table(n: int = 60) -> tuple[pd.DataFrame, np.ndarray]:
    rng = np.random.default_rng(0)
    X = pd.DataFrame(rng.normal(size=(n, 2)), columns=["eps", "P"])
    return X, X["eps"].to_numpy() * 3 + rng.normal(size=n) * 0.1


def saved(path: Path, estimator: object | None = None) -> Path:
    X, y = table()
    return save(estimator or make_pipeline(StandardScaler(), Ridge()).fit(X, y), path / "model.pamid")


def rewrite(file: Path, change) -> Path:
    """Rewrite the entries of a model file through ``change(entries)``."""
    with zipfile.ZipFile(file) as archive:
        entries = {name: archive.read(name) for name in archive.namelist()}
    change(entries)
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in entries.items():
            archive.writestr(name, data)
    return file


def edit_schema(file: Path, change) -> Path:
    def edit(entries: dict[str, bytes]) -> None:
        schema = json.loads(entries["schema.json"])
        change(schema)
        entries["schema.json"] = json.dumps(schema).encode()

    return rewrite(file, edit)


def attributes(schema: dict) -> dict:
    return schema["content"]["content"]
