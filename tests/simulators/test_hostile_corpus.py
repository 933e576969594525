"""Hostile and broken simulators of every kind: refused in a line, within limits, and nothing of them ran."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks import hostile_simulators as hostile
from pamid.simulators import mujoco_loading

pytest.importorskip("mujoco")
pytest.importorskip("control")


def test_the_corpus_is_large_and_of_every_kind() -> None:
    cases = hostile.corpus()
    assert len(cases) >= 100 and len({case.name for case in cases}) == len(cases)
    assert {case.kind for case in cases} == {"mujoco", "function", "equations", "control", "fmu", "bench"}


@pytest.mark.slow
@pytest.mark.parametrize("kind", hostile.KINDS, ids=lambda kind: kind.__name__)
def test_each_is_refused_or_told(kind, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mujoco_loading, "SECONDS", 3)  # of the 30 that a model which never ends compiling may take
    ends = {}
    for k, case in enumerate(kind()):
        (tmp_path / str(k)).mkdir()
        ends[case.name] = hostile.judged(case, tmp_path / str(k))
    assert {name: said for name, said in ends.items() if said not in hostile.GOOD} == {}


def test_a_healthy_simulator_is_not_called_hostile(tmp_path: Path) -> None:
    page = 'kind = "equations"\n[equations]\ny = "0.1*u"\n[ports]\nu = { kind = "input" }\ny = { kind = "output" }\n'
    said = hostile.judged(hostile.Hostile("equations", "healthy", {"sim.toml": page}), tmp_path)
    assert said.startswith("silent: {")  # an answer, which no hostile one gives
