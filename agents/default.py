"""Keep the nominal constants of the scene: what a user gets without tuning."""

from agents.evaluate import main

if __name__ == "__main__":
    main("default", __doc__)
