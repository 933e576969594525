"""Effects between two ports: a play of a gear, a leak inside a cylinder, friction of a strut, and none."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from pamid.errors import MissingParameterError, ParameterError, UnknownOptionError
from pamid.gap import diagnose_simulator
from pamid.gap.residuals.choice import bridged
from pamid.gap.residuals.direct import DirectEvidence
from pamid.gap.settings import LEAST_GAIN
from pamid.gap.simulated import evidence_of
from pamid.simulators import Between, FunctionSimulator, Port, page_text, read_simulator
from pamid.simulators.integrate import Runner
from pamid.simulators.structure import spread_numbers

Rates = Callable[..., list[np.ndarray]]
LIBRARY = (
    "backlash", "leakage", "coulomb_friction", "viscous_friction", "hysteresis", "nonlinear_stiffness",
    "parameter_deviation", "actuator_gain", "actuator_lag", "sensor_gain",
)  # fmt: skip
Drive = Callable[[np.ndarray], np.ndarray]


def logged(
    simulator: FunctionSimulator, truth: Rates, start: Sequence[float], drives: Sequence[Drive],
    noise: dict[str, float], dt: float, seconds: float, seed: int,
) -> pd.DataFrame:  # fmt: skip
    """Return runs of what a simulator is of, each under a drive that is held over its step."""
    rng, runs, fine = np.random.default_rng(seed), [], 10
    p = {name: number.value for name, number in simulator.parameters.items()}
    for k, drive in enumerate(drives):
        t = np.arange(0.0, seconds, dt)
        u, x, rows = drive(t), np.array(start, dtype=float), []
        for now in u:
            rows.append(x)
            for _ in range(fine):
                h = dt / fine
                a = np.array(truth(x, now, p))
                b = np.array(truth(x + 0.5 * h * a, now, p))
                x = x + h * b
        states = dict(zip(simulator.states, np.array(rows).T, strict=True))
        read = {name: states[name] + sigma * rng.standard_normal(len(t)) for name, sigma in noise.items()}
        runs.append(pd.DataFrame({"trajectory": f"run {k}", "time": t, simulator.inputs[0]: u, **read}))
    return pd.concat(runs, ignore_index=True)


def two_sines(slow: float, low: float, fast: float, high: float, phase: float) -> Drive:
    """Return a drive of two sines: amplitudes, and frequencies in Hz."""
    return lambda t: slow * np.sin(2 * np.pi * low * t) + fast * np.sin(2 * np.pi * high * t + phase)


# --- a drive: motor and load on a belt of ratio 4 -----------------------------------------------------------
PLAY, BELT = 0.03, 4.0


def drive_rates(t, x, u, p):
    """Motor and load behind an elastic belt; across it is the motor's angle less four times the load's."""
    f = p.k * (x.qm - BELT * x.ql) + p.c * (x.wm - BELT * x.wl)
    return [x.wm, x.wl, (u.torque - p.bm * x.wm - f) / p.Jm, (BELT * f - p.bl * x.wl) / p.Jl]


def driven(play: float = 0.0, friction: float = 0.0) -> Rates:
    def truth(x: np.ndarray, torque: float, p: dict[str, float]) -> list[np.ndarray]:
        qm, ql, wm, wl = x
        across, speed = qm - BELT * ql, wm - BELT * wl
        stretched = across - np.clip(across, -play, play)
        f = p["k"] * stretched + p["c"] * speed * (1.0 if abs(across) >= play else 0.0)
        own = friction * np.tanh(wl / 0.02)
        return [wm, wl, (torque - p["bm"] * wm - f) / p["Jm"], (BELT * f - p["bl"] * wl - own) / p["Jl"]]

    return truth


DRIVE_PORTS = [
    Port("torque", "input", "N m"), Port("qm", "state", "rad"), Port("ql", "state", "rad"),
    Port("wm", "state", "rad/s"), Port("wl", "state", "rad/s"),
    Port("motor", "joint", "N m", position="qm", velocity="wm"),
    Port("load", "joint", "N m", position="ql", velocity="wl"),
]  # fmt: skip
DRIVE = FunctionSimulator(
    drive_rates, DRIVE_PORTS,
    {
        "Jm": (6e-4, 0.05, "kg m^2"), "Jl": (2.4e-2, 0.05, "kg m^2"), "k": (3.2, 0.1, "N m/rad"),
        "c": (8e-3, 0.2, "N m s/rad"), "bm": (2e-3, 0.2, "N m s/rad"), "bl": (0.02, 0.2, "N m s/rad"),
    },
)  # fmt: skip


def drive_log(truth: Rates, seed: int = 3) -> pd.DataFrame:
    drives = [two_sines(0.5, 0.6 + 0.25 * k, 0.3, 2.3 - 0.3 * k, k) for k in range(2)]
    noise = {"qm": 2e-4, "ql": 5e-5, "wm": 2e-2, "wl": 5e-3}
    return logged(DRIVE, truth, [0.0] * 4, drives, noise, 2e-3, 2.0, seed)


# --- a cylinder ---------------------------------------------------------------------------------------------
LEAK = 1.4e-11


def cylinder_rates(t, x, u, p):
    """Differential cylinder behind a servo valve; pressures in Pa."""

    def flow(opening, drop):
        return p.kv * opening * np.sign(drop) * np.sqrt(np.abs(drop) + 1.0)

    opens = u.valve > 0
    qa = np.where(opens, flow(u.valve, p.ps - x.pa), flow(u.valve, x.pa))
    qb = np.where(opens, flow(-u.valve, x.pb), flow(-u.valve, p.ps - x.pb))
    va, vb = 2e-4 + p.A * x.s, 2e-4 + p.B * (0.4 - x.s)
    return [
        x.v, (p.A * x.pa - p.B * x.pb - p.d * x.v) / p.m, p.E / va * (qa - p.A * x.v), p.E / vb * (qb + p.B * x.v)
    ]  # fmt: skip


CYLINDER = FunctionSimulator(
    cylinder_rates,
    [
        Port("valve", "input"), Port("s", "state", "m"), Port("v", "state", "m/s"),
        Port("pa", "state", "Pa"), Port("pb", "state", "Pa"),
    ],
    {
        "A": 2e-3, "B": 1.2e-3, "ps": (1.2e7, 0.02, "Pa"), "kv": (1.5e-7, 0.05), "E": (7e8, 0.15, "Pa"),
        "m": (150.0, 0.05, "kg"), "d": (2500.0, 0.1, "N s/m"),
    },
)  # fmt: skip


def leaking(leak: float) -> Rates:
    def truth(x: np.ndarray, valve: float, p: dict[str, float]) -> list[np.ndarray]:
        s, v, pa, pb = x

        def flow(opening: float, drop: float) -> float:
            return float(p["kv"] * opening * np.sign(drop) * np.sqrt(np.abs(drop) + 1.0))

        qa = flow(valve, p["ps"] - pa) if valve > 0 else flow(valve, pa)
        qb = flow(-valve, pb) if valve > 0 else flow(-valve, p["ps"] - pb)
        q = leak * (pa - pb)
        va, vb = 2e-4 + p["A"] * s, 2e-4 + p["B"] * (0.4 - s)
        acc = (p["A"] * pa - p["B"] * pb - p["d"] * v) / p["m"]
        return [v, acc, p["E"] / va * (qa - p["A"] * v - q), p["E"] / vb * (qb + p["B"] * v + q)]

    return truth


def cylinder_log(leak: float, seed: int = 5) -> pd.DataFrame:
    drives = [two_sines(0.6, 0.8 + 0.3 * k, 0.3, 2.1, k) for k in range(2)]
    noise = {"s": 1e-5, "v": 1e-3, "pa": 1e4, "pb": 1e4}
    return logged(CYLINDER, leaking(leak), [0.2, 0.0, 4e6, 6e6], drives, noise, 2e-3, 4.0, seed)


# --- a strut ------------------------------------------------------------------------------------------------
def strut_rates(t, x, u, p):
    """A body on a wheel that stands on a shaker; the strut is between them."""
    f = p.ks * (x.zw - x.zb) + p.cs * (x.vw - x.vb)
    return [x.vb, x.vw, f / p.mb, (p.kt * (u.floor - x.zw) - f) / p.mw]


STRUT = FunctionSimulator(
    strut_rates,
    [
        Port("floor", "input", "m"), Port("zb", "state", "m"), Port("zw", "state", "m"),
        Port("vb", "state", "m/s"), Port("vw", "state", "m/s"),
        Port("body", "joint", "N", position="zb", velocity="vb"),
        Port("wheel", "joint", "N", position="zw", velocity="vw"),
    ],
    {
        "mb": (90.0, 0.03, "kg"), "mw": (14.0, 0.03, "kg"), "ks": (6e3, 0.05, "N/m"), "cs": (300.0, 0.05, "N s/m"),
        "kt": (4e4, 0.05, "N/m"),
    },
)  # fmt: skip


def rubbing(strut: float = 0.0, wheel: float = 0.0) -> Rates:
    def truth(x: np.ndarray, floor: float, p: dict[str, float]) -> list[np.ndarray]:
        zb, zw, vb, vw = x
        f = p["ks"] * (zw - zb) + p["cs"] * (vw - vb) + strut * np.tanh((vw - vb) / 2e-3)
        return [vb, vw, f / p["mb"], (p["kt"] * (floor - zw) - f - wheel * np.tanh(vw / 2e-3)) / p["mw"]]

    return truth


def strut_log(truth: Rates, seed: int = 7) -> pd.DataFrame:
    drives = [two_sines(0.02, 0.9 + 0.3 * k, 6e-3, 3.1 + 0.4 * k, k) for k in range(2)]
    noise = {"zb": 1e-5, "zw": 1e-5, "vb": 1e-3, "vw": 1e-3}
    return logged(STRUT, truth, [0.0] * 4, drives, noise, 2e-3, 3.0, seed)


CASES = {
    "gear": (DRIVE, lambda: drive_log(driven(play=PLAY)), "backlash", "motor and load", "half_width", PLAY),
    "cylinder": (CYLINDER, lambda: cylinder_log(LEAK), "leakage", "pa and pb", "conductance", LEAK),
    "strut": (STRUT, lambda: strut_log(rubbing(strut=40.0)), "coulomb_friction", "body and wheel", "amplitude", 40.0),
}


@pytest.mark.parametrize("case", CASES)
def test_an_effect_between_two_ports_is_named_with_its_size(case: str) -> None:
    simulator, log, effect, where, word, size = CASES[case]
    found = diagnose_simulator(log(), simulator, list(LIBRARY))
    assert (found.causes[0].effects[0], found.causes[0].where[0]) == (effect, where)
    assert found.causes[0].parameters[word].value == pytest.approx(size, rel=0.06)
    assert found.corrected is not None
    assert found.corrected.effects[0][:2] == (effect, where)


def test_a_leak_has_its_size_where_the_bulk_modulus_differs() -> None:
    """What leaks changes a pressure by the modulus that is fitted, not by the one that the simulator has."""
    found = diagnose_simulator(cylinder_log(LEAK), CYLINDER.with_({"E": 6.2e8}), list(LIBRARY))
    assert [(c.effects[0], c.where[0]) for c in found.causes] == [("leakage", "pa and pb")]
    assert found.causes[0].parameters["conductance"].value == pytest.approx(LEAK, rel=0.04)


@pytest.mark.parametrize(
    ("simulator", "log", "effect", "where"),
    [
        (DRIVE, lambda: drive_log(driven(friction=0.25)), "coulomb_friction", "load"),
        (STRUT, lambda: strut_log(rubbing(wheel=40.0)), "coulomb_friction", "wheel"),
    ],
    ids=["load", "wheel"],
)
def test_friction_at_one_port_is_named_there(simulator, log, effect, where) -> None:
    found = diagnose_simulator(log(), simulator, list(LIBRARY))
    assert found.causes[0].effects[0] == effect and found.causes[0].where[0] == where


def test_noise_pulls_nothing_along_a_change_that_leaves_all_rates_as_they_are() -> None:
    """Masses, springs, damper and friction that are all larger by one factor give the same motion."""
    evidence = evidence_of(strut_log(rubbing(strut=40.0)), STRUT)
    place = evidence.placements["coulomb_friction@body and wheel"]
    plain = {p.name: p.nominal for p in place.effect.parameters}
    friction = plain | place.inward({"amplitude": 40.0, "transition": 2e-3})
    assert evidence.pulled_under({place.key: friction}, np.zeros(5))[1] < LEAST_GAIN


@pytest.mark.parametrize(
    ("simulator", "log"),
    [
        (DRIVE, lambda: drive_log(driven(), 11)), (CYLINDER, lambda: cylinder_log(0.0, 12)),
        (STRUT, lambda: strut_log(rubbing(), 13)),
    ],
    ids=["gear", "cylinder", "strut"],
)  # fmt: skip
def test_right_simulators_have_no_gap(simulator, log) -> None:
    assert diagnose_simulator(log(), simulator, list(LIBRARY)).verdict == "none"


# --- what the simulator's own coupling says -----------------------------------------------------------------
def test_masses_ratio_stiffness_and_capacities_follow_from_the_simulator() -> None:
    [belt] = evidence_of(drive_log(driven()), DRIVE).links
    assert (belt.name, belt.unit) == ("motor and load", "N m")
    assert belt.ratio == pytest.approx(BELT) and belt.stiffness == pytest.approx(3.2)
    assert belt.damping == pytest.approx(8e-3)
    # A torque of 1 N m turns the motor by 1/Jm, and the load by four times as much over its own inertia.
    assert belt.typical == pytest.approx((1 / 6e-4, BELT / 2.4e-2))
    log = cylinder_log(0.0)
    evidence = evidence_of(log, CYLINDER)
    [leak] = evidence.links
    x = np.stack([evidence.signals()[n] for n in CYLINDER.states])
    assert leak.unit == "m^3/s"
    for stiffer in (1.0, 1.2):
        # Another mass changes nothing at the chambers; another bulk modulus does.
        fitted = CYLINDER.with_({"E": 7e8 * stiffer, "m": 150.0 / stiffer})
        at = evidence.log.t, x, evidence.signals()["valve"][None], spread_numbers(fitted, len(x[0]))
        one, two = leak.shares(*at)
        assert np.allclose(one, stiffer * 7e8 / (2e-4 + 2e-3 * x[0]), rtol=1e-4)
        assert np.allclose(two, stiffer * 7e8 / (2e-4 + 1.2e-3 * (0.4 - x[0])), rtol=1e-4)


@pytest.mark.parametrize("power", [1, 4])
def test_bodies_that_exchange_heat_are_a_pair_whose_capacities_follow(power: int) -> None:
    """By conduction or by radiation, whose two slopes differ wherever the temperatures do."""
    heat = 2e-3 if power == 1 else 3e-11

    def rates(t, x, u, p):
        flow = heat * ((x.hot + 273.15) ** power - (x.cold + 273.15) ** power)
        return [(u.power - 2e-3 * (x.hot - 20.0) - flow) / 2.0, (flow - 2e-3 * (x.cold - 20.0)) / 6.0]

    ports = [Port("power", "input", "W"), Port("hot", "state", "degC"), Port("cold", "state", "degC")]
    t = np.arange(0.0, 300.0, 5.0)
    log = pd.DataFrame({"time": t, "power": 0.5, "hot": 20.0 + 0.1 * t, "cold": 20.0 + 0.01 * t})
    evidence = evidence_of(log, FunctionSimulator(rates, ports))
    [pair] = evidence.links
    assert (pair.name, pair.domain) == ("hot and cold", "temperature")
    assert pair.typical[1] / pair.typical[0] == pytest.approx(2.0 / 6.0, rel=1e-6)
    assert "heat_loss@hot and cold" in evidence.placements


@pytest.mark.parametrize(("unit", "pairs"), [("-", 1), ("m", 0)])
def test_an_angle_without_a_unit_is_coupled_with_one_in_rad(unit: str, pairs: int) -> None:
    ports = [replace(p, unit=unit) if p.name == "ql" else p for p in DRIVE_PORTS]
    drive = FunctionSimulator(drive_rates, ports, dict(DRIVE.parameters))
    assert len(evidence_of(drive_log(driven()), drive).links) == pairs


def test_a_page_that_says_what_the_ends_yield_is_the_same() -> None:
    said = Between("motor", "load", BELT, ("Jm", "2.4e-2"))
    [own], [link] = (evidence_of(drive_log(driven()), s).links for s in (DRIVE, DRIVE.with_(between=[said])))
    assert link.typical == pytest.approx(own.typical) and link.stiffness == pytest.approx(own.stiffness)


def test_a_play_put_on_runs_as_the_drive_with_play() -> None:
    """A page's own backlash is that of an independent integration of motor, belt with play, and load."""
    log = logged(
        DRIVE, driven(play=PLAY), [0.0] * 4, [two_sines(0.5, 0.6, 0.3, 2.3, 0.0)],
        dict.fromkeys(("qm", "ql", "wm", "wl"), 0.0), 1e-3, 0.5, 0,
    )  # fmt: skip
    evidence = evidence_of(log, DRIVE.with_({}, [("backlash", "motor and load", {"half_width": PLAY})]))
    t, u, p = log["time"].to_numpy(), log["torque"].to_numpy(), DRIVE.numbers[:, None]
    off, across = [], log["qm"] - BELT * log["ql"]
    for acting in (evidence.active({}), []):
        runner = Runner(DRIVE, 1e-3, evidence.joints, substeps=5)
        x = runner.states(t[:, None], np.zeros((4, 1)), u[:, None, None], p, acting)[:, :, 0]
        off.append(np.max(np.abs(across - (x[:, 0] - BELT * x[:, 1]))) / np.ptp(across))
    assert off[0] < 0.01 < 0.2 < off[1]


