"""Logs and pages of every kind of system."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from pamid.systems.muscle import Muscle

T = np.arange(0, 6, 0.01)
AREA = np.pi / 4 * 0.025**2


def moved(k: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return stroke (m), speed and gauge pressure (Pa) of a run."""
    w = 1.0 + 0.7 * k
    return 0.02 * np.sin(w * T), 0.02 * w * np.cos(w * T), 2e5 + 5e4 * k + 8e4 * np.sin(0.6 * w * T + k)


def _cylinder() -> pd.DataFrame:
    rng, runs = np.random.default_rng(0), []
    for k in range(3):
        x, v, p = moved(k)
        F = AREA * p + 6 * np.tanh(v / 1e-3) + 0.2 * rng.standard_normal(len(T))
        P = 101_325 + p + 50 * rng.standard_normal(len(T))
        runs.append(pd.DataFrame({"trajectory": f"run-{k}", "time": T, "x": x, "P": P, "F": F}))
    return pd.concat(runs, ignore_index=True)


@pytest.fixture
def cylinder() -> pd.DataFrame:
    return _cylinder()


@pytest.fixture(scope="session")
def written_once(tmp_path_factory):
    tmp_path = tmp_path_factory.mktemp("systems")
    _cylinder().to_csv(tmp_path / "cylinder.csv", index=False)
    (tmp_path / "cylinder.toml").write_text('kind = "cylinder"\n[cylinder]\nbore = "25 mm"\n')
    page = Muscle(rest_length=0.2, rest_diameter=0.02)
    muscle, joint = [], []
    for k in range(3):
        x, v, p = moved(k)
        log = pd.DataFrame({"trajectory": f"run-{k}", "time": T, "eps": 0.08 + 2 * x, "P": 101_325 + p, "F": 0.0})
        log["F"] = page.problem(log).nominal(page.problem(log).X) + 3 * np.sign(v)
        muscle.append(log)
        q = 20 * x
        drive = 0.5 * np.sin(q) + 0.1 * np.tanh(v / 1e-3) + 1e-3 * np.random.default_rng(k).standard_normal(len(T))
        joint.append(pd.DataFrame({"trajectory": f"run-{k}", "time": T, "q": q, "drive": drive}))
    pd.concat(muscle).to_csv(tmp_path / "muscle.csv", index=False)
    pd.concat(joint).to_csv(tmp_path / "joint.csv", index=False)
    (tmp_path / "muscle.toml").write_text(
        'kind = "muscle"\n[muscle]\nrest_length = "200 mm"\nrest_diameter = "20 mm"\n'
    )
    (tmp_path / "joint.toml").write_text('kind = "joint"\n[joint]\ninertia = "fit"\n')
    return tmp_path


@pytest.fixture
def files(written_once, tmp_path):
    """A log and a page of each kind, in a folder of the test's own."""
    return Path(shutil.copytree(written_once, tmp_path, dirs_exist_ok=True))
