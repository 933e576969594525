"""The process in which a MuJoCo model is loaded, within limits of time and memory: a crash stays in it.

Run as ``python -m pamid.simulators.mujoco_trial MODEL OUT BYTES SECONDS``; what it says on its output is an error.
"""

from __future__ import annotations

import contextlib
import os
import sys
from pathlib import Path

from ..errors import PamidError
from .fmu_worker import limited
from .mujoco_free import with_joints
from .mujoco_loading import COMPILED
from .mujoco_model import MujocoSimulator


def main() -> None:
    """Compile a model, write it as a MuJoCo binary file, and do all else that the other process will do with it."""
    model, out, memory, seconds = sys.argv[1], sys.argv[2], int(sys.argv[3]), int(sys.argv[4])
    os.chdir(Path(out).parent)  # where MuJoCo puts its notes
    import mujoco

    limited(memory, seconds)
    try:
        compiled = with_joints(Path(model), mujoco.MjModel.from_xml_path(model))
        mujoco.mj_forward(compiled, mujoco.MjData(compiled))
        mujoco.mj_saveModel(compiled, out, None)
        COMPILED[Path(model)] = compiled
        with contextlib.suppress(PamidError):  # the other process tells it
            MujocoSimulator(model)
    except (ValueError, TypeError, MemoryError, mujoco.FatalError, mujoco.UnexpectedError) as error:
        sys.stdout.write(f"{type(error).__name__ if isinstance(error, MemoryError) else ''}{error}"[:1000])
        sys.exit(3)


if __name__ == "__main__":
    main()
