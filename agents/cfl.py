"""The article's adaptive rule: nominal stiffness, and in every frame the step that it allows."""

from agents.evaluate import main

if __name__ == "__main__":
    main("cfl", __doc__)
