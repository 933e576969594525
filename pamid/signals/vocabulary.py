"""Words for the signals of a log, in English and German, and for its clock in some more languages."""

_WORDS = """
time: t time zeit timestamp zeitstempel clock uhrzeit sec secs seconds elapsed datetime datum date stamp messzeit
time: temps tiempo tempo tijd czas время 时间 時間 시간
P: p pressure press pres druck
F: f force kraft loadcell cell tension zugkraft
mdot: mdot flow massflow durchfluss massenstrom volumenstrom flowrate durchfluß
eps: eps epsilon contraction strain kontraktion dehnung
L: l length len laenge länge
x: x position pos stroke disp displacement weg hub travel shortening extension verkürzung auslenkung
q: q angle theta phi winkel joint encoder gelenk
u: u cmd command valve duty pwm stellsignal ventil stellgröße
voltage: voltage volts volt vin spannung
drive: torque tau drive current strom drehmoment effort moment
enabled: enable enabled freigabe
trajectory: trajectory run trial experiment test messung versuch lauf durchlauf measurement episode repetition messreihe
wanted: ref goal target set setpoint soll desired wanted demand sollwert commanded reference vorgabe
rate: speed velocity vel rate omega dot geschwindigkeit dq deps dp drehzahl acceleration accel beschleunigung acc ddq
elsewhere: supply source tank line reservoir ambient atmospheric atmosphere barometer versorgung umgebung netz luftdruck
elsewhere: temperature temp temperatur
treated: raw roh adc counts digits filtered filt gefiltert smoothed geglättet min max std mean avg mittel
"""
WORDS: dict[str, frozenset[str]] = {}
for _line in _WORDS.strip().splitlines():
    _kind, _, _known = _line.partition(":")
    WORDS[_kind] = WORDS.get(_kind, frozenset()) | frozenset(_known.split())
_STEMS = {
    "druck": "P", "kraft": "F", "winkel": "q", "zeit": "time", "weg": "x", "hub": "x", "durchfluss": "mdot",
    "massenstrom": "mdot", "volumenstrom": "mdot", "kontraktion": "eps", "länge": "L", "laenge": "L", "moment": "drive",
    "spannung": "voltage", "strom": "drive", "geschwindigkeit": "rate", "temperatur": "elsewhere",
}  # fmt: skip
_ELSEWHERE = ("versorgung", "speise", "umgebung", "netz", "vordruck", "luftdruck")


def kinds_of(words: list[str]) -> set[str]:
    """Return the entries of the vocabulary to which words belong; a German compound counts by its last part."""
    found: set[str] = set()
    for word in words:
        plain = {kind for kind, known in WORDS.items() if word in known}
        found |= plain or _compound(word)
    return found


def _compound(word: str) -> set[str]:
    """Return the meaning of a compound: its last part gives the kind, its first part the owner."""
    if word.startswith(_ELSEWHERE):
        return {"elsewhere"}
    heads = [kind for stem, kind in _STEMS.items() if word.endswith(stem)]
    heads = heads or [kind for stem, kind in _STEMS.items() if word.startswith(stem) and len(stem) > 3]
    if not heads:
        return set()
    wanted = {"wanted"} if word.startswith(("soll", "ziel", "vorgabe")) else set()
    return {heads[0]} | wanted
