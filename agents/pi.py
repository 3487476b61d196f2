"""The tuned CFL rule whose sound speed a PI controller corrects by the density error."""

from agents.evaluate import main

if __name__ == "__main__":
    main("pi", __doc__)
