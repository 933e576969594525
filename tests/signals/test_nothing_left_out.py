"""What of a file cannot be read is told or refused: no column and no name of a run goes in silence."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path

import numpy as np
import pytest

from pamid.errors import DuplicateColumnError, MissingColumnError, NonFiniteError, ReadingWarning
from pamid.signals import read_log
from pamid.toml_files import toml_key, toml_value

T = 0.01 * np.arange(50)
X = np.sin(T)


def hdf5(path: Path, kind: str, group: str) -> None:
    """Write two readable columns and one that is not, at the top or in a group."""
    h5py = pytest.importorskip("h5py")
    with h5py.File(path.with_name("other.h5"), "w") as other:
        other["q"] = X
    X.tofile(path.with_name("raw.bin"))
    with h5py.File(path, "w") as file:
        at = file.create_group(group) if group else file
        at["time"], at["F"] = T, X
        if kind == "virtual":
            layout = h5py.VirtualLayout(shape=(50,), dtype=float)
            layout[:] = h5py.VirtualSource("other.h5", "q", shape=(50,))
            at.create_virtual_dataset("q", layout)
        elif kind == "external":
            at.create_dataset("q", shape=(50,), dtype=float, external=[(str(path.with_name("raw.bin")), 0, 400)])
        else:
            at["q"] = {
                "a link": h5py.ExternalLink("other.h5", "q"), "complex": X + 1j, "49 rows": X[:-1],
                "dimensions": np.zeros((50, 2, 2)),
            }[kind]  # fmt: skip


@pytest.mark.parametrize("group", ["", "run"])
@pytest.mark.parametrize("kind", ["a link", "virtual", "external", "complex"])
def test_a_column_of_hdf5_that_stays_closed_is_told(kind: str, group: str, tmp_path: Path) -> None:
    hdf5(tmp_path / "log.h5", kind, group)
    with pytest.warns(ReadingWarning, match=rf"log.h5: '[run/]*q' \({kind}\) left out"):
        assert list(read_log(tmp_path / "log.h5")) == ["trajectory", "time", "F"]
    with pytest.raises(MissingColumnError, match=rf"no column 'q' for q.*\({kind}\)"):
        read_log(tmp_path / "log.h5", {"signals": {"time": "time", "q": "q"}})


@pytest.mark.parametrize("kind", ["49 rows", "dimensions"])
def test_a_column_of_another_shape_is_told(kind: str, tmp_path: Path) -> None:
    hdf5(tmp_path / "log.h5", kind, "")
    with pytest.warns(ReadingWarning, match=f"'q' .*{kind}.* left out"):
        read_log(tmp_path / "log.h5")


@pytest.mark.parametrize("inside", [True, False])
def test_complex_numbers_of_matlab_are_told(inside: bool, tmp_path: Path) -> None:
    import scipy.io

    columns = {"time": T, "F": X, "q": X + 1j}
    scipy.io.savemat(tmp_path / "log.mat", {"run": columns} if inside else columns)
    with pytest.warns(ReadingWarning, match="q' left out .complex numbers are not read"):
        read_log(tmp_path / "log.mat")


@pytest.mark.parametrize("text", ['{"time": [0, 1], "q": [0, 1], "q": [1, 1]}', '[{"time": 0, "q": 1, "q": 2}]'])
def test_a_key_that_stands_twice_is_refused(text: str, tmp_path: Path) -> None:
    (tmp_path / "log.json").write_text(text)
    with pytest.raises(DuplicateColumnError, match=r"log\.json: an object has the key 'q' twice"):
        read_log(tmp_path / "log.json")


@pytest.mark.parametrize("delimiter", [",", ";", ", "])
def test_runs_whose_names_differ_by_a_blank_are_two(delimiter: str, tmp_path: Path) -> None:
    blank = "" if delimiter == ", " else " "
    rows = [f"{0.01 * (20 * n + k):.2f}|{name}|0.{k:02d}" for n, name in enumerate((f"{blank}a", "a", "b"))
            for k in range(20)]  # fmt: skip
    text = "\n".join(["time|trajectory|x", *rows]).replace("|", delimiter)
    (tmp_path / "log.csv").write_text(text)
    names = list(read_log(tmp_path / "log.csv")["trajectory"].unique())
    assert names == ([" a", "a", "b"] if blank else ["a", "b"])


@pytest.mark.parametrize("text", ["a\nb", 'say "a"', "tab\t", "back\\slash", "\x7f\x00\x1f", "é 角", "", "a.b", "'"])
def test_any_name_is_valid_toml(text: str) -> None:
    assert tomllib.loads(f"{toml_key(text)} = {toml_value([text, True, 1.5])}") == {text: [text, True, 1.5]}


def test_a_corrected_page_takes_any_name_of_a_column(tmp_path: Path) -> None:
    from pamid.simulators import FunctionSimulator, Port, page_text, read_simulator

    (tmp_path / "own.py").write_text("def f(t, u, p):\n    return u.u\n")
    column = 'Kraft\n[N] "neu"\\ \x7f'
    import sys

    sys.path.insert(0, str(tmp_path))
    try:
        import own
    finally:
        sys.path.remove(str(tmp_path))
    sim = FunctionSimulator(own.f, [Port("u", "input", "V", column=column), Port("y", "output", "N")], form="algebraic")
    (tmp_path / "sim.toml").write_text(page_text(sim, tmp_path))
    again = read_simulator(tmp_path / "sim.toml", trust=True)
    assert next(p for p in again.ports if p.name == "u").column == column


def test_matrices_and_tables_beside_a_clock_are_columns(tmp_path: Path) -> None:
    """Of as many rows; others are told, and a group within itself is read once."""
    h5py = pytest.importorskip("h5py")
    table = np.zeros(50, dtype=[("i", "f8"), ("n", "i4")])
    with h5py.File(tmp_path / "log.h5", "w") as file:
        file["time"], file["q"], file["motor"], file["drive/u"] = T, np.stack([X, T], axis=1), table, X
        file["turned"], file["mode"], file["none"] = np.zeros((3, 50)), ["on"] * 50, h5py.Empty("f8")
        file["drive/again"] = file["drive"]
    with pytest.warns(ReadingWarning) as told:
        log = read_log(tmp_path / "log.h5")
    assert set(log) == {"trajectory", "time", "q[0]", "q[1]", "motor/i", "motor/n", "drive/u"}
    np.testing.assert_array_equal(log["q[1]"], T)
    said = " ".join(str(w.message) for w in told)
    for lost in ("'turned' (3 x 50, others 50 rows)", "'mode' (not numbers)", "'none' (empty)"):
        assert lost in said


def test_a_matrix_in_a_group_is_columns_of_its_table(tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "log.h5", "w") as file:
        run = file.create_group("run")
        run["time"], run["x"], run["q"], run["note"], run["odd"] = T, X, np.stack([X, T], axis=1), "cold", np.eye(3)
    with pytest.warns(ReadingWarning, match=r"'run/odd' \(3 x 3\) left out"):
        assert list(read_log(tmp_path / "log.h5"))[1:] == ["time", "x", "q[0]", "q[1]"]


def test_the_1_of_a_lists_element_is_no_unit(tmp_path: Path) -> None:
    rows = "\n".join(f"{t},{x},{-x},{2 * x}" for t, x in zip(T, X, strict=True))
    (tmp_path / "log.csv").write_text(f"time,q[0],q[1],eps [1]\n{rows}\n")
    assert list(read_log(tmp_path / "log.csv"))[1:] == ["time", "q[0]", "q[1]", "eps"]


def test_lists_in_json_are_columns_and_other_objects_are_told(tmp_path: Path) -> None:
    rows = [{"time": t, "q": [t, -t], "arm": {"a": 1}} for t in T.tolist()]
    (tmp_path / "log.json").write_text(json.dumps(rows))
    with pytest.warns(ReadingWarning, match=r"log.json: 'arm' left out \(objects"):
        assert list(read_log(tmp_path / "log.json"))[1:] == ["time", "q[0]", "q[1]"]


def test_a_whole_number_beyond_every_float_is_refused(tmp_path: Path) -> None:
    (tmp_path / "log.json").write_text(json.dumps({"time": T.tolist(), "x": [10**400, *T[1:].tolist()]}))
    with pytest.raises(NonFiniteError, match="infinite values in 1 rows of x"):
        read_log(tmp_path / "log.json")
