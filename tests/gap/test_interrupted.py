"""An answer before the search has ended: what is said so far, and what stands where somebody does not wait for more."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from pamid import report
from pamid.cli import main
from pamid.gap import diagnose_simulator, engine
from pamid.gap.diagnosis.result import Diagnosis
from pamid.gap.inference.competition import Competition
from pamid.gap.inference.so_far import INTERRUPTED, SoFar
from pamid.gap.residuals import part
from pamid.gap.residuals.part import part_of, to_search
from pamid.gap.simulated import evidence_of
from pamid.report.sentences import verdict
from pamid.simulators import FunctionSimulator, Port

PORTS = [
    Port("F", "input", "N"), Port("x", "state", "m"), Port("v", "state", "m/s"), Port("y", "state", "m"),
    Port("w", "state", "m/s"), Port("G", "input", "N"),
]  # fmt: skip
FRICTION = 3.0  # N s/m, which the simulator lacks on the first of two rails


class Rails(FunctionSimulator):
    """Two carts on rails of their own, asked one instant at a time."""

    one_by_one = True


RAILS = Rails(lambda t, x, u, p: [x.v, u.F / p.m, x.w, u.G / p.m], PORTS, {"m": (2.0, 0.05, "kg")})
LIBRARY = ["viscous_friction", "quadratic_drag", "actuator_gain", "coulomb_friction", "maxwell"]


def moved(force: np.ndarray, friction: float, dt: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the way and speed of a cart under a force that is held from row to row."""
    x, v, fine = np.zeros(len(force)), np.zeros(len(force)), dt / 8
    for k, f in enumerate(force[:-1]):
        x[k + 1], v[k + 1] = x[k], v[k]
        for _ in range(8):
            middle = v[k + 1] + 0.5 * fine * (f - friction * v[k + 1]) / 2.0
            v[k + 1] += fine * (f - friction * middle) / 2.0
            x[k + 1] += fine * middle
    return x, v


@pytest.fixture(scope="module")
def log() -> pd.DataFrame:
    rng, dt, runs = np.random.default_rng(0), 0.01, []
    for k in range(3):
        t = np.arange(600) * dt
        F, G = (5 * np.sin((a + k) * t) + 3 * np.sin(b * t) for a, b in ((1.0, 0.7), (1.3, 2.1)))
        (x, v), (y, w) = moved(F, FRICTION, dt), moved(G, 0.0, dt)
        names, values = ("x", "v", "y", "w"), (x, v, y, w)
        sizes = (1e-5, 1e-3, 1e-5, 1e-3)
        noisy = {n: z + s * rng.standard_normal(len(t)) for n, z, s in zip(names, values, sizes, strict=True)}
        runs.append(pd.DataFrame({"trajectory": str(k), "time": t, "F": F, "G": G, **noisy}))
    return pd.concat(runs, ignore_index=True)


def stopping(word: str, kind: type[KeyboardInterrupt] = KeyboardInterrupt) -> Callable[[str], None]:
    """Return a progress that interrupts the search at the first step that holds a word."""
    done = []

    def step(text: str) -> None:
        if word in text and not done:
            done.append(text)
            raise kind

    return step


def named(d: Diagnosis) -> list[tuple[str, str]]:
    return [(c.effects[0], c.where[0]) for c in d.causes]


def test_what_is_known_is_said_before_the_search_has_ended(log: pd.DataFrame) -> None:
    told: list[str] = []
    found = diagnose_simulator(log, RAILS, LIBRARY, progress=told.append)
    assert named(found) == [("viscous_friction", "x")] and INTERRUPTED not in found.notes
    so_far = [k for k, text in enumerate(told) if isinstance(text, SoFar)]
    assert "residuals exceed the noise: x " in told[so_far[0]] and "viscous friction at x" in told[so_far[1]]
    assert so_far[1] < next(k for k, text in enumerate(told) if "sensitivity to maxwell" in text)
    assert "viscous friction at x, which closes" in told[so_far[-1]]


@pytest.mark.parametrize(
    "word", ["refit with", "sensitivity to maxwell", "learn what could", "compare sets of effects", "look for a change"]
)
def test_the_best_answer_so_far_stands_where_somebody_interrupts(log: pd.DataFrame, word: str) -> None:
    found = diagnose_simulator(log, RAILS, LIBRARY, progress=stopping(word))
    assert INTERRUPTED in found.notes
    if word != "refit with":  # before the first refit nothing is known but that there is a gap
        assert named(found) == [("viscous_friction", "x")] and found.corrected is not None
        assert not found.remainder  # it takes a while, and can lack
        assert found.causes[0].parameters["coefficient"].value == pytest.approx(FRICTION, rel=0.05)
    elif not found.causes:
        assert verdict(found) == "A gap whose cause is not found yet" and "in the library" not in str(found)
    assert found.gap


@pytest.mark.parametrize("word", ["sensitivity to maxwell", "learn what could"])
def test_several_logs_have_a_best_answer_so_far_too(log: pd.DataFrame, word: str) -> None:
    told: list[str] = []
    stop = stopping(word)
    both = {"first": log[log.trajectory != "2"], "second": log[log.trajectory == "2"]}
    found = diagnose_simulator(both, RAILS, LIBRARY, progress=lambda text: (told.append(text), stop(text)))
    assert INTERRUPTED in found.notes and named(found) == [("viscous_friction", "x")]
    assert not any("could be explained of second" in text for text in told)


