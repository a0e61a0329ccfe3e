"""``python -m tunnel_lab``: the command ``tunnel`` of the source tree in which Python is started."""

import sys

from tunnel_lab.cli import main

if __name__ == "__main__":
    sys.exit(main())
