"""The closed loop at 1 kHz: read the sensors, move the valves, integrate to the next sample."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np

from .excitation import DT, Reference
from .plant import Plant, sample_interval_parts

CHANNELS = ("q", "P1", "P2", "F1", "F2", "mdot1", "mdot2")


@dataclass(frozen=True)
class Control:
    """PD on the angle with feed-forward asks for a difference of pressures, and each valve chases its pressure.

    Parameters
    ----------
    forward : float
        Feed-forward of the wanted angle, bar/rad.
    kp, kd : float
        bar/rad and bar s/rad.
    lead : float
        Share of the wanted speed in the error of the speed.
    cocontraction : float
        Mean pressure, Pa.
    hold : float
        Gain of the pressure loops, 1/bar.
    even : float
        1 if commands are scaled so that filling and venting are as quick at a mean pressure, else 0.
    filter : float
        Time constant of the speed's filter, s.
    noisy : float
        1 if the controller reads the sensors with their noise, else 0.
    """

    forward: float
    kp: float
    kd: float
    lead: float
    cocontraction: float
    hold: float
    even: float
    filter: float
    noisy: float


def draw_control(rng: np.random.Generator, muscle: str) -> Control:
    """Draw a controller that is stable and damped with a muscle of the study."""
    stiff = {"A": 1.9, "B": 1.9, "C": 0.9}[muscle]
    return Control(
        forward=stiff * float(rng.uniform(0.6, 1.1)),
        kp=stiff * float(rng.uniform(0.3, 1.2)),
        kd=float(rng.uniform(0.05, 0.11)),
        lead=float(rng.uniform(0.0, 0.8)),
        cocontraction=float(rng.uniform(2.6e5, 3.4e5)),
        hold=float(np.exp(rng.uniform(np.log(0.8), np.log(4.0)))),
        even=float(rng.random() < 0.5),
        filter=float(rng.uniform(0.002, 0.005)),
        noisy=float(rng.random() < 0.15),
    )


@dataclass
class Recording:
    """What a batch recorded, arrays of shape (samples, channels, runs).

    Parameters
    ----------
    clean, noisy : array, shape (samples, 7, runs)
        Readings of the sensors (q, P1, P2, F1, F2, mdot1, mdot2), without and with their noise.
    u : array, shape (samples, 2, runs)
        Commands.
    mdot_end : array, shape (samples, 2, runs)
        Flow that the meter would read at the end of the interval after each sample, before the command changes.
    """

    clean: np.ndarray
    noisy: np.ndarray
    u: np.ndarray
    mdot_end: np.ndarray


@dataclass(frozen=True)
class Told:
    """What the controller is told beside the wanted angle.

    Parameters
    ----------
    offset : array, shape (samples, runs)
        Added to the mean pressure of both muscles, Pa.
    share : array, shape (2, runs)
        What each muscle takes of the pressure that turns the joint.
    shut : array of bool, shape (samples, runs)
        Where both valves are shut.
    """

    offset: np.ndarray
    share: np.ndarray
    shut: np.ndarray


def told_by(runs: list[Reference]) -> Told | None:
    """Return what runs tell the controller beside the wanted angle; None where that is nothing."""
    if all(r.offset is None and r.shut is None and r.share == (1.0, 1.0) for r in runs):
        return None
    n = len(runs[0].q)
    return Told(
        np.column_stack([np.zeros(n) if r.offset is None else r.offset for r in runs]),
        np.array([r.share for r in runs]).T,
        np.column_stack([np.zeros(n, dtype=bool) if r.shut is None else r.shut for r in runs]),
    )


def record(
    plant: Plant,
    q_ref: np.ndarray,
    noise: np.ndarray,
    steps: np.ndarray,
    control: dict[str, np.ndarray],
    split: np.ndarray,
    lag: np.ndarray,
    told: Told | None = None,
) -> Recording:
    """Run the loop.

    Parameters
    ----------
    plant : Plant
        The bench.
    q_ref : array, shape (samples, runs)
        Wanted angle, rad.
    noise : array, shape (samples, 7, runs)
        Noise of the sensors.
    steps : array, shape (7, runs)
        Steps of the converters; 0 for none.
    control : dict of str to array, shape (runs,)
        Fields of `Control`.
    split, lag : array, shape (runs,)
        The command changes ``lag`` whole samples late, and within the sample at the fraction ``split``; ``lag`` 0
        means no delay.
    told : Told, optional
        What else the controller is told.
    """
    samples, runs = q_ref.shape
    c = SimpleNamespace(**control)
    y = plant.begin(c.cocontraction)
    clean, noisy = np.empty((samples, 7, runs)), np.empty((samples, 7, runs))
    u_all, mdot_end = np.zeros((samples + 1, 2, runs)), np.empty((samples, 2, runs))
    h1, h2 = sample_interval_parts(split)
    speed, before, wanted_speed = np.zeros(runs), np.zeros(runs), np.zeros(runs)
    columns, delayed = np.arange(runs), bool(np.any(lag > 0))
    safe = np.where(steps > 0, steps, 1.0)
    u = np.zeros((2, runs))
    late = early = u
    end = plant.stage(y, late, 0.0)
    for k in range(samples):
        look = end
        m = SimpleNamespace(q=look.q, P=look.P, F=look.F, mdot=look.mdot, k=k)
        for i in plant.hooked["sense"]:
            i.sense(m, look)
        x = np.concatenate([m.q[None], m.P, m.F, m.mdot])
        read = x + c.noisy * noise[k]
        if k == 0:
            before = read[0]
        speed = speed + (DT / (c.filter + DT)) * ((read[0] - before) / DT - speed)
        before = read[0]
        wanted = (q_ref[k] - q_ref[max(k - 1, 0)]) / DT
        wanted_speed = wanted_speed + (DT / (c.filter + DT)) * (wanted - wanted_speed)
        swing = c.forward * q_ref[k] + c.kp * (q_ref[k] - read[0]) + c.kd * (c.lead * wanted_speed - speed)
        swing = np.clip(swing, -1.3, 1.3) * 1e5
        turn = np.stack([swing, -swing]) if told is None else told.share * np.stack([swing, -swing]) + told.offset[k]
        u = c.hold * (c.cocontraction + turn - read[1:3]) / 1e5
        u = np.where((u < 0) & (c.even > 0), 2.2 * u, u)
        u = np.clip(u, -1.0, 1.0)
        if told is not None:
            u = np.where(told.shut[k], 0.0, u)
        u_all[k] = u
        if delayed:
            early = np.where(lag > 0, u_all[np.maximum(k - lag, 0), :, columns].T, u)
            early = np.where((lag > 0) & (k - lag < 0), 0.0, early)
            late = np.where(lag > 0, u_all[np.maximum(k - lag + 1, 0), :, columns].T, u)
            late = np.where((lag > 0) & (k - lag + 1 < 0), 0.0, late)
        else:
            early = late = u
        first = plant.stage(y, early, 0.0)
        m = SimpleNamespace(q=first.q, P=first.P, F=first.F, mdot=first.mdot, k=k)
        for i in plant.hooked["sense"]:
            i.sense(m, first)
        x = np.concatenate([m.q[None], m.P, m.F, m.mdot])
        clean[k] = x
        x = x + noise[k]
        noisy[k] = np.where(steps > 0, np.round(x / safe) * safe, x)
        y, end = plant.step(y, early, h1, first)
        y, end = plant.step(y, late, h2, None if delayed else end)
        m = SimpleNamespace(q=end.q, P=end.P, F=end.F, mdot=end.mdot, k=-1)
        for i in plant.hooked["sense"]:
            i.sense(m, end)
        mdot_end[k] = m.mdot
    return Recording(clean, noisy, u_all[:-1], mdot_end)


def as_columns(values: list[Any], repeats: list[int]) -> dict[str, np.ndarray]:
    """Return the fields of one object a case as arrays over runs."""
    names = vars(values[0])
    return {k: np.repeat([getattr(v, k) for v in values], repeats) for k in names}
