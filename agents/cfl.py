"""The article's adaptive rule: nominal stiffness, and in every frame the step that it allows."""

import tyro

from agents.evaluate import Args, main
from agents.policies import Spec

if __name__ == "__main__":
    main(Spec("cfl"), tyro.cli(Args, description=__doc__))
