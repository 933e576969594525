"""Dry friction that MuJoCo's own solver makes: at rest it balances the drive, which no law of the speed does."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from support.servo_logs import servo_log

from pamid.gap import diagnose_simulator
from pamid.gap.inference.competition import Competition
from pamid.gap.simulated import added, evidence_of, learn
from pamid.simulators import page_text, read_simulator

mujoco = pytest.importorskip("mujoco")

from pamid.simulators.mujoco_model import MujocoSimulator  # noqa: E402

ARM = """<mujoco><option timestep="0.001" integrator="RK4"/><worldbody><body>
<joint name="arm" axis="0 1 0" armature="0.002" damping="0.02"{}/>
<geom type="capsule" fromto="0 0 0 0 0 -0.2" size="0.01" mass="0.1" contype="0" conaffinity="0"/></body></worldbody>
<actuator><position name="servo" joint="arm" kp="4" kv="0.1"/></actuator></mujoco>"""
DRY = ' frictionloss="0.15"'
LIBRARY = ["coulomb_friction", "stribeck_friction", "viscous_friction", "hysteresis", "actuator_hysteresis"]


def simulator_of(folder: Path, joint: str = "") -> MujocoSimulator:
    path = folder / f"arm{len(joint)}.xml"
    path.write_text(ARM.format(joint))
    return MujocoSimulator(path)


def test_friction_as_a_number_is_that_of_the_model(tmp_path):
    plain, true = simulator_of(tmp_path), simulator_of(tmp_path, DRY)
    assert plain.dry_joints() == {"arm": ("dof_frictionloss.arm", 0.0)}
    assert true.dry_joints() == {"arm": ("dof_frictionloss.arm", 0.15)}
    rubs = plain.with_({"dof_frictionloss.arm": 0.15})
    x, u = np.random.default_rng(0).uniform(-1, 1, (2, 400)), np.random.default_rng(1).uniform(-1, 1, (2, 400))
    rates = [s.rate(np.zeros(400), x, u, np.repeat(s.numbers[:, None], 400, axis=1)) for s in (rubs, true, plain)]
    assert rates[0] == pytest.approx(rates[1], rel=1e-9)
    assert not np.allclose(rates[0], rates[2])
    assert rubs.dry_joints() == plain.dry_joints()  # whatever was evaluated last
    assert [("frictionloss" in page_text(s, tmp_path)) for s in (plain, true, rubs)] == [False, False, True]


@pytest.mark.parametrize("own", [0.0, 0.05])
def test_friction_of_the_solver_is_coulomb_friction_and_written_as_frictionloss(tmp_path, own):
    """The model has none, or a third of it, which has to grow by the rest."""
    simulator = simulator_of(tmp_path, f' frictionloss="{own}"' if own else "")
    log = servo_log(mujoco.MjModel.from_xml_string(ARM.format(DRY)), amplitude=0.3, rows=1000)
    found = diagnose_simulator(log, simulator, LIBRARY)
    (cause,) = found.causes
    assert (cause.effects, cause.where, cause.grade) == (("coulomb_friction",), ("arm",), "sure")
    assert found.verdict == "cause"
    assert cause.parameters["amplitude"].value == pytest.approx(0.15 - own, rel=0.03)
    assert cause.parameters["amplitude"].unit == "N m"
    names = [(c.effect, c.where) for c in found.candidates]
    assert len(names) == len(set(names))
    evidence = evidence_of(log, simulator, refit=True)
    assert list(added(evidence, found)) == ["coulomb_friction@arm (in the solver)"]
    assert found.corrected.get("dof_frictionloss.arm") == pytest.approx(0.15, rel=0.02)
    folder = tmp_path / "corrected"
    folder.mkdir()
    again = found.corrected.write_corrected(folder, folder, lambda page: read_simulator(page, trust=True))
    assert 'frictionloss="0.1' in (folder / "corrected.xml").read_text()
    assert not again.effects


def test_a_set_with_one_form_of_a_law_is_refitted_with_the_other_too(tmp_path):
    simulator = simulator_of(tmp_path)
    log = servo_log(mujoco.MjModel.from_xml_string(ARM.format(DRY)), amplitude=0.3, rows=400)
    evidence = evidence_of(log, simulator, refit=True)
    smooth, solved = "coulomb_friction@arm", "coulomb_friction@arm (in the solver)"
    search = Competition(evidence, [smooth, solved], None, learn(evidence, [smooth, solved]).templates)
    search.screen()
    begun = {p.name: p.nominal for p in evidence.effects[smooth].parameters}
    found = search._refined({smooth: begun}, search.base)
    assert found.names == {solved}
    assert found.score > search._done[frozenset({smooth})].score