def test_a_play_takes_away_what_the_coupling_transmits_as_it_was_fitted() -> None:
    """Stiffness, damping and inertia differ from those given: the play is that of the changed drive."""
    moved = {"k": 4.2, "c": 5e-3, "Jl": 2.9e-2}
    changed = FunctionSimulator(
        drive_rates, DRIVE_PORTS, {n: moved.get(n, q.value) for n, q in DRIVE.parameters.items()}
    )
    log = logged(
        changed, driven(play=PLAY), [0.0] * 4, [two_sines(0.5, 0.6, 0.3, 2.3, 0.0)],
        dict.fromkeys(("qm", "ql", "wm", "wl"), 0.0), 1e-3, 0.5, 0,
    )  # fmt: skip
    evidence = evidence_of(log, DRIVE.with_({}, [("backlash", "motor and load", {"half_width": PLAY})]))
    t, u, across = log["time"].to_numpy(), log["torque"].to_numpy(), log["qm"] - BELT * log["ql"]
    runner = Runner(DRIVE, 1e-3, evidence.joints, substeps=5)
    x = runner.states(t[:, None], np.zeros((4, 1)), u[:, None, None], changed.numbers[:, None], evidence.active({}))
    assert np.max(np.abs(across - (x[:, 0, 0] - BELT * x[:, 1, 0]))) < 0.01 * np.ptp(across)


