"""Logs read in pieces are the logs read as a whole."""

from __future__ import annotations

import json

import numpy as np
import pandas as pd
import pytest
from pamid.estimators import PolynomialForce

from pamid.bench import BenchParameters, simulate, sine, unfold
from pamid.cli import main
from pamid.equations import evaluate_log
from pamid.errors import HostileLogError, InterleavedTrajectoryError, ParameterError, SamplingWarning, TruncatedLogError
from pamid.signals import read_log, read_log_pieces, write_log
from pamid.signals.pieces import cuts, read_log_part
from pamid.signals.thinning import whole_trajectories


@pytest.fixture(scope="module")
def bench() -> BenchParameters:
    return BenchParameters.for_muscle("B")


@pytest.fixture(scope="module")
def log(bench) -> pd.DataFrame:
    runs = [sine(frequency, 10.0, int(samples)) for frequency, samples in ((2, 300), (4, 500), (8, 200), (5, 400))]
    return simulate(bench, runs, seed=0)


@pytest.mark.parametrize("ending", ["parquet", "h5", "csv"])
@pytest.mark.parametrize("rows", [1, 700, 100_000])
def test_pieces_together_are_the_log(log, ending, rows, tmp_path):
    file = write_log(log, tmp_path / f"log.{ending}")
    pieces = list(read_log_pieces(file, rows=rows))
    pd.testing.assert_frame_equal(pd.concat(pieces, ignore_index=True), read_log(file))
    if ending == "csv":
        assert len(pieces) == 1, "text is read as a whole"
    else:
        assert len(pieces) == {1: log["trajectory"].nunique(), 700: 4, 100_000: 1}[rows] or rows == 700
        for piece in pieces:
            assert len(piece) <= rows or piece["trajectory"].nunique() == 1


@pytest.mark.parametrize("batch", [1, 2, 3, 7, 50])
def test_cuts_fall_between_trajectories(batch):
    rng = np.random.default_rng(batch)
    lengths = rng.integers(1, 9, 20)
    names = np.repeat([f"run-{k}" for k in range(20)], lengths)
    edges = set(np.cumsum(lengths).tolist())
    for rows in (1, 5, 12, 1000):
        ends = cuts([names[i : i + batch] for i in range(0, len(names), batch)], rows)
        assert ends[-1] == len(names)
        assert set(ends) <= edges
        assert (np.diff([0, *ends]) > 0).all()
        for begin, end in zip([0, *ends], ends, strict=False):
            assert end - begin <= rows or len(set(names[begin:end])) == 1
        assert len(ends) < len(lengths) or rows < 6, "trajectories that fit together are read together"


def test_small_row_groups_and_categories(log, tmp_path):
    file = tmp_path / "log.parquet"
    log.assign(trajectory=log["trajectory"].astype("category")).to_parquet(file, row_group_size=97)
    together = pd.concat(list(read_log_pieces(file, rows=600)), ignore_index=True)
    expected = read_log(file)
    assert together["trajectory"].astype(str).tolist() == expected["trajectory"].astype(str).tolist()
    pd.testing.assert_frame_equal(together.drop(columns="trajectory"), expected.drop(columns="trajectory"))


