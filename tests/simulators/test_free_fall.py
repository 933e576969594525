"""A mass that falls freely: its acceleration stands still, which is the size of a force at its joint all the same."""

import numpy as np
import pandas as pd
import pytest

import pamid
from pamid.gap.simulated import evidence_of
from pamid.simulators import EquationSimulator, Port

FALL = EquationSimulator(
    {"dh/dt": "v", "dv/dt": "-g"}, [Port("h", "state", "m"), Port("v", "state", "m/s")], {"g": (9.81, 0.0, "m/s2")}
)


def fall(rows: int, drag: float, seed: int = 0) -> pd.DataFrame:
    """Heights of two falls through air that slows them, read 15 times a second."""
    t, rng = np.arange(rows) / 15.0, np.random.default_rng(seed)
    still = 9.81 / drag
    return pd.concat(
        [
            pd.DataFrame(
                {
                    "trajectory": str(k),
                    "time": t,
                    "h": 48.0 + k - still * t + (still + k) / drag * (1.0 - np.exp(-drag * t))
                    + 0.05 * rng.standard_normal(rows),
                }
            )
            for k in range(2)
        ],
        ignore_index=True,
    )  # fmt: skip


@pytest.mark.parametrize("rows", range(50, 60))
def test_forces_act_on_a_mass_whose_acceleration_stands_still(rows: int) -> None:
    evidence = evidence_of(fall(rows, 0.5), FALL)
    assert evidence.touched(["viscous_friction@h"]) == ["h"]
    assert evidence.sizes.gaps["h"] == pytest.approx(0.3 * 9.81)


def test_the_drag_of_a_fall_is_named_from_two_logs() -> None:
    found = pamid.diagnose({"red": fall(57, 0.5), "blue": fall(58, 0.5, 1)}, FALL)
    (cause,) = found.causes
    assert cause.effects[0] == "viscous_friction"
    assert cause.parameters["coefficient"].value == pytest.approx(0.5, rel=0.1)
