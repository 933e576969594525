"""A corpus of damaged and hostile model files: refused, or predicting as the healthy one, or raising."""

from __future__ import annotations

import json
import os
import resource
import sys
import time
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from pamid.estimators import PolynomialNARX, RateTransformer, StaticPIHM
from sklearn.linear_model import Ridge
from sklearn.pipeline import make_pipeline
from sklearn.svm import SVR

ROOT = Path(__file__).resolve().parents[2]
if not (ROOT / "benchmarks").is_dir():
    pytest.skip("needs the repository", allow_module_level=True)
sys.path.append(str(ROOT))

from benchmarks.damaged_models import X, Y, bombs, entries_of, healthy_models, outcomes, packed  # noqa: E402
from pamid.cli import main  # noqa: E402
from pamid.errors import ModelFileError  # noqa: E402
from pamid.persistence import load, save  # noqa: E402
from pamid.training import Adam  # noqa: E402

MUST_REFUSE = ("smuggled", "other_types", "state_of_generator")


@pytest.fixture(scope="module")
def healthy(tmp_path_factory):
    return healthy_models(tmp_path_factory.mktemp("healthy"))


def test_no_hostile_or_damaged_file_harms_or_lies(healthy, tmp_path):
    found = list(outcomes(healthy, tmp_path))
    assert len(found) >= 250
    assert not [(what, said) for _, what, said in found if said not in ("refused", "same", "no predictions")]
    assert not [(what, said) for kind, what, said in found if kind in MUST_REFUSE and said != "refused"]
    assert [file.name for file in tmp_path.iterdir()] == ["m.pamid"]


def test_a_damaged_name_of_an_entry_is_not_printed_as_a_page_of_bytes(healthy, tmp_path):
    """What the archive's reader says quotes the name as the damaged header has it, with whatever follows."""
    data = bytearray(healthy["network"][0].read_bytes())
    second = data.index(b"PK\x03\x04", 4)
    data[second + 27] ^= 0x04  # a name that is 1,024 bytes longer
    target = tmp_path / "m.pamid"
    target.write_bytes(bytes(data))
    with pytest.raises(ModelFileError, match="damaged") as caught:
        load(target)
    assert len(str(caught.value)) < 500


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs a system with fork")
def test_bombs_take_no_more_than_512_mib_and_seconds(healthy, tmp_path):
    for name, what, data in bombs(healthy):
        target = tmp_path / "m.pamid"
        target.write_bytes(data)
        del data
        started = time.monotonic()
        child = os.fork()
        if child == 0:
            code = 1
            try:
                used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
                resource.setrlimit(resource.RLIMIT_AS, (used + 2**29,) * 2)
                try:
                    load(target)
                except ModelFileError:
                    code = 0
            finally:
                os._exit(code)
        assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0, f"{name}, {what}"
        assert time.monotonic() - started < 10, what


def test_a_generator_that_would_be_saved_is_refused_before(tmp_path):
    for model in (Ridge(random_state=np.random.default_rng(0)), SVR().fit(X, Y)):
        with pytest.raises(ModelFileError, match="cannot be saved"):
            save(model, tmp_path / "m.pamid")
    with pytest.raises(ModelFileError, match="checkpoint=None"):
        save(StaticPIHM(trainer=Adam(checkpoint=str(tmp_path))), tmp_path / "m.pamid")
    assert not list(tmp_path.iterdir())


def test_series_and_rates_come_back(tmp_path):
    table = pd.DataFrame(X, columns=["eps", "P", "a", "b"]).assign(time=np.arange(60) * 0.01)
    model = make_pipeline(RateTransformer(one_trajectory=True), Ridge()).fit(table, Y)
    assert np.array_equal(load(save(model, tmp_path / "m.pamid")).predict(table), model.predict(table))
    narx = PolynomialNARX(inputs=("x",), signals={"x": 0}, one_trajectory=True).fit(X, Y)
    assert np.array_equal(load(save(narx, tmp_path / "m.pamid")).predict(X), narx.predict(X))


def test_a_file_that_lies_about_itself_is_refused_or_shown_without_it(healthy, tmp_path, capsys):
    file, _ = healthy["force"]
    head = json.loads(entries_of(file)["pamid.json"])

    def written(**changes) -> str:
        text = json.dumps({k: v for k, v in {**head, **changes}.items() if v is not ...})
        (tmp_path / "m.pamid").write_bytes(packed({**entries_of(file), "pamid.json": text.encode()}))
        return str(tmp_path / "m.pamid")

    for key in ("class", "steps", "created", "metadata", "columns", "units"):
        for value in (None, -1, "\x1b[31mred" if not isinstance(head[key], str) else [], ...):
            assert main(["present", written(**{key: value})]) == 2
            assert f"has {key} = " in capsys.readouterr().err
    for number in (None, "x", [], {}):
        assert main(["present", written(metadata={"training": {"rmse": number, "nrmse": 0.1}})]) == 0
        assert "fit / %" not in capsys.readouterr().out
    assert main(["present", written(created="\x1b[31mred", metadata={"equation": "\x1b[31mred"})]) == 0
    assert "\x1b" not in capsys.readouterr().out
