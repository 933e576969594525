"""Every volume model of one geometry, and states over the working range."""

import numpy as np
import torch

from pamid.signals.state import State
from pamid.volume import all_volumes
from pamid.volume.bou_saba import BouSabaVolume
from pamid.volume.hildebrandt import HildebrandtVolume
from pamid.volume.polynomial import PolynomialVolume
from pamid.volume.tondu_lopez import TonduLopezVolume

GEOMETRY = (0.2, 0.02, 0.4363)
VOLUMES = {name: cls.from_geometry(*GEOMETRY) for name, cls in all_volumes().items()}
VOLUMES |= {
    "tondu_lopez with end caps": TonduLopezVolume(0.3, 0.015, 0.4, end_cap=1.15, end_cap_rise=0.6),
    "bou_saba, exponent 2.7": BouSabaVolume(0.2, 0.02, 0.5, exponent=2.7),
    "hildebrandt, degree 4": HildebrandtVolume(0.2, (2.6e-3, -6e-3, 4e-3, -9e-3, 2e-3), 6e-5),
    "polynomial, degree 2": PolynomialVolume(0.2, (6e-5, 5e-4, -9e-4)),
}


def states(n=200, seed=0):
    """Signals over the whole working range of a muscle."""
    rng = np.random.default_rng(seed)
    return State(
        rng.uniform(-0.02, 0.25, n),
        rng.normal(0.0, 0.5, n),
        rng.uniform(1.02e5, 7e5, n),
        rng.normal(0.0, 1e6, n),
    )


def tensors(state):
    return State(*(torch.tensor(s) for s in state))
