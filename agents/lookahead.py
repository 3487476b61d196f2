"""The look-ahead oracle: it knows the reference and the future, a bound that no agent may pass."""

from agents.evaluate import main

if __name__ == "__main__":
    main("lookahead", __doc__)
