"""Throws dice: what any agent has to beat."""

import tyro

from agents.evaluate import Args, main
from agents.policies import Spec

if __name__ == "__main__":
    main(Spec("random"), tyro.cli(Args, description=__doc__))
