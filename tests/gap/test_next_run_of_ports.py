"""The next run of any simulator: its inputs within limits, changes of the rig, and how much the choice matters."""

import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

import pamid
from pamid.cli import main
from pamid.errors import ExcitationError, ParameterError
from pamid.gap import settings
from pamid.gap.design.known import cleaned
from pamid.gap.design.port_family import PortLimits, PortRun, Wave
from pamid.gap.design.search import plan_next
from pamid.gap.diagnosis.rivals import Rival
from pamid.gap.simulated import evidence_of
from pamid.report.next_run import headroom, summary
from pamid.simulators import FunctionSimulator, Port
from pamid.simulators.play_runs import played
from pamid.systems.cylinder import Cylinder

PORTS = [Port("F", "input", "N"), Port("x", "state", "m"), Port("v", "state", "m/s")]
RAIL = FunctionSimulator(lambda t, x, u, p: [x.v, u.F / p.m], PORTS, {"m": (2.0, 0.05, "kg")})
LIBRARY = ["viscous_friction", "coulomb_friction", "quadratic_drag"]


def recorded(force: np.ndarray, seed: int, viscous: float = 0.0, dry: float = 0.0, speed: float = 0.0) -> pd.DataFrame:
    """A mass on a rail under a force, finely integrated; dry friction or viscous friction brakes it."""
    rng, t = np.random.default_rng(seed), np.arange(len(force)) * 0.01
    x, v = [0.0], [speed]
    for f in force[:-1]:
        now = v[-1]
        for _ in range(10):
            now += 0.001 * (f - viscous * now - dry * np.tanh(now / 1e-3)) / 2.0
        v.append(now)
        x.append(x[-1] + 0.005 * (v[-1] + v[-2]))
    noisy = {"x": x + 1e-4 * rng.standard_normal(len(t)), "v": v + 2e-2 * rng.standard_normal(len(t))}
    return pd.DataFrame({"trajectory": f"{seed}", "time": t, "F": force, **noisy})


@pytest.fixture(scope="module")
def open_case():
    """Weak motion about one speed: what brakes could be one friction or another."""
    t = np.arange(600) * 0.01
    logs = [recorded(0.8 + 0.05 * np.sin(w * t), k, viscous=0.8, speed=1.0) for k, w in enumerate((2.0, 3.0))]
    return pamid.diagnose(pd.concat(logs, ignore_index=True), RAIL, LIBRARY)


def test_runs_keep_the_limits_of_value_and_rate() -> None:
    limits = PortLimits({"u": (-1.0, 3.0), "w": (0.0, 1.0)}, {"u": 20.0, "w": 5.0}, 0.01, seconds=4.0)
    rng = np.random.default_rng(0)
    for kind in limits.kinds:
        for _ in range(20):
            run = limits.draw(rng, kind)
            for design in (run, limits.near(rng, run, 0.25)):
                for name, x in design.values().items():
                    low, high = limits.ranges[name]
                    assert low - 1e-9 <= x.min() and x.max() <= high + 1e-9
                    assert np.abs(np.diff(x)).max() <= limits.rates[name] * 0.01 * (1 + 1e-6)
                assert list(design.set_points("a")) == ["trajectory", "time", "u", "w"] and design.words


def test_an_input_that_is_held_stands_in_the_set_points() -> None:
    limits = PortLimits({"u": (-1.0, 3.0)}, {"u": 20.0}, 0.01, seconds=2.0, held={"w": 0.5})
    rng = np.random.default_rng(0)
    run = limits.near(rng, limits.draw(rng, "steps"), 0.25)
    assert (run.set_points("a")["w"] == 0.5).all() and "w held at 0.5" in run.words
    assert np.ptp(run.set_points("a")["u"]) > 0.0


def test_a_run_is_told_with_units_and_plain_numbers() -> None:
    limits = PortLimits({"u0": (0.0, 1500.0), "w": (0.0, 1.0)}, {}, 10.0, seconds=14412.9, units={"u0": "W"})
    run = PortRun("steps", 14412.9, {"w": Wave("hold", 0.5), "u0": Wave("steps", 839.2, 660.8, 0.0094)}, limits)
    told = "steps in u0 of 661 W to either side of 839 W, one every 334 s; w held at 0.5, for 14400 s"
    assert run.words == told


def test_a_run_is_played_as_the_simulator_with_its_effects_goes() -> None:
    t = np.arange(0.0, 3.0, 0.01)
    force = np.sin(2.0 * t)
    (found,) = played(RAIL, t, force[None, None], np.zeros(2), RAIL.numbers)
    exact = np.concatenate([[0.0], np.cumsum(force[:-1]) * 0.01 / 2.0])
    np.testing.assert_allclose(found["v"], exact, atol=1e-9)


