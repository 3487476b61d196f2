"""Keeps the nominal constants of the scene: what a user gets who tunes nothing."""

import tyro

from agents.evaluate import Args, main
from agents.policies import Spec

if __name__ == "__main__":
    main(Spec("default"), tyro.cli(Args, description=__doc__))
