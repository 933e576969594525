"""Units as people write them: of products, with prefixes, of a time that is no second."""

import pytest

from pamid.cli._equations import _number
from pamid.errors import UnitError
from pamid.simulators.dimensions import unit_powers, unit_text


@pytest.mark.parametrize("unit", ["m^3/s", "m3/s", "m**3/s", "m³/s", "m³·s⁻¹"])
def test_a_power_counts_however_it_is_written(unit):
    assert unit_powers(unit) == {"m": 3, "s": -1}
    assert unit_text([(unit, 1), ("s", -1)]) == "m^3/s^2"
    assert unit_powers("mol/m3") == {"mol": 1, "m": -3} and unit_powers("kg m2") == {"kg": 1, "m": 2}
    assert unit_powers("cmH2O") == {"cmH2O": 1}


@pytest.mark.parametrize(
    ("text", "value", "unit"),
    [
        ("220e-6 F", 2.2e-4, "F"),  # not in degrees Fahrenheit
        ("47 µH", 4.7e-5, "H"),  # not in hours
        ("4.2 MJ/K", 4.2e6, "J/K"),
        ("0.42 1/h", 0.42 / 3600.0, "1/s"),
        ("60 g/L", 60.0, "kg/m3"),
        ("2 mol/l", 2000.0, "mol/m^3"),
        ("3 kW/(m2 K)", 3000.0, "W/(m^2 K)"),
        ("7.2 mV/rpm", 7.2e-3 * 30.0 / 3.141592653589793, "V s/rad"),
        ("2 mAh", 7.2, "A s"),
        ("1 m^2.5/s", 1.0, "m^2.5/s"),
        ("20 °C", 293.15, "K"),
    ],
)
def test_a_number_of_equations_is_in_si(text, value, unit):
    found = _number("k", f"{text} ± 10 %")
    assert found.value == pytest.approx(value, rel=1e-12) and (found.unit, found.tolerance) == (unit, 0.1)


def test_a_unit_of_two_meanings_or_none_is_refused():
    for text in ("5 C", "1 furlong", "2 MJ/smoot"):
        with pytest.raises(UnitError):
            _number("k", text)
