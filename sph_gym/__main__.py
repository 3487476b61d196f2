"""`python -m sph_gym COMMAND`: the command line, for which `sph-gym` is another name."""

import sys

from sph_gym.command_line import main

if __name__ == "__main__":
    sys.exit(main())
