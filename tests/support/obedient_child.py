"""`python -P -m support.obedient_child CODE …`: runs the Python text that it is given."""

import sys
from collections.abc import Sequence


def main(argv: Sequence[str]) -> int:
    """Run the text in the place of a command."""
    exec(argv[0], {"__name__": "__main__"})
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
