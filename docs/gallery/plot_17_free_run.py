"""
One step ahead flatters; a free run does not
============================================

One-step predictions always look good. In a free run a model is given its first value and the inputs, and feeds back
its own output. The model here is a neural autoregressive model of a muscle that lifts a load. It was fitted to free
runs and is shown on a load and a motion that it has not seen.
"""

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from pamid.estimators import NNARX

from pamid.bench.single import LiftSettings, simulate_lift
from pamid.plots.style import BLUE, FAINT, GREY

log = pd.concat(
    simulate_lift(loads=[15, 40, 70, 100], every=50, settings=LiftSettings(frequency=f)).assign(
        trajectory=lambda log, f=f: log["trajectory"] + f" at {f} Hz"
    )
    for f in (0.1, 0.2)
)
inputs = ["trajectory", "time", "P", "load"]
model = NNARX(random_state=0).fit(log[inputs], log["eps"])

new = simulate_lift(loads=[55], every=50, settings=LiftSettings(frequency=0.15), seed=1)
free = model.predict(new[inputs])
error = 100 * np.sqrt(np.mean((free - new["eps"]) ** 2))

fig, (above, below) = plt.subplots(
    2, 1, figsize=(7, 4.6), sharex=True, layout="constrained", gridspec_kw={"height_ratios": [2, 1]}
)
above.plot(new["time"], 100 * new["eps"], color=FAINT, linewidth=5, label="measured")
above.plot(new["time"], 100 * free, color=BLUE, label=f"free run: {error:.2f} % of the length off")
above.set_ylabel("contraction / %")
above.set_title("A load of 55 kg at 0.15 Hz, after lifts of 15 to 100 kg at 0.1 and 0.2 Hz")
above.legend(loc="upper right")
below.plot(new["time"], new["P"] / 1e5, color=GREY)
below.set_ylabel("pressure / bar,\nabsolute")
below.set_xlabel("time / s")
plt.show()
