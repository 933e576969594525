"""
A muscle wears, and the alarm says when
=======================================

``OnlineAdapter`` follows a muscle sample by sample at 1 kHz: a Kalman filter over a factor on the model's prediction.
From 8 s on the muscle loses force, 12 % over ten seconds. The alarm fires once the drift cannot be chance. The band
shows two standard deviations of the filter's estimate, which trails a steady drift by its forgetting time of one
second.
"""

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from pamid.estimators import OnlineAdapter, StaticPIHM
from sklearn.frozen import FrozenEstimator

from pamid.plots.style import BLUE, GREY, ORANGE

t = np.arange(0, 24, 1e-3)  # s
X = pd.DataFrame({"eps": 0.12 + 0.05 * np.sin(4 * t), "deps": 0.2 * np.cos(4 * t)})
X["P"], X["dP"] = 3e5 + 1e5 * np.cos(3 * t), -3e5 * np.sin(3 * t)
worn = 1 - 0.012 * np.clip(t - 8, 0, 10)
rng = np.random.default_rng(0)
F = worn * (X["P"] - 101_325) * 5e-4 * (1 - 3 * X["eps"]) + rng.normal(0, 0.2, len(t))  # N

model = StaticPIHM(hidden_layer_sizes=(8,), max_iter=20, random_state=0).fit(X[:4000:20], F[:4000:20])
online = OnlineAdapter(FrozenEstimator(model), forgetting_time=1.0).fit(X[:6000], F[:6000])
times, factor, width = [], [], []
for start in range(6000, len(t), 200):
    rows = slice(start, start + 200)
    online.partial_fit(X[rows], F[rows])
    times.append(t[min(start + 199, len(t) - 1)])
    factor.append(online.values_[0])
    width.append(online.uncertainty_[0])
factor, width = np.array(factor), np.array(width)

fig, ax = plt.subplots(figsize=(7, 3.6), layout="constrained")
ax.plot(t, worn, color=GREY, linestyle=(0, (4, 3)), label="the remaining force")
ax.fill_between(times, factor - 2 * width, factor + 2 * width, color=BLUE, alpha=0.25, linewidth=0)
ax.plot(times, factor, color=BLUE, label="followed")
alarm = 6 + online.alarms_[0]["time"]  # counted from the first sample of the stream
print(online.alarms_[0])
ax.axvline(alarm, color=ORANGE, linewidth=1.2)
ax.text(alarm + 0.15, 1.008, f"alarm at {alarm:.1f} s", color=ORANGE, fontsize=8)
ax.axvspan(0, 6, color="#F2F2F2", linewidth=0, zorder=0)
ax.text(3, 0.885, "healthy stretch,\nlearnt", ha="center", fontsize=8)
ax.set_xlabel("time / s")
ax.set_ylabel("factor on the force / –")
ax.set_title("Followed from sample to sample")
ax.legend(loc="upper right")
plt.show()
