"""Equations that are long, deep or hold numbers beyond all measure: refused in a sentence, or read."""

from __future__ import annotations

import pytest

from pamid.errors import ParameterError
from pamid.simulators import EquationSimulator, Port

PORTS = [Port("u", "input", "V"), Port("y", "output", "N")]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("9" * 400 + "*u", "beyond 1.8e308"),
        ("0x" + "f" * 300 + "*u", "beyond 1.8e308"),
        ("-" * 1800 + "u", "nested too deeply"),
        ("+" * 1800 + "u", "nested too deeply"),
        ("(" * 900 + "u" + ")" * 900, "not an equation"),
        ("1j*u", "holds 1j"),
        ("u" + "+u" * 1500, "not an equation"),
        ("u.real", "holds"),
        ("u[0]", "holds"),
        ("f'{u}'", "holds"),
        ("[u for u in u]", "holds"),
        ("lambda: u", "holds"),
    ],
)
def test_an_equation_beyond_measure_is_refused(text: str, words: str) -> None:
    with pytest.raises(ParameterError, match=words):
        EquationSimulator({"y": text}, PORTS)


@pytest.mark.parametrize(("text", "factor"), [("0x10*u", 16.0), ("1_0*u", 10.0), ("--u", 1.0), ("u" + "+u" * 900, 901)])
def test_odd_ways_of_writing_numbers_are_read(text: str, factor: float) -> None:
    import numpy as np

    sim = EquationSimulator({"y": text}, PORTS)
    assert sim.output(np.zeros(1), np.zeros((0, 1)), np.ones((1, 1)), np.zeros((0, 1))) == pytest.approx(factor)
