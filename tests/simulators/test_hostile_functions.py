"""Simulators of a user's own that fail: told as their error, with a line; nothing half written, and no answer."""

from __future__ import annotations

import contextlib
import io
import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from pamid.cli import main

PAGE = """
kind = "ode"
[ode]
function = "{source}"
[ports]
F = {{ kind = "input", unit = "N" }}
x = {{ kind = "state", unit = "m" }}
v = {{ kind = "state", unit = "m/s" }}
[parameters]
m = {{ value = 2.0, unit = "kg" }}
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """A cart on a rail, and simulators of it."""
    folder = tmp_path_factory.mktemp("cart")
    t, parts = np.arange(0, 4, 0.01), []
    for k in range(2):
        F = 6 * np.sin((1 + k) * t)
        v = np.cumsum(F) * 0.01 / 2.0
        parts.append(pd.DataFrame({"trajectory": f"run {k}", "time": t, "F": F, "x": np.cumsum(v) * 0.01, "v": v}))
    noisy = pd.concat(parts)
    noisy[["x", "v"]] += np.random.default_rng(0).normal(0, [1e-5, 1e-3], (len(noisy), 2))
    noisy.to_csv(folder / "log.csv", index=False)
    return folder


def asked(folder: Path, source: str, command: str, capsys) -> tuple[int, str, str]:
    (folder / "sim.toml").write_text(PAGE.format(source=source))
    options = ["--out", str(folder / "out"), "--effects", "viscous_friction"] if command == "diagnose" else []
    sim = ["--sim", str(folder / "sim.toml"), "--trust"]
    code = main([command, str(folder / "log.csv"), *sim, *options, "--quiet", "--json"])
    out, err = capsys.readouterr()
    assert not (folder / "out").exists() or code == 0
    return code, out, err


@pytest.mark.parametrize("command", ["evaluate", "diagnose", "resid"])
@pytest.mark.parametrize(
    ("body", "words"),
    [
        ("raise ValueError('no')", "rates raised ValueError in line 2: no"),
        ("import sys; sys.exit(0)", "rates raised SystemExit in line 2"),
        ("class Own(BaseException): pass\n    raise Own('gone')", "rates raised Own in line 3: gone"),
        ("return [x.v, 1 / 0]", "raised ZeroDivisionError"),
        ("return [x.v, u.F / p.nosuch]", "no value is named 'nosuch'"),
        ("return rates(t, x, u, p)", "raised RecursionError"),
        ("return None", "returned 1 values"),
        ("return 'ab'", "did not return plain numbers"),
        ("return [x.v, 1j]", "did not return plain numbers"),
        ("return [x.v, '1.0']", "('1.0' is not a real number)"),
        ("return [x.v, None]", "('None' is not a real number)"),
        ("return [x.v, u.F + 1e-9j]", "is not a real number"),
        ("import numpy as np\n    return [x.v, np.ma.masked_greater(u.F, 1.0)]", "values that are not finite in"),
        ("return [x.v]", "returned 1 values"),
        ("return [float('nan')] * 2", "values that are not finite in"),
        ("return [x.v, u.F * 1e308 * 1e10]", "values that are not finite in"),
        ("return [[x.v, x.v], [u.F, u.F]]", "returned 4 values"),
        ("import itertools; return itertools.repeat(1.0)", "returned more than 2 values"),
        ("return [object(), object()]", "did not return plain numbers"),
        ("class Own(Exception):\n        def __str__(self): return 3\n    raise Own", "Own in line 4: its message"),
    ],
)
def test_a_function_that_fails_says_where(body, words, command, folder, capsys):
    (folder / "cart.py").write_text(f"def rates(t, x, u, p):\n    {body}\n")
    code, out, err = asked(folder, "cart.py:rates", command, capsys)
    assert (code, out) == (2, "")
    assert words in err


@pytest.mark.parametrize(
    ("source", "words"),
    [
        ("os:system", "raised TypeError"),
        ("json:loads", "raised TypeError"),
        ("few.py:rates", "raised TypeError"),
        ("number.py:rates", "is not a function"),
        ("none.py:rates", "does not exist"),
        ("syntax.py:rates", "SyntaxError"),
        ("exits.py:rates", "SystemExit"),
        ("cart.py", "'module:function' or 'file.py:function'"),
    ],
)
def test_what_is_no_such_function_is_refused(source, words, folder, capsys):
    (folder / "few.py").write_text("def rates(a, b):\n    return 1\n")
    (folder / "number.py").write_text("rates = 3\n")
    (folder / "syntax.py").write_text("def rates(:\n")
    (folder / "exits.py").write_text("import sys\nsys.exit(0)\n")
    code, out, err = asked(folder, source, "evaluate", capsys)
    assert (code, out) == (2, "")
    assert words in err


def test_what_a_function_prints_stays_out_of_the_answer(folder, capsys):
    (folder / "cart.py").write_text(
        "print('hello')\ndef rates(t, x, u, p):\n    print('here')\n    return [x.v, u.F / p.m]\n"
    )
    code, out, err = asked(folder, "cart.py:rates", "evaluate", capsys)
    assert code == 0
    assert json.loads(out)["equations"]
    assert "hello" in err
    assert "here" in err


HEALTHY = "return [x.v, u.F / p.m]"


@pytest.fixture(scope="module")
def expected(folder) -> dict:
    """What is said of the function that does nothing else."""
    (folder / "healthy.py").write_text(f"def rates(t, x, u, p):\n    {HEALTHY}\n")
    (folder / "healthy.toml").write_text(PAGE.format(source="healthy.py:rates"))
    argv = ["evaluate", str(folder / "log.csv"), "--sim", str(folder / "healthy.toml"), "--trust", "--quiet", "--json"]
    with contextlib.redirect_stdout(io.StringIO()) as out:
        assert main(argv) == 0
    return json.loads(out.getvalue())["equations"]


@pytest.mark.parametrize(
    "body",
    [
        "import warnings; warnings.simplefilter('error')",
        "import numpy; numpy.seterr(all='raise')",
        "KEPT.append((x, u))",
        "w = u.F + 0.0; u[:] = 1e9; u = {'F': w}; u = type('U', (), u)",
        "v = x.v + 0.0; x[...] *= 3.0; x = type('X', (), {'v': v})",
    ],
    ids=["warnings", "seterr", "keeps", "overwrites inputs", "overwrites states"],
)
def test_what_a_function_does_to_its_arguments_and_to_warnings_stays_with_it(body, folder, expected, capsys):
    (folder / "cart.py").write_text(f"KEPT = []\ndef rates(t, x, u, p):\n    {body}\n    {HEALTHY}\n")
    code, out, _ = asked(folder, "cart.py:rates", "evaluate", capsys)
    assert code == 0
    assert json.loads(out)["equations"] == expected