# --- pages and errors ---------------------------------------------------------------------------------------
PAGE = """
kind = "equations"

[equations]
"dxa/dt" = "va"
"dxb/dt" = "vb"
"dva/dt" = "(F - k*(xa - xb))/ma"
"dvb/dt" = "k*(xa - xb)/mb"

[ports]
F = { kind = "input", unit = "N" }
xa = { kind = "state", unit = "m" }
xb = { kind = "state", unit = "m" }
va = { kind = "state", unit = "m/s" }
vb = { kind = "state", unit = "m/s" }

[parameters]
k = { value = 50.0, unit = "N/m" }
ma = { value = 1.0, unit = "kg" }
mb = { value = 2.0, unit = "kg" }
"""
BETWEEN = '[[between]]\nends = ["xb", "xa"]\nratio = 1.0\n'
EFFECT = '[[effects]]\neffect = "coulomb_friction"\nat = ["xb", "xa"]\namplitude = 0.5\n'


def masses() -> pd.DataFrame:
    t = np.arange(0.0, 3.0, 5e-3)
    return pd.DataFrame(
        {"trajectory": "0", "time": t, "F": np.sin(4 * t), "xa": 0.1 * np.sin(4 * t), "xb": 0.07 * np.sin(4 * t + 0.3),
         "va": 0.4 * np.cos(4 * t), "vb": 0.28 * np.cos(4 * t + 0.3)}
    )  # fmt: skip


