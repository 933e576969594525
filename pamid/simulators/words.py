"""Words of headers and ports in several languages: which role and which dimension they speak of."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator

from ..signals.headers import WITH_D

_ROLES = {
    "command": "cmd command commanded commands des desired ref reference references target targets tgt trg ctrl "
    "control setpoint setpoints set goal action actions sp d plan planned demand demanded desire wanted leader master "
    "ff feedforward soll sollwert vorgabe ziel führung stell stellgrösse wunsch consigne commande cible désiré "
    "désirée deseado deseada objetivo comando riferimento rif desejado desejada gewenst gewenste "
    "задание задан заданный заданная заданное уставка "
    "目标 目標 期望 指令 设定 設定 给定 給定 命令 参考 控制",
    "reading": "actual act measured meas mes feedback fbk fb observation obs present ist istwert encoder estimated est "
    "read follower puppet slave gemessen mess mesure mesuré mesurée réel réelle medido medida misurato gemeten "
    "измерено измеренный измеренная измеренное факт "
    "实际 實際 实测 反馈 测量 当前 现在 現在 実 実測 実際 測定 計測",
    "error": "error errors err diff deviation dev abweichung regelabweichung regeldifferenz schleppfehler fehler écart "
    "erreur kp kd ki gain gains stiffness battery batterie vbus 误差 偏差 誤差",
    "filler": "state states joint joints motor motors dof axis axes servo servos actuator achse gelenk motoren axe "
    "articulation eje articulación asse giunto 关节 關節 関節 轴 軸 电机 モータ 值 値",
}
"""What a signal is to the system. What errors and gains name is seldom a port."""
FAINT = frozenset(("d", "sp"))
"""Marks of a command that samples of a speed outweigh."""
_EFFORT = ("torque", "force", "current", "voltage", "ratio")
_DIMENSIONS = {
    ("acceleration", "angular acceleration"): "ddq qdd qacc acc accel acceleration beschleunigung accélération "
    "aceleración 加速度 角加速度",
    ("angular rate",): "omega ω winkelgeschwindigkeit drehzahl rpm gyro 角速度 转速 回転数 回転速度 dtheta dphi",
    (
        "angular rate",
        "speed",
    ): "dq qd qdot qvel dpos vel velo spd velocity velocities speed speeds rate geschwindigkeit скорость "
    "vitesse velocidad velocità velocidade snelheid hoeksnelheid 速度",
    ("speed",): "dx dy dz",
    ("angle",): "q theta θ phi φ angle angles угол winkel angolo ángulo hoek 角度 角",
    ("angle", "length"): "qpos pos position positions положение lage stellung posición posizione 位置",
    ("length",): "weg hub stroke displacement auslenkung déplacement",
    ("torque",): "tau τ torque torques torq trq moment momentum drehmoment couple coppia koppel момент 力矩 扭矩 转矩 "
    "トルク",
    _EFFORT: "effort efforts pwm load duty u",
    ("current",): "current curr cur ток amps iq strom courant corriente corrente 电流 電流",
    ("voltage",): "volt volts напряжение voltage spannung voltaje tensione 电压 電圧",
    ("force", "voltage"): "tension",
    ("pressure",): "pressure pressures druck давление pression presión pressione 压力 圧力",
    ("force",): "force kraft сила fuerza forza loadcell 力",
    ("mass flow", "volume flow"): "mdot flow durchfluss расход débit caudal portata 流量",
    ("temperature",): "temp temperature temperatures температура temperatur température temperatura 温度",
}
"""Dimensions that a quantity of such a name has; a rate outweighs the position that it is of, so it stands first."""
INPUT = "u"
"""Letter of an effort and, in control, of whatever is commanded: a position, too."""
_SYMBOLS = {
    "voltage": "u v", "current": "i", "pressure": "p", "force": "f", "length": "x y z", "angular rate": "w n",
    "speed": "v", "temperature": "t", "torque": "m",
}  # fmt: skip
"""Letters that stand for a quantity among others: they never contradict."""
_TOGETHER = {("d", "q"): "dq", ("dd", "q"): "ddq", ("fol", "err"): "error", ("load", "cell"): "loadcell"}
EITHER = frozenset(("qd", "xd"))
"""Names of a desired position and of a speed alike: the samples tell."""

EFFORT = frozenset(_EFFORT)
"""Dimensions of what a word such as effort says of a quantity."""
ROLE_OF = {word: role for role, words in _ROLES.items() for word in words.split()}
DIMENSIONS_OF = {word: frozenset(dims) for dims, words in _DIMENSIONS.items() for word in words.split()}
SYMBOLS_OF = {
    word: frozenset(dim for dim, words in _SYMBOLS.items() if word in words.split())
    for words in _SYMBOLS.values()
    for word in words.split()
}
_ORDER = list(_DIMENSIONS)
_KNOWN = sorted({*ROLE_OF, *DIMENSIONS_OF, "dot"}, key=len, reverse=True)
_MARKED = re.compile(f"([{''.join(SYMBOLS_OF)}])(soll|ist|ref|cmd|set|act|des|meas|mess)")
"""A quantity's letter and its role, as in ``Tist``."""
_WITHIN = re.compile(f"({'|'.join(re.escape(w) for w in _KNOWN if not w.isascii())})")


