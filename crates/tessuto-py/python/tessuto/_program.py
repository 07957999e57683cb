"""The program `tessuto`, as pip puts it on the path."""

from __future__ import annotations

import sys


def main() -> int:
    """Run the program with the arguments of this process; its exit status."""
    try:
        from . import _native
    except ImportError as error:
        print(f"error: {error}", file=sys.stderr)
        return int(getattr(error, "exit_code", 101))
    return _native.main(["tessuto", *sys.argv[1:]])


if __name__ == "__main__":
    sys.exit(main())