def test_a_page_names_two_ports_and_is_written_as_it_was_read(tmp_path) -> None:
    (tmp_path / "masses.toml").write_text(PAGE + BETWEEN + EFFECT)
    simulator = read_simulator(tmp_path / "masses.toml")
    assert simulator.between == (Between("xb", "xa", 1.0),)
    assert simulator.effects == (("coulomb_friction", "xb and xa", {"amplitude": 0.5}),)
    (tmp_path / "again.toml").write_text(page_text(simulator, tmp_path))
    again = read_simulator(tmp_path / "again.toml")
    assert (again.between, again.effects) == (simulator.between, simulator.effects)
    [(place, made)] = evidence_of(masses(), again).active({})
    assert place.outward(made.values)["amplitude"] == pytest.approx(0.5)


@pytest.mark.parametrize(
    ("more", "error", "words"),
    [
        ('[[between]]\nends = "xa"\n', MissingParameterError, "ends of"),
        ('[[between]]\nends = ["xa", "ma"]\n', UnknownOptionError, "one of xa, xb"),
        ('[[effects]]\neffect = "gravity"\nat = ["xa", "xb"]\n', UnknownOptionError, "at 'xa and xb'"),
        ('[[effects]]\neffect = "backlash"\nat = "xa"\nhalf_width = 0.01\n', UnknownOptionError, "one of xa and xb"),
    ],
    ids=["one end", "no joint", "one body", "one port"],
)
def test_what_cannot_be_is_refused_with_what_can(tmp_path, more: str, error: type[Exception], words: str) -> None:
    (tmp_path / "masses.toml").write_text(PAGE + more)
    with pytest.raises(error, match=words):
        evidence_of(masses(), read_simulator(tmp_path / "masses.toml"))


