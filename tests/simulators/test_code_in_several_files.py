"""A user's function that uses other files, objects, partial functions and closures: asked at many instants at once."""

from __future__ import annotations

import functools
import math
import sys
from dataclasses import dataclass

import numpy as np
import pytest

from pamid.simulators import FunctionSimulator, Port
from pamid.simulators.elementwise import elementwise
from pamid.simulators.function import load_function
from pamid.simulators.rebound import _Anew

TANKS = [Port("q", "input", "m3/s"), Port("h", "state", "m"), Port("w", "state", "m")]
FILES = {
    "parts/__init__.py": "",
    "parts/valves.py": """
from math import sqrt
def flow(dp, c):
    return c * sqrt(dp) if dp > 0 else -c * sqrt(-dp)
""",
    "shapes.py": """
from __future__ import annotations
import functools, math
from dataclasses import dataclass
@dataclass
class Shape:
    k: float = 2.0
    def area(self, h):
        return self.k + max(h, 0.0)
@dataclass
class Cone(Shape):
    m: float = 1.0
    def area(self, h):
        return super().area(h) * math.exp(-0.1 * self.m)
@functools.lru_cache
def level(h):
    return math.cos(h)
CONES = [Cone(1.0), Cone(3.0, 0.5)]
""",
    "plant.py": """
from __future__ import annotations
import functools
from dataclasses import dataclass, field
import shapes
from parts import valves
CALLS = []
@dataclass
class Plant:
    cones: list = field(default_factory=lambda: shapes.CONES)
    g: float = 9.81
    def __call__(self, t, x, u, p):
        import math
        CALLS.append(1)
        q = valves.flow(x.h - x.w, p.k)
        up, down = self.cones
        return [(u.q - q) / up.area(x.h), q / down.area(x.w) + math.sin(x.w) * self.g + shapes.level(x.h)]
class Whole(Plant):
    pass
def within(c):
    def root(h):
        return shapes.math.sqrt(max(h, 0.1)) * c
    def rate(t, x, u, p):
        CALLS.append(1)
        return [root(x.h), valves.flow(x.w, c)]
    return rate
def of_any(c, t, x, u, p):
    CALLS.append(1)
    return [valves.flow(x.h, c), shapes.CONES[0].area(x.w) + u.q]
def counting():
    n = 0
    def rate(t, x, u, p):
        nonlocal n
        n += 1
        return [n + valves.flow(x.h, 1.0), x.w]
    return rate
plant, closed, part, counted = Whole(), within(3.0), functools.partial(of_any, 2.0), counting()
method = plant.__call__
""",
}


@pytest.fixture
def folder(tmp_path, monkeypatch):
    for name in ("shapes", "parts", "parts.valves"):
        monkeypatch.delitem(sys.modules, name, raising=False)
    (tmp_path / "parts").mkdir()
    for name, text in FILES.items():
        (tmp_path / name).write_text(text)
    return tmp_path


def given(n=50):
    rng = np.random.default_rng(1)
    return np.zeros(n), rng.normal(size=(2, n)), rng.normal(size=(1, n)), np.full((1, n), 2.0)


def one_by_one(simulator, t, *rows):
    return np.hstack([simulator.rate(t[k : k + 1], *(one[:, [k]] for one in rows)) for k in range(len(t))])


@pytest.mark.parametrize("name", ["plant", "method", "closed", "part"])
def test_all_that_a_function_uses_goes_element_by_element(folder, name) -> None:
    function = load_function(f"plant.py:{name}", folder)
    simulator = FunctionSimulator(function, TANKS, {"k": 2.0}, form="ode")
    found = simulator.rate(*given())
    (calls := sys.modules["pamid_simulator_plant"].CALLS).clear()
    assert np.array_equal(simulator.rate(*given()), found)
    assert simulator.at_once and len(calls) < 10  # the ways through the valve and the shapes
    assert np.allclose(one_by_one(simulator, *given()), found)


def test_what_is_set_later_in_an_object_of_an_object_holds(folder) -> None:
    plant = load_function("plant.py:plant", folder)
    simulator = FunctionSimulator(plant, TANKS, {"k": 2.0}, form="ode")
    before = simulator.rate(*given())
    plant.g, plant.cones[0].k = 0.0, 50.0
    sys.modules["shapes"].level = lambda h: 0.0 * h
    after = simulator.rate(*given())
    assert np.allclose(one_by_one(simulator, *given()), after) and np.median(abs(after - before)) > 0.1
    plant.cones = [type(plant.cones[0])(1e9)] * 2
    assert abs(simulator.rate(*given())).max() < 1e-6


def test_a_function_that_counts_in_one_around_it_is_asked_one_by_one(folder) -> None:
    assert elementwise(load_function("plant.py:counted", folder)) is None


def test_what_stands_in_arguments_is_made_anew_and_libraries_are_not() -> None:
    power = functools.partial(math.pow, 2.0)

    def cosine(x, of=math.cos, *, scale=power):
        return of(x) * scale(x)

    x = np.linspace(0.0, 1.0, 5)
    many = elementwise(cosine)
    assert many is not None and np.allclose(many(x), np.cos(x) * 2.0**x)
    assert elementwise(functools.partial(np.interp, xp=[0, 1], fp=[0, 1])) is None


def test_slots_are_read_where_they_stand() -> None:
    @dataclass(slots=True)
    class Gain:
        k: float

        def of(self, h):
            return self.k * math.sin(h)

    gain = Gain(1.0)
    simulator = FunctionSimulator(lambda t, x, u, p: [gain.of(x.h), x.w], TANKS, {"k": 2.0}, form="ode")
    before = simulator.rate(*given())
    gain.k = 2.0
    assert np.allclose(simulator.rate(*given()), before * [[2.0], [1.0]])


def test_a_function_that_a_call_makes_is_not_made_anew_again(monkeypatch) -> None:
    """Else each call would leave one behind."""

    class Plant:
        def __call__(self, h):
            self.of = lambda x: math.sin(x)
            return self.of(h) + max(h, 0.0)

    made, plain = [], _Anew._function
    monkeypatch.setattr(_Anew, "_function", lambda self, one: made.append(one) or plain(self, one))
    many, h = elementwise(Plant()), np.linspace(-1.0, 1.0, 5)
    assert many is not None
    for _ in range(3):
        assert np.allclose(many(h), np.sin(h) + np.maximum(h, 0.0))
    assert len(made) == 1
