"""How often a log is sampled changes how much noise hides, and not what is the cause."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from pamid.estimators import GapDiagnoser

from pamid.effects import Signals, make_effect
from pamid.gap import diagnose_simulator
from pamid.simulators import Port
from pamid.simulators.equation_model import EquationSimulator

FINE = 4e-4
LOST = {"narrow": 0.1, "middle": 0.15, "wide": 0.2, "width": 0.15}


def stage() -> pd.DataFrame:
    """A stage that follows its voltage with rate-independent hysteresis, sampled at 2.5 kHz."""
    rng, t, runs = np.random.default_rng(0), np.arange(0, 4, FINE), []
    stops = make_effect("actuator_hysteresis", **LOST)
    for k, (slow, fast) in enumerate(((1.0, 3.3), (1.7, 5.1), (0.6, 4.0))):
        drive = 0.7 * np.sin(2 * np.pi * slow * t) + 0.3 * np.sin(2 * np.pi * fast * t + k)
        s = Signals(command=drive)
        moved = stops.command(drive, s, stops.trace(s, None, FINE, np.array([0])), None)
        noise = 0.05 * rng.standard_normal(len(t))
        runs.append(pd.DataFrame({"trajectory": f"run {k}", "time": t, "drive": 100 * drive, "x": 20 * moved + noise}))
    return pd.concat(runs, ignore_index=True)


def thinned(log: pd.DataFrame, step: int) -> pd.DataFrame:
    return pd.concat([run.iloc[::step] for _, run in log.groupby("trajectory")], ignore_index=True)


@pytest.mark.parametrize("step", [1, 10])
def test_hysteresis_at_a_port_is_named_at_any_rate(step):
    simulator = EquationSimulator(
        {"x": "gain*drive"}, [Port("x", "output", "um"), Port("drive", "input", "V")], {"gain": (0.2, 0.0, "um/V")}
    )
    library = ["actuator_hysteresis", "actuator_dead_zone", "sensor_lag", "actuator_delay", "sensor_bias"]
    found = diagnose_simulator(thinned(stage(), step), simulator, library)
    assert (found.verdict, [c.effects for c in found.causes]) == ("cause", [("actuator_hysteresis",)])
    sizes = {name: p.value for name, p in found.causes[0].parameters.items()}
    assert sizes["wide"] == pytest.approx(LOST["wide"], rel=0.3)


@pytest.mark.parametrize("step", [1, 10])
def test_hysteresis_in_one_equation_is_named_at_any_rate(step):
    log = thinned(stage(), step)
    library = ["prandtl_ishlinskii", "viscous_friction", "force_lag", "creep", "coulomb_friction"]
    found = GapDiagnoser(
        lambda X: 0.2 * X["drive"], library, signals={"time": "time", "position": "drive"}, random_state=0
    )
    found.fit(log[["time", "drive"]], log["x"], groups=log["trajectory"])
    assert (found.verdict_, [c.effects for c in found.causes_]) == ("cause", [("prandtl_ishlinskii",)])
