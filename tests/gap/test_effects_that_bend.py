"""An effect whose first order is poor at its size is refitted beside forms that are straight."""

import numpy as np
import pandas as pd
from scipy.integrate import solve_ivp

from pamid import diagnose
from pamid.gap.inference.competition import Competition
from pamid.gap.simulated import evidence_of
from pamid.simulators import EquationSimulator, Port

PENDULUM = EquationSimulator(
    {"dq/dt": "w", "dw/dt": "(torque - d*w)/J - 9.81/l*sin(q)"},
    [Port("torque", "input", "N m"), Port("q", "state", "rad"), Port("w", "state", "rad/s")],
    {"J": (0.4, 0.05, "kg m^2"), "d": (0.3, 0.1, "N m s/rad"), "l": (0.6, 0.02, "m")},
)


def swinging(offset: float) -> pd.DataFrame:
    """Return three runs of a pendulum that is pushed about, whose encoder is mounted askew."""
    rng, runs = np.random.default_rng(3), []
    for k in range(3):
        t, pushes = np.arange(0.0, 8.0, 0.01), rng.uniform(-4.0, 4.0, 40)

        def rates(s, x, pushes=pushes):
            torque = pushes[min(int(s / 0.2 + 1e-9), 39)]
            return [x[1], (torque - 0.3 * x[1]) / 0.4 - 9.81 / 0.6 * np.sin(x[0])]

        q = solve_ivp(rates, (0.0, 8.0), [0.2, 0.0], t_eval=t, max_step=0.01, rtol=1e-8, atol=1e-10).y[0]
        read = q + offset + 3e-4 * rng.standard_normal(len(t))
        torque = pushes[np.minimum((t / 0.2 + 1e-9).astype(int), 39)]
        runs.append(pd.DataFrame({"trajectory": f"run {k}", "time": t, "torque": torque, "q": read}))
    return pd.concat(runs, ignore_index=True)


def test_an_encoder_far_from_zero_is_refitted_though_a_spring_explains_more_to_first_order() -> None:
    some = ["gravity@q", "periodic_force@q", "spring@q", "sensor_bias@q", "sensor_gain@q", "actuator_bias@torque"]
    competition = Competition(evidence_of(swinging(1.6), PENDULUM), some)
    screen = competition.screen()
    alone = {name: single.gain for name, single in screen.singles.items()}
    assert alone["spring@q"] > 5.0 * alone["sensor_bias@q"]
    tried = [competition.templates[s.templates[0]].effect for s in screen.contenders if len(s.templates) == 1]
    assert set(tried) == {"sensor_bias@q", "spring@q"}
    [cause] = diagnose(swinging(1.6), PENDULUM, [name.partition("@")[0] for name in some]).causes
    assert set(cause.effects) == {"sensor_bias", "gravity"}
