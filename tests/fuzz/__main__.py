"""Long runs: python -m fuzz --count 100000 [--seed N] [--minutes M] [--slow]."""

import argparse
import secrets
import tempfile
import time
from collections import Counter
from pathlib import Path

from fuzz.run import design, tried


def main() -> int:
    """Try fresh mutations; print what they find."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=None)
    parser.add_argument("--count", type=int, default=10**9)
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--slow", action="store_true", help="large robots too")
    given = parser.parse_args()
    seed = secrets.randbelow(10**9) if given.seed is None else given.seed
    end, found, done = time.monotonic() + 60.0 * given.minutes, Counter(), 0
    print(f"seed {seed}", flush=True)
    with tempfile.TemporaryDirectory() as folder:
        while done < given.count and time.monotonic() < end:
            path = design(seed + done, Path(folder), slow=given.slow)
            began = time.monotonic()
            finding = tried(path, seed + done)
            if finding is not None:
                found[finding.said[:60]] += 1
                if found[finding.said[:60]] < 3:
                    print(finding, flush=True)
            elif time.monotonic() - began > 10.0:
                print(f"slow: {seed + done} {time.monotonic() - began:.0f} s", flush=True)
            path.unlink()
            done += 1
    print(f"{done} designs, {sum(found.values())} findings")
    for said, count in found.most_common():
        print(f"{count:6} {said}")
    return int(bool(found))


if __name__ == "__main__":
    raise SystemExit(main())
