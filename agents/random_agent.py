"""Draw every action at random: what any agent has to beat."""

from agents.evaluate import main

if __name__ == "__main__":
    main("random", __doc__)
