"""The check on users' own simulators: a system is the same in each form, integrators agree, files compare."""

import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]
if not (ROOT / "benchmarks" / "_own").is_dir():
    pytest.skip("needs the repository", allow_module_level=True)
sys.path.append(str(ROOT))

from benchmarks import _answers  # noqa: E402
from benchmarks._own import commute, logs, practice, shorter, systems  # noqa: E402

EACH = pytest.mark.parametrize("system", systems.SYSTEMS, ids=lambda s: s.name)


def numbers(system):
    return {k: v for k, (v, _, _) in system.numbers.items()}


def spread_states(system, n=40):
    rng = np.random.default_rng(1)
    start = system.start(rng, n, numbers(system)) if system.start else rng.uniform(-1.0, 1.0, (len(system.states), n))
    return start * rng.uniform(0.7, 1.3, start.shape) + 1e-3, rng.uniform(-0.9, 0.9, (len(system.inputs), n))


@EACH
def test_every_form_of_a_system_has_the_same_rates(system):
    x, u = spread_states(system)
    p = numbers(system)
    rates = []
    with tempfile.TemporaryDirectory() as folder:
        for way in ("function", "equations", "mujoco"):
            made = systems.simulator_of(system, p, way, Path(folder))
            order = [system.mujoco.get(n, n) for n in system.states] if way == "mujoco" and system.model else None
            order = [made.states.index(n) for n in order or system.states]
            given, state = np.zeros((len(made.inputs), x.shape[1])), np.zeros_like(x)
            given[: len(u)], state[order] = u, x
            values = np.array([q.value for q in made.parameters.values()])[:, None] * np.ones(x.shape[1])
            rates.append(made.rate(np.zeros(x.shape[1]), state, given, values)[order])
    np.testing.assert_allclose(rates[1], rates[0], rtol=1e-9)
    np.testing.assert_allclose(rates[2], rates[0], rtol=2e-6, atol=1e-6 * np.abs(rates[0]).max())


@EACH
def test_integrators_agree_with_each_other_as_far_as_their_steps_allow(system):
    how = logs.Recording(system.dt, 150, 2, "adaptive", True, 1.0, 0.0)
    ways = {}
    for integrator in logs.INTEGRATORS:
        rng = np.random.default_rng(2)
        ways[integrator], _ = logs.simulated(system, numbers(system), replace(how, integrator=integrator), rng)
    span = np.ptp(ways["adaptive"], axis=(0, 2))[:, None]
    assert np.all(np.abs(ways["runge-kutta"] - ways["adaptive"]) <= 2e-4 * span)
    off = np.abs(ways["euler"] - ways["adaptive"]) / span
    assert (off.max() < 2e-4) if system.euler is None else (1e-6 < off.max() < 0.1)


def test_two_revisions_are_compared_case_by_case(tmp_path):
    for name, right in (("a", True), ("b", False)):
        _answers.keep(tmp_path / name, "one", {"said": name, "right": right, "cpu": 1.0})
        _answers.keep(tmp_path / name, "two", {"said": "same", "right": True, "cpu": 1.0})
    told = "\n".join(_answers.compared(tmp_path / "a", tmp_path / "b"))
    assert "WORSE  one" in told
    assert "two," not in told
    assert told.endswith("2 cases in both, 0 better, 1 worse; 2 -> 2 s of CPU")


def test_a_case_that_takes_too_long_is_ended_and_the_others_are_not():
    import time

    jobs = [("slow", lambda: time.sleep(60.0) or {}), ("quick", lambda: {"said": "yes"}), ("broken", lambda: 1 / 0)]
    found = dict(_answers.each(jobs, limit=2.0, workers=3))
    assert found["slow"]["error"] == "no answer in time"
    assert found["quick"]["said"] == "yes"
    assert "ZeroDivisionError" in found["broken"]["error"]


def test_a_lag_at_the_input_and_at_the_reading_of_a_linear_system_commute():
    for plant in commute.LINEAR:
        system, port, reading = commute.PLANTS[plant]
        how = logs.Recording(system.dt, 200, 2, "runge-kutta", False, 1.0, 0.0)
        k, tau = list(system.states).index(reading), 3.0 * system.dt
        late, _ = logs.simulated(commute.lagged(system, port, tau), numbers(system), how, np.random.default_rng(3))

        def read(t, x, u, p, system=system, reading=reading, tau=tau):
            return [*system.rates(t, x, u, p), (getattr(x, reading) - x.late) / tau]

        states = {**system.states, "late": "-"}
        start = commute.lagged(system, port, tau).start
        behind = replace(system, states=states, rates=read, start=start)
        seen, _ = logs.simulated(behind, numbers(system), how, np.random.default_rng(3))
        np.testing.assert_allclose(late[:, k], seen[:, -1], atol=1e-4 * np.ptp(seen[:, -1]))


def test_an_answer_with_a_shorter_library_is_the_same_in_as_far_as_it_could_be():
    def said(verdict, *classes):
        return {"verdict": verdict, "causes": [{"names": c} for c in classes]}

    both, one, other = said("class", ["a@x", "b@y"]), said("cause", ["a@x"]), said("cause", ["b@y"])
    assert shorter.same(both, one, {"a@x"})
    assert shorter.same(both, other, {"a@x", "b@y"})
    assert not shorter.same(one, other, {"b@y"})
    assert not shorter.same(one, said("several", ["a@x"], ["b@y"]), {"a@x", "b@y"})
    assert not shorter.same(one, said("none"), {"a@x"})


def test_practice_logs_are_skipped_in_a_sentence_where_they_are_absent(capsys):
    practice.FOLDER[:] = [Path("nowhere")]
    assert practice.jobs(6, 0) == []
    assert "skipped practice" in capsys.readouterr().out
