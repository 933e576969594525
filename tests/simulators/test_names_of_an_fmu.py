"""Variables of an FMU keep names of any alphabet; those that no port or column may have get a _ before them."""

from __future__ import annotations

import io
import shutil
import zipfile
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from pamid.cli import main
from pamid.errors import ParameterError
from pamid.simulators import FmuSimulator, Port
from pamid.simulators.fmu_model import _distinct


def test_names_are_kept_as_far_as_ports_may_have_them() -> None:
    plain = {"ü": "ü", "速度": "速度", "1u": "_1u", "a.b[1]": "a_b_1", "time": "_time", "trajectory": "_trajectory"}
    assert _distinct(list(plain)) == {port: own for own, port in plain.items()}


@pytest.mark.parametrize("names", [{"name": "trajectory"}, {"name": "path", "column": "trajectory"}])
def test_the_column_that_names_the_runs_is_no_signal(names: dict[str, str]) -> None:
    with pytest.raises(ParameterError, match="which names the runs"):
        Port(kind="output", **names)


@pytest.mark.skipif(shutil.which("cc") is None, reason="needs a C compiler")
def test_the_printed_commands_run_with_odd_names_and_units_in_brackets(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("fmpy")
    from pamid.export.ode_fmu import ode_fmu

    monkeypatch.chdir(tmp_path)
    made = ode_fmu(
        "lag", lambda t, x, u, p: [(u.volt - x.speed) / p.T], {"speed": 0.0}, {"volt": 0.0}, {"T": 0.5},
        outputs=lambda t, x, u, p: {"reading": x.speed}, units={"volt": "V", "reading": "rad/s"},
    )  # fmt: skip
    with zipfile.ZipFile(io.BytesIO(made)) as old, zipfile.ZipFile("lag.fmu", "w") as new:
        for name in old.namelist():
            data = old.read(name)
            if name == "modelDescription.xml":
                for word, other in (("volt", "ü"), ("reading", "1u"), ("T", "trajectory")):
                    data = data.replace(f'name="{word}"'.encode(), f'name="{other}"'.encode())
            new.writestr(name, data)
    rng, t, x, rows = np.random.default_rng(0), np.arange(0.0, 4.0, 0.02), 0.0, []
    volt = 3.0 * np.sin(2.0 * t) + np.sin(5.0 * t)
    for u in volt:
        rows.append(x)
        x = u + (x - u) * np.exp(-0.02 / 0.5)
    reading = np.array(rows) + 0.01 * rng.standard_normal(len(t))
    log = pd.DataFrame({"trajectory": "a", "time": t, "ü [V]": volt, "1u [rad/s]": reading})
    log.to_csv("log.csv", index=False)
    assert main(["init", "log.csv", "--sim", "lag.fmu", "--yes", "--out", "setup"]) == 0
    joint = next(line for line in Path("setup/sim.toml").read_text(encoding="utf-8").splitlines() if "joint" in line)
    assert 'velocity = "_1u", through = "ü"' in joint  # the only drive is where friction may act
    command = next(line for line in capsys.readouterr().out.splitlines() if "pamid evaluate" in line)
    assert main(command.split()[2:]) == 0
    floor = next(line for line in capsys.readouterr().out.splitlines() if line.startswith("_1u")).split()
    assert float(floor[-2]) < 1.2  # the FMU is right: what remains is noise


@pytest.mark.skipif(shutil.which("cc") is None, reason="needs a C compiler")
def test_variables_with_the_same_plain_name_keep_their_own_values_in_a_run(tmp_path: Path) -> None:
    pytest.importorskip("fmpy")
    from pamid.export.ode_fmu import ode_fmu

    made = ode_fmu(
        "two", lambda t, x, u, p: [u.go - x.a, u.go - 2.0 * x.b], {"a": 0.0, "b": 0.0}, {"go": 0.0}, {},
        outputs=lambda t, x, u, p: {"y": x.a, "yy": x.b},
    )  # fmt: skip
    with zipfile.ZipFile(io.BytesIO(made)) as old, zipfile.ZipFile(tmp_path / "two.fmu", "w") as new:
        for name in old.namelist():
            data = old.read(name)
            new.writestr(name, data.replace(b'name="yy"', b'name="y."') if name == "modelDescription.xml" else data)
    two = FmuSimulator(tmp_path / "two.fmu", trust=True)
    assert two.outputs == ("y", "y_2")
    t = np.arange(0.0, 3.0, 0.05)
    found = two.run(t, np.ones((1, len(t))), np.zeros(0), np.zeros(0))
    assert found == pytest.approx(np.stack([1.0 - np.exp(-t), 0.5 * (1.0 - np.exp(-2.0 * t))]), abs=1e-3)
