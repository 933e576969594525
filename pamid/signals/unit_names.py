"""Spellings of units, in English and German, and the unit of the table that each means."""

import difflib
import re

from ..errors import MappingError, UnitError
from .units import UNITS, UNITS_OF, Unit, dimension_of

_SPELLINGS = """
s: sec secs second seconds sek sekunde sekunden
ms: msec msecs millisecond milliseconds millisekunde millisekunden
us: µsec usec microsecond microseconds mikrosekunde mikrosekunden
ns: nsec nsecs nanosecond nanoseconds nanosekunde nanosekunden
min: minute minutes minuten
h: hr hrs hour hours std stunde stunden
Pa: pascal pascals n/m2
kPa: kilopascal kn/m2
MPa: megapascal n/mm2
hPa: hektopascal hectopascal
mbar: millibar
psi: lb/in2 lbs/in2 lbf/in2 pound/in2
psig: psi(g)
psia: psi(a)
kgf/cm2: kg/cm2 kp/cm2 at ata
mmHg: torr
mmH2O: mmws kgf/m2 kp/m2
cmH2O: cmws
mH2O: mws
inH2O: inwc
m: meter metre metres meters
cm: centimeter centimetre zentimeter
mm: millimeter millimetre millimeters millimetres
um: micron microns micrometer micrometre mikrometer
in: " zoll inches
ft: feet foot
mil: mils thou
rad: radian radians bogenmaß bogenmass
mrad: milliradian
deg: degree degrees grad altgrad winkelgrad град graus graden gradi
gon: gradian neugrad
rev: turn turns revolution revolutions umdrehung umdrehungen u umdr
rad/s: rad/sec
deg/s: deg/sec degree/s degrees/s grad/s dps град/с graus/s gradi/s
rpm: u/min 1/min upm umin rev/min r/min umdr/min min-1 turn/min turns/min umdrehungen/min tr/min giri/min об/мин
rpm: 转/分 转/分钟 転/分
rev/s: rps turn/s turns/s turn/sec turns/sec u/s umdr/s tr/s
-: ratio dimensionless dimensionslos einheitenlos unitless none ohne m/m mm/mm n/a
%: pct prozent percent %fs
‰: promille
1/s: s-1
N: newton newtons
mN: millinewton
daN: dekanewton decanewton
kN: kilonewton
kgf: kp kilopond kilogramforce kg-f kg_f
gf: pond
lbf: lbsf poundforce
ozf: ounceforce
kg/s: kg/sec
g/s: g/sec gramm/s
L/min ANR: l/min(anr) lanr/min l(anr)/min anrl/min
L/s ANR: l/s(anr) lanr/s
m3/h ANR: m3/h(anr) m3anr/h
NL/min: nl/min ln/min l(n)/min nlpm slpm sl/min nlmin slm stdl/min l/min(n) l/min(ntp) l/min(stp) normliter/min
NL/s: nl/s ln/s
NL/h: nl/h ln/h
Nm3/h: nm3/h nm3h
sccm: scc/min smlpm nml/min mln/min
L/min: lpm liter/min litre/min dm3/min
L/s: liter/s dm3/s
cm3/s: ccm/s
kg: kilogram kilogramm
g: gram gramm
lb: lbs pound pounds pfund
K: kelvin
degC: c celsius
°F: f fahrenheit degf
V: volt volts
mV: millivolt
µV: uv microvolt
A: amp amps ampere
mA: milliampere
Nm: n*m n.m n-m newtonmeter
Nmm: n*mm
Ncm: n*cm
lbf in: lbf*in in-lb in-lbs lb-in inlb lbin
m/s: m/sec
mm/s: mm/sec
km/h: kmh kph km/hr
mph: mi/h
km: kilometer kilometre
W: watt watts
kW: kilowatt
mNm: mn*m
cm3: ccm
mL: milliliter millilitre
m/s2: m/s/s
Hz: hertz
"""
_ALIASES = {
    spelling: line.split(": ")[0]
    for line in _SPELLINGS.strip().splitlines()
    for spelling in line.split(": ")[1].split()
}
_FOLDED = {
    folded: names[0]
    for folded in {name.casefold().replace(" ", "") for name in UNITS}
    if len(names := [name for name in UNITS if name.casefold().replace(" ", "") == folded]) == 1 or folded[0] != "m"
}  # m and M are milli and mega: where the table has both, case decides
_AS_FORCE = {"kg": "kgf", "g": "gf", "lb": "lbf"}
_GAUGE = r"(?:g|ga|gauge|ü|ue|u|rel|relative?|überdruck|ueberdruck|manometric)"
_ABSOLUTE = r"(?:a|abs|absolute?|absolut)"
_REFERENCE = re.compile(
    rf"^(?P<unit>.+?)[\s_.,(\-]*(?:(?P<gauge>{_GAUGE})|(?P<absolute>{_ABSOLUTE}))[.)]*$", re.IGNORECASE
)
_SIGNS = str.maketrans("μ²³·⋅−–—º˚⁻¹", "µ23**---°°-1")


