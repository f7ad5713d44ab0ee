"""The command line: `ao4d`, or `python -m ao4d`."""

import sys


def main() -> int:
    """Does what the command line says; returns the exit code."""
    from . import _native

    return _native.main(["ao4d", *sys.argv[1:]])


if __name__ == "__main__":
    sys.exit(main())
