"""`python -P -m support.obedient_child CODE …`: runs the Python text that it is given."""

import sys

if __name__ == "__main__":
    exec(sys.argv[1])