def test_the_designed_run_settles_what_was_open(open_case) -> None:
    assert len(open_case.rivals) > 1
    kept = {"x": (-20.0, 20.0), "v": (-3.0, 3.0)}
    plan = pamid.next_run(open_case, limits={"F": (-4.0, 4.0)}, keep=kept, designs=80)
    assert plan.purpose == "discriminate" and plan.tells and plan.clarity >= plan.usual - 0.01
    points = plan.set_points()
    assert points["F"].abs().max() <= 4.0
    more = recorded(points["F"].to_numpy(), 7, viscous=0.8)
    settled = pamid.diagnose({"designed": more}, RAIL, since=open_case.history)
    assert settled.causes[0].effects == ("viscous_friction",)


def test_where_one_cause_is_left_the_run_narrows_it_and_a_change_of_the_rig_is_weighed() -> None:
    t = np.arange(600) * 0.01
    log = pd.concat([recorded(3.0 * np.sin(w * t), k, viscous=3.0) for k, w in enumerate((1.0, 2.5))])
    found = pamid.diagnose(log.reset_index(drop=True), RAIL, LIBRARY)
    plan = pamid.next_run(found, designs=40, changes=[{"m": 0.5}])
    assert plan.purpose == "parameters" and plan.changed.keys() == {"as it is", "m = 0.5"}
    assert "a random run" in headroom(plan) and "Only viscous friction at x remains" in summary(plan)
    with pytest.raises(ParameterError, match="an input: F"):
        pamid.next_run(found, limits={"u": (0.0, 1.0)})
    with pytest.raises(ParameterError, match="a state or an output: x, v"):
        pamid.next_run(found, keep={"y": (0.0, 1.0)})
    with pytest.raises(ParameterError, match="a parameter of the simulator, or an input to hold: m, F"):
        pamid.next_run(found, changes=[{"mass": 1.0}])
    with pytest.raises(ParameterError, match="No input"):
        still = pd.concat([run.assign(F=0.0) for _, run in log.groupby("trajectory")])
        plan_next(found.rivals, {"log": still}, RAIL)


def test_unknown_clocks_and_offsets_are_integrated_out() -> None:
    """The likelihood of what is left is that of residuals whose covariance holds what each may do, run by run."""
    rng = np.random.default_rng(0)
    N, z = rng.standard_normal((40, 2)), rng.standard_normal(40)
    log = SimpleNamespace(nuisances=N, block=np.repeat([0, 1], 20))
    for apart, groups in ((False, [slice(0, 40)]), (True, [slice(0, 20), slice(20, 40)])):
        exact = sum(
            z[g] @ np.linalg.solve(np.eye(len(z[g])) + N[g] @ N[g].T / settings.TOLERANCE, z[g]) for g in groups
        )
        left = cleaned(log, apart)(z)
        assert left @ left == pytest.approx(exact)


def test_a_change_of_the_rig_tells_what_no_run_does() -> None:
    """Friction and a larger constant are the same to every run; beside another constant they are not."""
    t, w = np.arange(400) * 0.01, [40.0]
    u = 2.0 + 0.05 * np.sin(2.0 * t)
    for v in u[:-1]:
        w.append(w[-1] + 0.5 * (v - 0.0475 * w[-1]))
    log = pd.DataFrame({"time": t, "u": u, "w": w + 0.2 * np.random.default_rng(0).standard_normal(400)})
    ports = [Port("u", "input", "V"), Port("w", "state", "rad/s")]
    motor = FunctionSimulator(lambda t, x, u, p: [(u.u - p.k * x.w) / p.J], ports, {"k": 0.04, "J": 0.02})
    places = evidence_of(log, motor).placements
    sizes = {"viscous_friction@w": {"coefficient": 0.0075}, "parameter_deviation@k": {"deviation": 0.1875}}
    two = [Rival({name: places[name].inward(values)}, {}, 0.0, 0.5) for name, values in sizes.items()]
    wide = {"limits": {"u": (-3.0, 3.0)}, "keep": {"w": (-90.0, 90.0)}, "rates": {"u": 500.0}}
    plan = plan_next(two, {"log": log}, motor, designs=24, changes=[{"k": 0.08}], **wide)
    assert plan.tells and plan.rig == {"k": 0.08} and plan.changed["k = 0.08"] > plan.changed["as it is"]
    assert plan.right > 0.9
    alone = plan_next(two, {"log": log}, motor, designs=24, **wide)
    assert not alone.tells and alone.right == pytest.approx(0.5, abs=0.02) and not alone.rig
    assert alone.changed.keys() == {"as it is", "k = 0.02", "k = 0.08", "J = 0.01", "J = 0.04"}  # proposed
    assert "With k = 0.0" in headroom(alone) and "declare it" in headroom(alone)
    still = plan_next(two, {"log": log}, motor, designs=12, changes=[{"u": 0.0}], **wide)
    assert not still.tells and still.changed["u = 0"] < 0.1  # a motor that runs out tells as little
    with pytest.raises(ParameterError, match="an input to hold: k, J, u"):
        plan_next(two, {"log": log}, motor, designs=12, changes=[{"v": 0.0}], **wide)


