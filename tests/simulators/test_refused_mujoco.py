"""A MuJoCo model that cannot be used is refused for the one thing that is wrong with it."""

from __future__ import annotations

from pathlib import Path

import pytest

pytest.importorskip("mujoco")

from pamid.errors import SimulatorSyntaxError
from pamid.simulators.mujoco_model import MujocoSimulator

FILTER = '<actuator><general joint="hinge" dyntype="filter" dynprm="0.1"/></actuator>'


@pytest.mark.parametrize(
    ("joint", "beside", "said"),
    [
        ("", "", "has no joints"),
        ('<joint name="hinge" type="ball"/>', "", "has ball joints"),
        ('<joint name="hinge"/>', FILTER, "has actuators with states of their own"),
    ],
)
def test_what_is_wrong_with_a_model_is_said(joint: str, beside: str, said: str, tmp_path: Path) -> None:
    path = tmp_path / "arm.xml"
    body = f'<worldbody><body>{joint}<geom size="0.1" mass="1"/></body></worldbody>'
    path.write_text(f"<mujoco>{body}{beside}</mujoco>", encoding="utf-8")
    with pytest.raises(SimulatorSyntaxError, match=said):
        MujocoSimulator(path)
