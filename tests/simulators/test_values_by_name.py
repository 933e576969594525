"""Values by name, as a function is given them at every step."""

import numpy as np
import pytest

from pamid.simulators.ports import Values


def test_a_row_goes_by_its_name_without_a_search_among_what_arrays_have(monkeypatch):
    x = Values.of(np.array([[0.1, 0.2], [2.0, 3.0]]), ("angle", "T"))

    def searched(values, name):
        raise AssertionError(name)

    monkeypatch.setattr(Values, "__getattr__", searched)
    np.testing.assert_array_equal(x.angle, [0.1, 0.2])
    np.testing.assert_array_equal(x.T, [2.0, 3.0])


def test_a_function_may_set_a_value_and_is_told_of_names_that_are_not_there():
    x = Values.of(np.array([0.1, 2.0]), ("angle", "speed"))
    x.angle = 0.3
    assert x.angle == 0.3 and x.speed == 2.0
    with pytest.raises(AttributeError, match="angle, speed"):
        x.torque  # noqa: B018
