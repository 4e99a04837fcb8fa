"""`python -m met`: the command `met`."""

import sys

from met_arm import main

if __name__ == "__main__":
    sys.exit(main())