def test_the_command_designs_the_run_of_a_function(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    t = np.arange(600) * 0.01
    logs = [recorded(3.0 * np.sin(w * t), k, viscous=3.0) for k, w in enumerate((1.0, 2.5))]
    pd.concat(logs).to_csv(tmp_path / "log.csv", index=False)
    (tmp_path / "rail.py").write_text("def rate(t, x, u, p):\n    return [x.v, u.F / p.m]\n")
    (tmp_path / "sim.toml").write_text(
        'kind = "ode"\n[ode]\nfunction = "rail.py:rate"\n[ports]\nF = { kind = "input", unit = "N" }\n'
        'x = { kind = "state", unit = "m" }\nv = { kind = "state", unit = "m/s" }\n'
        '[parameters]\nm = { value = 2.0, tolerance = 0.05, unit = "kg" }\n'
    )
    out = str(tmp_path / "out")
    common = ["--trust", "--quiet"]
    words = ["--sim", str(tmp_path / "sim.toml"), "--effects", ",".join(LIBRARY), "--out", out]
    assert main(["diagnose", str(tmp_path / "log.csv"), *words, *common]) == 0
    assert main(["next", out, "--designs", "40", "--limit", "F=-4:4", "--change", "m=1", *common]) == 0
    assert "Only viscous friction at x remains" in capsys.readouterr().out
    plan = json.loads((tmp_path / "out" / "next" / "plan.json").read_text())
    assert plan["purpose"] == "parameters" and plan["changed"].keys() == {"as it is", "m = 1"}
    if plan["runs"]:
        assert list(pd.read_csv(tmp_path / "out" / "next" / "set_points.csv")) == ["trajectory", "time", "F"]
    assert main(["next", out, "--limit", "F", *common]) == 2
    assert "NAME=LOW:HIGH" in capsys.readouterr().err


def test_the_next_run_of_a_cylinder_tells_viscous_friction_from_drag() -> None:
    """Sines of like speeds cannot tell them apart; the designed run does."""

    def recorded(runs: pd.DataFrame, seed: int) -> pd.DataFrame:
        noise, parts = np.random.default_rng(seed), []
        for _, run in runs.groupby("trajectory", sort=False):
            F = 4.9087e-4 * (run["P"] - 101_325.0) - 8.0 * np.gradient(run["x"], run["time"])
            parts.append(run.assign(F=F + 0.3 * noise.standard_normal(len(run))))
        return pd.concat(parts, ignore_index=True)

    t = np.arange(0, 4, 0.01)
    alike = [
        pd.DataFrame({"trajectory": f"{w}", "time": t, "x": 0.05 + 0.02 * np.sin(w * t), "P": 3e5 + 2e4 * np.sin(t)})
        for w in (2.0, 2.2, 2.4)
    ]
    cylinder = Cylinder(bore=0.025, force="delivered")
    found = pamid.diagnose(recorded(pd.concat(alike), 0), cylinder, ["viscous_friction", "quadratic_drag"])
    assert found.causes[0].effects == ("viscous_friction", "quadratic_drag")
    plan = pamid.next_run(found, designs=40)
    assert plan.tells and plan.explanations == [("viscous_friction",), ("quadratic_drag",)]
    points = plan.set_points()
    assert points["x"].between(0.03, 0.07).all() and points["P"].between(2.8e5, 3.2e5).all()
    after = pamid.diagnose({"next": recorded(points, 1)}, cylinder, since=found.history)
    assert [c.effects for c in after.causes] == [("viscous_friction",)]
    with pytest.raises(ParameterError, match="an input: x, P"):
        pamid.next_run(found, limits={"F": (0.0, 1.0)})


def test_a_system_that_only_its_controller_holds_is_told_from_too_wide_limits() -> None:
    """A mass on a magnet falls or sticks under every design; one on a rail only leaves where it is pushed too hard."""
    rng, t, x, v, rows = np.random.default_rng(0), np.arange(800) * 0.005, 1e-3, 0.0, []
    for k in t:
        F = -60.0 * x - 12.0 * v + 2.0 * np.sin(3.0 * k)
        rows.append((F, x, v))
        v += 0.005 * (F + 40.0 * x - 0.5 * v) / 0.5
        x += 0.005 * v
    F, x, v = np.array(rows).T
    log = pd.DataFrame({"time": t, "F": F, "x": x + 1e-5 * rng.standard_normal(800), "v": v})
    magnet = FunctionSimulator(lambda t, x, u, p: [x.v, (u.F + p.k * x.x) / 0.5], PORTS, {"k": (40.0, 0.02, "N/m")})
    runs = pd.concat([recorded(3.0 * np.sin(w * t), k, viscous=3.0) for k, w in enumerate((1.0, 2.5))])
    runs = runs.reset_index(drop=True)
    friction = evidence_of(runs, RAIL).placements["viscous_friction@x"].inward({"coefficient": 3.0})
    two = [Rival({"viscous_friction@x": friction}, {}, 0.0, 0.6), Rival({}, {}, 0.0, 0.4)]
    with pytest.raises(ExcitationError, match=r"even under the inputs of a logged run.*controller in the loop"):
        plan_next(two, {"log": log}, magnet, designs=8)
    with pytest.raises(ExcitationError, match=r"near their range in the logs\..*Narrow --limit"):
        plan_next(two, {"log": runs}, RAIL, {"F": (90.0, 99.0)}, designs=8)
