"""The role of each column that pamid names, for an effect or a system."""

from __future__ import annotations

ROLES = {
    "eps": "position", "deps": "velocity", "q": "position", "dq": "velocity", "P": "pressure", "dP": "pressure_rate",
    "u": "command", "time": "time", "mdot": "flow", "F": "force",
}  # fmt: skip
"""Role of each column; contraction of a muscle and angle of a joint are both positions."""

STATE_ROLES = {name: ROLES[name] for name in ("eps", "deps", "P", "dP")}
"""Roles of the columns of a muscle's state."""
