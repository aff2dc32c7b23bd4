"""The command `sealag`, and `python -m sealag`: the command line, and Ctrl-C while it loads."""

import sys


def main() -> None:
    """Run the command line; Ctrl-C before it can answer that itself ends with 130 as well."""
    try:
        from sealag.cli import main as run

        run()
    except KeyboardInterrupt:
        print("sealag: interrupted", file=sys.stderr)
        raise SystemExit(130) from None


if __name__ == "__main__":
    main()
