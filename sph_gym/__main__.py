"""`python -m sph_gym COMMAND`: the command line, for which `sph-gym` is another name."""

import sys

try:
    from sph_gym.command_line import main
except KeyboardInterrupt:
    # Ctrl-C in the first second, before `main` is there to catch it
    print("sph_gym: interrupted", file=sys.stderr)
    sys.exit(130)

if __name__ == "__main__":
    sys.exit(main())
