"""Residuals of the bench's equations on a log: how far each is from what was measured, and from its noise."""

from .allowed import residuals
from .base import Equation, Residual, all_equations
from .evaluate import Evaluation, LogEvaluation, TrajectoryEvaluation, evaluate_log
from .log import BenchLog
from .noise import ChannelNoise, channel_noise
from .unit_doubts import unit_doubts

__all__ = [
    "BenchLog",
    "ChannelNoise",
    "Equation",
    "Evaluation",
    "LogEvaluation",
    "Residual",
    "TrajectoryEvaluation",
    "all_equations",
    "channel_noise",
    "evaluate_log",
    "residuals",
    "unit_doubts",
]
