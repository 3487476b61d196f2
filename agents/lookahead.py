"""The look-ahead oracle: it knows the reference and the future, a bound that no agent may pass."""

import tyro

from agents.evaluate import Args, main
from agents.policies import Spec

if __name__ == "__main__":
    main(Spec("lookahead"), tyro.cli(Args, description=__doc__))
