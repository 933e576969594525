"""Beside published results: a positioning axis by its authors' protocol, a robot arm, two tanks; misses are told.

Reads ``emps``, ``so101``, ``cascaded_tanks`` under ``--real`` (public data that are not part of this package, see
docs/published.md).
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent.parent))

from benchmarks import _published_emps, _published_so101, _published_tanks

STUDIES = {
    "emps": (_published_emps.study, "emps"),
    "so101": (_published_so101.study, "so101"),
    "tanks": (_published_tanks.study, "cascaded_tanks"),
}
"""Study, and the folder of its data."""


def main() -> int:
    """Print the tables whose data are there."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--real", type=Path, metavar="FOLDER", help="folder with the measured data")
    parser.add_argument("--data", type=Path, metavar="FOLDER", help="folder of the one study that --only names")
    parser.add_argument("--only", choices=list(STUDIES), action="append", help="one study; may be repeated")
    parser.add_argument("--plots", type=Path, metavar="DIR", help="write the pictures there")
    args = parser.parse_args()
    for name in args.only or STUDIES:
        study, own = STUDIES[name]
        folder = args.data or (args.real / own if args.real else None)
        if folder is None or not folder.is_dir():
            print(f"{name}: skipped, no data; name their folder with --real (docs/published.md says where they are)")
            continue
        study(folder, args.plots)
    return 0


if __name__ == "__main__":
    sys.exit(main())
