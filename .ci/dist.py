"""Build wheel and sdist twice, compare the bytes, and leave them in dist/.

``python .ci/dist.py``; the date in them is that of the last commit, or SOURCE_DATE_EPOCH.
"""

from __future__ import annotations

import gzip
import hashlib
import io
import os
import shutil
import subprocess
import sys
import tarfile
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


def epoch() -> str:
    """Return SOURCE_DATE_EPOCH, or the time of the last commit, s."""
    given = os.environ.get("SOURCE_DATE_EPOCH")
    if given:
        return given
    done = subprocess.run(["git", "log", "-1", "--format=%ct"], cwd=ROOT, check=True, capture_output=True, text=True)
    return done.stdout.strip()


def build(into: Path, date: str) -> list[Path]:
    """Build both from a copy of the checkout, so that nothing of an earlier build is in them."""
    source = into / "source"
    unwanted = shutil.ignore_patterns("__pycache__", "build", "dist", "*.egg-info", ".*")
    shutil.copytree(ROOT, source, ignore=unwanted)
    code = "import setuptools.build_meta as b; b.build_wheel('..'); b.build_sdist('..')"
    environment = {**os.environ, "SOURCE_DATE_EPOCH": date}
    command = [sys.executable, "-W", "ignore", "-c", code]
    subprocess.run(command, cwd=source, check=True, env=environment, stdout=subprocess.DEVNULL)
    (sdist,) = into.glob("*.tar.gz")
    repack(sdist, int(date))
    return sorted([*into.glob("*.whl"), sdist])


def repack(sdist: Path, date: int) -> None:
    """Write an sdist anew with one date, no owner and its files in order: setuptools writes the clock and the user."""
    with tarfile.open(sdist) as archive:
        files = [(m, archive.extractfile(m)) for m in sorted(archive.getmembers(), key=lambda m: m.name)]
        contents = [(m, f.read() if f else b"") for m, f in files]
    with (
        sdist.open("wb") as raw,
        gzip.GzipFile("", "wb", 9, raw, mtime=date) as packed,
        tarfile.open(fileobj=packed, mode="w", format=tarfile.GNU_FORMAT) as archive,
    ):
        for member, content in contents:
            plain = tarfile.TarInfo(member.name)
            plain.type, plain.size, plain.mtime = member.type, len(content), date
            plain.mode = 0o755 if member.isdir() else 0o644
            archive.addfile(plain, io.BytesIO(content))


def main() -> int:
    """Build, compare, copy."""
    date = epoch()
    with tempfile.TemporaryDirectory() as folder:
        pairs = []
        for name in ("first", "second"):
            (Path(folder) / name).mkdir()
            pairs.append(build(Path(folder) / name, date))
        sums = [{p.name: hashlib.sha256(p.read_bytes()).hexdigest() for p in files} for files in pairs]
        if sums[0] != sums[1]:
            print(f"two builds differ: {sums[0]} and {sums[1]}", file=sys.stderr)
            return 1
        shutil.rmtree(ROOT / "dist", ignore_errors=True)
        (ROOT / "dist").mkdir()
        for path in pairs[0]:
            shutil.copy(path, ROOT / "dist")
    for name, value in sums[0].items():
        print(f"{value}  dist/{name}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
