"""The short look-ahead: it knows the reference and the next steps, but not the last digits."""

from agents.evaluate import main

if __name__ == "__main__":
    main("short_lookahead", __doc__)