@pytest.mark.parametrize("step", ["with_steps", "by_running", "decide", "answer"])
def test_an_answer_is_written_down_where_somebody_interrupts_that(
    step: str, log: pd.DataFrame, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole, asked = getattr(engine, step), []

    def stopped(*args: object) -> object:
        asked.append(step)
        if len(asked) == 1:
            raise KeyboardInterrupt
        return whole(*args)

    monkeypatch.setattr(engine, step, stopped)
    found = diagnose_simulator(log, RAILS, LIBRARY[:1])
    assert found.interrupted == (step in ("with_steps", "by_running"))  # the search, not what it found
    assert named(found) == [("viscous_friction", "x")] and found.closure and found.corrected is not None


def test_who_interrupts_a_search_waits_for_no_other(log: pd.DataFrame, monkeypatch: pytest.MonkeyPatch) -> None:
    asked = list[str]()
    for step in ("with_steps", "by_running"):
        monkeypatch.setattr(engine, step, lambda *_, step=step: asked.append(step))
    found = diagnose_simulator(log, RAILS, LIBRARY, progress=stopping("refit with"))
    assert found.interrupted and not asked


def test_who_ends_the_process_wants_no_answer(log: pd.DataFrame) -> None:
    class Ended(KeyboardInterrupt):
        pass

    with pytest.raises(Ended):
        diagnose_simulator(log, RAILS, LIBRARY, progress=stopping("sensitivity to maxwell", Ended))


def test_nothing_is_known_before_readings_are_compared(log: pd.DataFrame, monkeypatch: pytest.MonkeyPatch) -> None:
    def stop(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(Competition, "_begun", stop)
    with pytest.raises(KeyboardInterrupt):
        diagnose_simulator(log.assign(v=1.2 * log["v"]), RAILS, ["sensor_gain"])


@pytest.mark.parametrize("what", ["search", "report"])
def test_the_command_writes_what_it_has(
    what: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], log: pd.DataFrame
) -> None:
    def stop(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(*((Competition, "_settled", stop) if what == "search" else (report, "report_html", stop)))
    log.to_csv(tmp_path / "log.csv", index=False)
    (tmp_path / "rails.toml").write_text(
        'kind = "equations"\n[equations]\n"dx/dt" = "v"\n"dv/dt" = "F/m"\n"dy/dt" = "w"\n"dw/dt" = "G/m"\n'
        '[parameters]\nm = { value = 2.0, tolerance = 0.05, unit = "kg" }\n[ports]\n'
        'F = { kind = "input", unit = "N" }\nG = { kind = "input", unit = "N" }\n'
        'x = { kind = "state", unit = "m" }\nv = { kind = "state", unit = "m/s" }\n'
        'y = { kind = "state", unit = "m" }\nw = { kind = "state", unit = "m/s" }\n'
    )
    where = ["--sim", str(tmp_path / "rails.toml"), "--out", str(tmp_path / "out")]
    code = main(["diagnose", str(tmp_path / "log.csv"), *where, "--effects", "viscous_friction,quadratic_drag"])
    told = capsys.readouterr()
    assert code == 0 and "viscous friction" in told.out.splitlines()[0]
    assert ("The search was interrupted" in " ".join(told.out.split())) == (what == "search")
    assert (tmp_path / "out" / "report.html").exists() == (what == "search")
    assert (tmp_path / "out" / "diagnosis.json").exists()
    assert "so far" in told.err


def test_residuals_that_differ_in_clocks_alone_are_asked_for_once(log: pd.DataFrame) -> None:
    evidence = evidence_of(log, RAILS)
    spec = {"viscous_friction@x": {"coefficient": 1.0}}
    asked: list[int] = []
    inner = evidence._residual
    evidence._residual = lambda *a, **k: (asked.append(1), inner(*a, **k))[1]  # type: ignore[method-assign]
    found = [evidence.z(spec, {"timing of F": share, "m": 0.0}) for share in (0.0, 0.3, -0.2)]
    assert len(asked) == 1
    straight = evidence.white(evidence.skews["timing of F"] / evidence.noise)
    np.testing.assert_allclose(found[1] - found[0], 0.3 * straight, atol=1e-9)
    evidence.z(spec, {"m": 0.1})
    assert len(asked) == 2


def test_a_part_of_a_long_log_names_what_the_whole_does(log: pd.DataFrame, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(part, "MOST_ANSWERS", 1200)
    whole = evidence_of(log, RAILS)
    some = to_search(whole)  # type: ignore[arg-type]
    assert some.log.n == 600 and some.equations == whole.equations
    for name, place in whole.placements.items():
        assert place.scales == some.placements[name].scales
    found = diagnose_simulator(log, RAILS, LIBRARY)
    assert named(found) == [("viscous_friction", "x")]
    assert found.causes[0].parameters["coefficient"].value == pytest.approx(FRICTION, rel=0.03)
    assert any("searched for in 600 rows and fitted to 1,800" in text for text in found.notes)
    assert len(found.trajectories) == 3


def test_a_part_keeps_to_runs_and_their_order() -> None:
    simple = part_of(evidence_log(), 90, 3)
    assert simple.names == ["a from 0 s", "a from 0.3 s", "b from 0 s"]
    assert simple.channels["x"][simple.starts].tolist() == [0.0, 30.0, 100.0] and simple.n == 90


def evidence_log() -> object:
    from pamid.simulators.port_log import PortLog

    t = np.concatenate([0.01 * np.arange(100), 0.01 * np.arange(80)])
    return PortLog({"x": np.arange(180.0)}, t, np.array([0, 100]), 0.01, ["a", "b"])
