"""Night-long runs: python -m oracle.black_box --count 1000 [--seed N] [--folder DIR]."""

import argparse
import os
import secrets
import sys
import tempfile
from pathlib import Path

from oracle.black_box.compare import compare, report
from oracle.black_box.corpus import NIGHT, SUITE, random_design
from oracle.black_box.motion import compare_motion, random_motion


def main() -> int:
    """Compare a fresh corpus; leave the designs that disagree in the folder."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=int(os.environ.get("SEALAG_ORACLE_SEED", -1)))
    parser.add_argument(
        "--count", type=int, default=int(os.environ.get("SEALAG_ORACLE_COUNT", 300))
    )
    parser.add_argument("--folder", type=Path, default=None)
    parser.add_argument("--suite", action="store_true", help="small robots only, as in the suite")
    parser.add_argument("--motions", action="store_true", help="motions of three instants")
    given = parser.parse_args()
    seed = given.seed if given.seed >= 0 else secrets.randbelow(10**9)
    folder = given.folder or Path(tempfile.mkdtemp(prefix="sealag_oracle_"))
    folder.mkdir(parents=True, exist_ok=True)
    print(f"seed {seed}, {given.count} designs in {folder}", flush=True)
    verdicts = []
    for k in range(given.count):
        path = random_design(seed + k, folder, SUITE if given.suite else NIGHT)
        if given.motions:
            verdicts.append(compare_motion(path, random_motion(path, seed + k)))
        else:
            verdicts.append(compare(path))
        if verdicts[-1].kind in ("disagree", "fault"):
            print(f"{verdicts[-1].kind}: {path}: {verdicts[-1].said}", flush=True)
    print(report(verdicts))
    return int(any(v.kind in ("disagree", "fault") for v in verdicts))


if __name__ == "__main__":
    sys.exit(main())
