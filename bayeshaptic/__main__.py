"""``python -m bayeshaptic`` is the command ``bayeshaptic``."""

import sys

from bayeshaptic.cli import main

if __name__ == "__main__":
    sys.exit(main())
