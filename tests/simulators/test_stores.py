"""What is stored leaks: a current in a resistance, a tank through a hole, a gas past the seal of a piston."""

import numpy as np
import pandas as pd
import pytest

import pamid
from pamid.effects import Signals
from pamid.effects.leakage import PortLeakage
from pamid.gap.simulated import evidence_of
from pamid.simulators import EquationSimulator, FunctionSimulator, Port
from pamid.simulators.links import links_of


def integrated(rate, x0, u, dt, parts):
    """Rows of the states of a system whose inputs are held."""
    x, rows, h = np.array(x0, dtype=float), [], dt / parts
    for now in u:
        rows.append(x)
        for _ in range(parts):
            one = np.array(rate(x, now))
            x = x + h * np.array(rate(x + 0.5 * h * one, now))
    return np.array(rows).T


def steps(rng, n, each, low, high):
    return np.repeat(rng.uniform(low, high, n // each + 1), each)[:n]


BUCK = EquationSimulator(
    {"di/dt": "(duty*Vin - v)/L", "dv/dt": "(i - v/R)/C"},
    [Port("duty", "input", "-"), Port("i", "state", "A"), Port("v", "state", "V")],
    {"Vin": (24.0, 0.01, "V"), "L": (1e-3, 0.05, "H"), "C": (4.7e-4, 0.05, "F"), "R": (8.0, 0.02, "ohm")},
)


def buck_log(resistance, seed=0):
    rng, runs = np.random.default_rng(seed), []
    for k in range(3):
        duty = steps(rng, 2000, 200, 0.1, 0.9)
        i, v = integrated(
            lambda x, d: [(24 * d - x[1] - resistance * x[0]) / 1e-3, (x[0] - x[1] / 8) / 4.7e-4],
            [1.5, 12.0], duty, 1e-4, 5,
        )  # fmt: skip
        noise = {"i": i + 0.01 * rng.standard_normal(2000), "v": v + 0.02 * rng.standard_normal(2000)}
        runs.append(pd.DataFrame({"trajectory": str(k), "time": 1e-4 * np.arange(2000), "duty": duty, **noise}))
    return pd.concat(runs, ignore_index=True)


def test_a_resistance_of_a_coil_is_a_leakage_of_its_current_both_ways():
    log = buck_log(0.5)
    assert log["i"].min() < -1.0
    [cause] = pamid.diagnose(log, BUCK).causes
    found = cause.parameters["conductance"]
    assert (cause.effects[0], cause.where, found.unit) == ("leakage", ("i",), "1/s")
    assert abs(found.value - 500.0) < 25.0  # R / L


def test_a_current_has_no_overflow_and_no_hole():
    places = evidence_of(buck_log(0.0), BUCK).placements
    assert "overflow@i" not in places and [p.name for p in places["leakage@i"].effect.parameters] == ["conductance"]


TANK = EquationSimulator(
    {"dh/dt": "k*u - c*sqrt(max(h, 0))"},
    [Port("u", "input", "V"), Port("h", "state", "m")],
    {"k": (0.012, 0.02, "m/(V s)"), "c": (0.04, 0.02, "m^0.5/s")},
)


def tank_log(hole, laminar, seed=0):
    rng, runs = np.random.default_rng(seed), []
    for k in range(3):
        u = steps(rng, 1200, 60, 2.0, 9.0)
        [h] = integrated(
            lambda x, v: [0.012 * v - (0.04 + hole) * np.sqrt(max(x[0], 0.0)) - laminar * x[0]], [1.0], u, 1.0, 4
        )
        noise = 0.003 * rng.standard_normal(1200)
        runs.append(pd.DataFrame({"trajectory": str(k), "time": 1.0 * np.arange(1200), "u": u, "h": h + noise}))
    return pd.concat(runs, ignore_index=True)


def test_a_hole_leaks_with_the_root_of_the_level_and_a_gap_with_the_level():
    # Of one tank a hole of the size of its outlet is a wrong outlet: both are told.
    found = pamid.diagnose(tank_log(0.0, 0.01), TANK)
    [cause] = found.causes
    assert cause.effects[0] == "leakage"
    assert abs(cause.parameters["conductance"].value - 0.01) < 1e-3 and cause.parameters["exponent"].value > 0.9
    place = evidence_of(tank_log(0.0, 0.0), TANK).placements["leakage@h"]
    made = place.made({"conductance": 0.008, "exponent": 0.5})
    level = np.array([0.25, 1.0, 4.0])
    lost = place.force(made, place.signals({"h": level}), np.zeros(0))
    assert np.allclose(lost, -0.008 * np.sqrt(level))


# --- a gas cylinder -----------------------------------------------------------------------------------------
A1, A2, V0, STROKE, R, T, GAMMA, SUPPLY, ROOM = 8e-4, 6.6e-4, 2e-5, 0.2, 287.0, 293.0, 1.2, 7e5, 1e5


def psi(r):
    return np.where(r < 0.3, 1.0, np.sqrt(np.maximum(0.0, 1.0 - ((np.clip(r, 0, 1) - 0.3) / 0.7) ** 2)))


def through(u, pressure, c):
    return c * 1.185 * np.where(u > 0, u * SUPPLY * psi(pressure / SUPPLY), u * pressure * psi(ROOM / pressure))


def cylinder_rates(t, s, w, p, leak=0.0):
    past = leak * (s.P1 - s.P2) / (R * T)
    q1, q2 = through(w.u, s.P1, p.C) - past, through(-w.u, s.P2, p.C) + past
    v1, v2 = V0 + A1 * s.x, V0 + A2 * (STROKE - s.x)
    force = s.P1 * A1 - s.P2 * A2 - ROOM * (A1 - A2) - p.b * s.v
    return [
        s.v, force / p.m, GAMMA / v1 * (R * T * q1 - s.P1 * A1 * s.v), GAMMA / v2 * (R * T * q2 + s.P2 * A2 * s.v)
    ]  # fmt: skip


CYLINDER = FunctionSimulator(
    cylinder_rates,
    [
        Port("u", "input", "-"), Port("x", "state", "m"), Port("v", "state", "m/s"), Port("P1", "state", "Pa"),
        Port("P2", "state", "Pa"),
    ],
    {"C": (4e-9, 0.03, "m^3/(s Pa)"), "b": (40.0, 0.2, "N s/m"), "m": (2.0, 0.02, "kg")},
)  # fmt: skip


class Given:
    """Numbers by name."""

    def __init__(self, **values):
        self.__dict__.update(values)


def cylinder_log(leak, seed=0):
    rng, runs, dt, parts, p = np.random.default_rng(seed), [], 2e-3, 4, Given(C=4e-9, b=40.0, m=2.0)
    for k in range(3):
        x, rows = np.array([0.1, 0.0, 3.5e5, 4.2e5]), []
        aim = (
            0.1 + 0.02 * np.sin(2 * np.pi * (0.5 + 0.4 * k) * dt * np.arange(2000)) + steps(rng, 2000, 500, -0.02, 0.02)
        )
        for wanted in aim:
            u = float(np.clip(12 * (wanted - x[0]) - x[1] - 2e-7 * (x[2] - x[3] * A2 / A1 - 0.8e5), -1, 1))
            rows.append([u, *x])
            for _ in range(parts):

                def rate(y, u=u):
                    return np.array(
                        cylinder_rates(0.0, Given(x=y[0], v=y[1], P1=y[2], P2=y[3]), Given(u=u), p, leak), dtype=float
                    )

                h, one = dt / parts, rate(x)
                two = rate(x + 0.5 * h * one)
                three = rate(x + 0.5 * h * two)
                x = x + h / 6 * (one + 2 * two + 2 * three + rate(x + h * three))
        u, *states = np.array(rows).T
        read = {
            name: y + sigma * rng.standard_normal(len(u))
            for name, y, sigma in zip(("x", "v", "P1", "P2"), states, (1e-5, 2e-3, 150.0, 150.0), strict=True)
        }
        runs.append(pd.DataFrame({"trajectory": str(k), "time": dt * np.arange(len(u)), "u": u, **read}))
    return pd.concat(runs, ignore_index=True)


def test_a_worn_seal_of_a_gas_cylinder_leaks_from_chamber_to_chamber():
    [cause] = pamid.diagnose(cylinder_log(4e-6), CYLINDER).causes
    found = cause.parameters["conductance"]
    assert (cause.effects[0], cause.where, found.unit) == ("leakage", ("P1 and P2",), "m^3/s")
    assert abs(found.value - 4e-6) < 4e-7


@pytest.mark.parametrize("swing", [1e5, 3e3])
def test_a_gas_is_one_also_where_its_pressure_varies_little(swing):
    t = np.arange(0.0, 2.0, 0.01)
    wave = np.sin(5.0 * t)
    x = np.array([0.1 + 0.02 * wave, 0.1 * np.cos(5.0 * t), 3.5e5 + swing * wave, 4.2e5 - swing * wave])
    [link] = links_of(CYLINDER, [], [], t, x, 0.1 * wave[None])
    assert (link.name, link.unit) == ("P1 and P2", "Pa m^3/s")


def test_nothing_leaks_from_a_store_at_exactly_zero():
    """Readings in coarse steps are often zero."""
    places = evidence_of(buck_log(0.0), BUCK).placements
    gap = places["leakage@i"]
    flow = gap.effect(conductance=1e-9).flow(gap.signals({"i": np.array([-0.5, 0.0, 0.5])}), np.zeros(0), gap.plant)
    assert flow.a[1] == 0.0 and flow.a[0] == -flow.a[2] < 0.0
    hole = PortLeakage(conductance=1e-9, exponent=0.5)
    flow = hole.flow(Signals(pressure=np.array([-0.25, 0.0, 0.25])), np.zeros(0), gap.plant)
    assert flow.a[1] == 0.0 and flow.a[0] == -flow.a[2] < 0.0