def test_mapped_columns_and_one_name_in_two_files(log, tmp_path):
    raw = log.rename(columns={"trajectory": "run", "P1": "p1"}).assign(p1=log["P1"] / 1e5)
    for name in ("a", "b"):
        raw.to_parquet(tmp_path / f"{name}.parquet")
    signals = {"time": "time", "q": "q", "P1": {"column": "p1", "unit": "bar", "gauge": False}}
    mapping = {"trajectory": "run", "signals": signals}
    pieces = list(read_log_pieces(tmp_path, mapping, rows=500))
    together = pd.concat(pieces, ignore_index=True)
    names = together["trajectory"].unique().tolist()
    assert len(names) == 2 * log["trajectory"].nunique()
    assert [n for n in names if "@" in n] == names[len(names) // 2 :]
    assert np.allclose(together["P1"][: len(log)], log["P1"])


def test_an_evaluation_in_pieces_is_that_of_the_log(log, bench, tmp_path, capsys):
    file = write_log(log, tmp_path / "log.parquet")
    whole, parts = evaluate_log(log, bench), evaluate_log(read_log_pieces(file, rows=600), bench)
    assert list(parts) == list(whole)
    assert parts.skipped == whole.skipped
    for name, expected in whole.items():
        assert parts[name].rmse == pytest.approx(expected.rmse, rel=1e-12)
        assert parts[name].nrmse == pytest.approx(expected.nrmse, rel=1e-9)
        assert parts[name].trajectories == expected.trajectories
    bench.to_toml(tmp_path / "sim.toml")
    model = tmp_path / "force.pamid"
    train = ["fit", str(file), "--sim", str(tmp_path / "sim.toml"), "--estimator", "PolynomialForce", "--quiet"]
    assert main([*train, "--folds", "0", "--out", str(model)]) == 0
    for options in ([], ["--model", str(model)]):
        command = ["evaluate", str(file), "--sim", str(tmp_path / "sim.toml"), *options, "--json", "--quiet"]
        found = []
        for pieces in ([], ["--piece-rows", "600"]):
            capsys.readouterr()
            assert main([*command, *pieces]) == 0
            found.append(json.loads(capsys.readouterr().out))
        assert _near(found[0], found[1])
    assert main(["evaluate", str(file), "--sim", str(tmp_path / "sim.toml"), "--piece-rows", "9", "--refit"]) == 2


def _near(a, b) -> bool:
    if isinstance(a, dict):
        return a.keys() == b.keys() and all(_near(a[k], b[k]) for k in a)
    return a == pytest.approx(b, rel=1e-9) if isinstance(a, float) else a == b


def test_a_fit_in_pieces_is_that_of_the_log(log, bench, tmp_path):
    file = write_log(log, tmp_path / "log.parquet")
    table = unfold(log, bench)
    columns = ["eps", "P"]
    whole = PolynomialForce().fit(table[columns], table["F"])
    pieces = PolynomialForce()
    for piece in read_log_pieces(file, rows=600):
        part = unfold(piece, bench)
        pieces.partial_fit(part[columns], part["F"])
    assert np.allclose(pieces.predict(table[columns]), whole.predict(table[columns]), rtol=1e-9, atol=1e-9)


def test_bad_logs_are_named(log, tmp_path):
    with pytest.raises(ParameterError, match="rows is 0"):
        read_log_pieces(tmp_path, rows=0)
    mixed = pd.concat([log[:100], log[400:], log[100:400]])
    file = write_log(mixed, tmp_path / "mixed.parquet")
    with pytest.raises(InterleavedTrajectoryError, match="not contiguous"):
        list(read_log_pieces(file, rows=50, time_order="sort"))
    whole = write_log(log, tmp_path / "log.parquet")
    with pytest.raises(HostileLogError, match="cannot be cut"):
        list(read_log_pieces(whole, rows=10, max_bytes=100))
    whole.write_bytes(whole.read_bytes()[:-200])
    with pytest.raises(TruncatedLogError, match="damaged or cut off"):
        list(read_log_pieces(whole))
    gaps = log[: len(log) // 2].copy()
    gaps.loc[gaps.index > 150, "time"] += 1.0
    with pytest.warns(SamplingWarning, match="gaps"):
        list(read_log_pieces(write_log(gaps, tmp_path / "gaps.h5"), rows=50))


@pytest.mark.parametrize("ending", ["parquet", "h5", "csv"])
@pytest.mark.parametrize("most", [25, 90, 1000])
def test_a_part_of_a_log_is_what_is_kept_of_the_whole(tmp_path, ending, most):
    lengths = [10, 30, 8, 22, 40, 5]
    log = pd.concat([_run(f"r{k}", n) for k, n in enumerate(lengths)], ignore_index=True)
    file = write_log(log, tmp_path / f"log.{ending}")
    part, rows = read_log_part(file, most=most)
    assert rows == len(log)
    pd.testing.assert_frame_equal(part, whole_trajectories(read_log(file), most).reset_index(drop=True))


def test_a_part_of_a_log_with_mixed_rows_is_refused_as_the_whole_is(tmp_path):
    log = pd.concat([_run("a", 20), _run("b", 20), _run("a", 20).assign(time=lambda t: t["time"] + 1.0)])
    log.to_parquet(tmp_path / "log.parquet", index=False)
    with pytest.raises(InterleavedTrajectoryError, match="comes back"):
        read_log_part(tmp_path / "log.parquet", most=30)


def _run(name: str, n: int) -> pd.DataFrame:
    return pd.DataFrame({"trajectory": name, "time": 1e-3 * np.arange(n), "P": 2e5 + 1e3 * np.arange(n)})