def tokens(name: str) -> list[str]:
    """Return the words and numbers of a name in small letters, compounds of known words in parts; dV is one word."""
    spaced = re.sub(
        rf"(?<=[a-zäöüß])(?=[A-Z]){WITH_D}|(?<=[A-Z])(?=[A-Z][a-z])|(?<=[^\W\d_])(?=\d)|(?<=\d)(?=[^\W\d_])", " ", name
    )
    found: list[str] = []
    for word in (part for w in re.split(r"[\W_]+", spaced.casefold()) if w for part in _parts(w)):
        before = found[-1] if found else ""
        if (before, word) in _TOGETHER:
            found[-1] = _TOGETHER[before, word]
        elif word == "dot" and before:
            found[-1] = f"d{before}"
        elif word == "q" and before in ("i", "u", "v"):  # the axis of a field, not an angle
            found[-1] += word
        else:
            found.append(word)
    return found


def _parts(word: str) -> list[str]:
    """Return the parts of a compound of known words, the longest first; a word of another kind as it is."""
    if any(ord(c) > 0x2000 for c in word):  # written without blanks
        return [w for w in _WITHIN.split(word) if w]
    if marked := _MARKED.fullmatch(word):
        return list(marked.groups())
    return next(_compounds(word), [word]) if len(word) > 1 else [word]


def _compounds(word: str) -> Iterator[list[str]]:
    if not word or (word in _KNOWN and (len(word) > 1 or word == "q")):
        yield [word] if word else []
    for known in _KNOWN:
        if word.startswith(known) and (len(known) > 1 or known == "q") and known != word:
            yield from ([known, *rest] for rest in _compounds(word[len(known) :]))


def roles_of(words: Iterable[str]) -> set[str]:
    """Return the roles that some words speak of; of command and reading the last, as a name ends in its noun."""
    said = [ROLE_OF[w] for w in words if w in ROLE_OF]
    last = [role for role in said if role in ("command", "reading")][-1:]
    return {role for role in said if role not in ("command", "reading")} | set(last)


def dimensions_of(words: Iterable[str]) -> frozenset[str]:
    """Return the dimensions that some words agree on; where they do not, those of the highest derivative."""
    rank = {frozenset(key): k for k, key in enumerate(_ORDER)}
    said = sorted({DIMENSIONS_OF[w] for w in words if w in DIMENSIONS_OF}, key=lambda d: rank[d])
    found = said[0] if said else frozenset()
    for other in said[1:]:
        found = found & other or found
    return found


def names_itself(word: str) -> bool:
    """Return whether a word names a thing, rather than its role or quantity."""
    return (word not in ROLE_OF and word not in DIMENSIONS_OF) or ROLE_OF.get(word) == "filler"
