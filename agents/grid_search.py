"""The best static setting of a grid over Courant multiple, sound speed and xsph."""

from agents.arguments import launch
from agents.static_search import StaticSearchArgs, main

if __name__ == "__main__":
    launch(main, StaticSearchArgs, __doc__)