def test_ends_without_a_coupling_need_what_they_yield() -> None:
    free = FunctionSimulator(
        lambda t, x, u, p: [x.va, x.vb, u.F, 0.0 * u.F],
        [Port("F", "input", "N"), *(Port(n, "state", "m") for n in ("xa", "xb")),
         *(Port(n, "state", "m/s") for n in ("va", "vb"))],
    )  # fmt: skip
    assert evidence_of(masses(), free).links == []
    with pytest.raises(ParameterError, match="inertia = "):
        evidence_of(masses(), free.with_(between=[Between("xa", "xb")]))
    [link] = evidence_of(masses(), free.with_(between=[Between("xa", "xb", inertia=("1", "2"))])).links
    assert link.unit == "N" and link.typical == pytest.approx((1.0, 0.5)) and link.stiffness == 0.0


def test_every_effect_of_the_library_between_two_ports_finds_what_it_reads() -> None:
    evidence = evidence_of(drive_log(driven()), DRIVE)
    between = {name: place for name, place in evidence.placements.items() if place.link is not None}
    assert "coulomb_friction@motor and load" in between
    for name, place in between.items():
        nominal = place.outward({p.name: p.nominal for p in place.effect.parameters})
        assert np.isfinite(evidence.change({name: nominal}, {}, np.zeros(len(evidence.free)))).all(), name


def test_noise_adds_up_between_windows_that_missing_rows_part() -> None:
    drives = [two_sines(0.6, 0.8 + 0.3 * k, 0.3, 2.1, k) for k in range(2)]
    noise = {"s": 2e-5, "pa": 1e4, "pb": 1e4}
    log = logged(CYLINDER, leaking(0.0), [0.2, 0.0, 4e6, 6e6], drives, noise, 2e-3, 8.0, 1)

    def windows_of_three(kept: pd.DataFrame) -> DirectEvidence:
        found = evidence_of(kept, CYLINDER)
        assert isinstance(found, DirectEvidence)
        return DirectEvidence(found.log, CYLINDER, found.derived, n=3)

    whole = windows_of_three(log)
    assert max(whole.pulled) < LEAST_GAIN and bridged(whole) is whole
    short = windows_of_three(log[np.random.default_rng(1).random(len(log)) >= 0.2].reset_index(drop=True))
    longer = bridged(short)
    assert max(short.pulled) > 2.0 * LEAST_GAIN > LEAST_GAIN > max(longer.pulled)
    assert longer.n == 8 and len(longer.z0) > len(short.z0)