def unit_name(text: str, dimension: str | None = None) -> str | None:
    """Return the name in `pamid.signals.UNITS` of a written unit, from a closed list: exact spelling first."""
    text = text.strip().translate(_SIGNS).replace("Â", "").replace("℃", "°C")
    found = _plain(text)
    if found is None and (match := _REFERENCE.match(text)):
        base = _plain(match["unit"])
        if base is not None and UNITS[base].dimension == "pressure" and UNITS[base].gauge is None:
            suffixed = base + ("g" if match["gauge"] else "a")
            found = suffixed if suffixed in UNITS else None
    if dimension == "force" and found in _AS_FORCE:
        return _AS_FORCE[found]
    return found


def _plain(text: str) -> str | None:
    if text in UNITS:
        return text
    folded = re.sub(r"\s*\b(?:per|pro)\b\s*", "/", text.casefold())
    folded = re.sub(r"\s+|\^|\.$", "", folded).replace("**", "")
    folded = re.sub(r"^\((.+)\)$", r"\1", folded)
    return _ALIASES.get(folded) or _FOLDED.get(folded)


def find_unit(name: str, signal: str | None = None) -> Unit:
    """Return the unit of a name."""
    wanted = dimension_of(signal) if signal else None
    known = unit_name(str(name), wanted)
    if known is None:
        near = difflib.get_close_matches(str(name), UNITS, n=3, cutoff=0.5)
        raise UnitError(
            f"Unknown unit '{name}'{f' for the signal {signal}' if signal else ''}.",
            f"one of the known units ({', '.join(near or list(UNITS)[:12])}, ...)",
            "Correct the unit, or give the factor to SI as scale and leave the unit out.",
        )
    unit = UNITS[known]
    if wanted is not None and unit.dimension != wanted:
        raise UnitError(
            f"The unit '{name}' of the signal {signal} is a unit of {unit.dimension}.",
            f"a unit of {wanted}, such as {', '.join(list(UNITS_OF[wanted])[:5])}",
            "Say at which conditions the volume counts: 'L/min ANR' (20 °C, 1 bar) or 'NL/min' (0 °C, 1.013 bar)."
            if (unit.dimension, wanted) == ("volume flow", "mass flow")
            else "Correct the unit, or rename the signal.",
        )
    return unit._replace(factor=float(unit.factor))


_QUANTITY = re.compile(r"^\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(.*?)\s*$")


def parse_quantity(value: float | str, signal: str | None = None) -> float:
    """Return a number, or a text such as ``"17.45 cm"``, in SI; raise if its unit does not suit the `signal`."""
    if isinstance(value, int | float) and not isinstance(value, bool):
        return float(value)
    match = _QUANTITY.match(value) if isinstance(value, str) else None
    if match is None:
        raise MappingError(
            f"The constant {signal or ''} is {value!r}.".replace("  ", " "),
            "a number in SI or a text of number and unit such as '17.45 cm'",
            "Correct the mapping.",
        )
    number, named = float(match.group(1)), match.group(2)
    if not named:
        return number
    unit = find_unit(named, signal)
    return number * unit.factor + unit.offset
