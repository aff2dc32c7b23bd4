"""`python -m sealag` is the command line."""

from sealag.cli import main

if __name__ == "__main__":
    main()
