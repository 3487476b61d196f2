"""A process of its own for one copy of the package: compiles, reports, is timed on request.

`python -m sph_gym.studies.worker` with the specification as JSON on the first line of its input.
Every further line asks for the time of a step.
"""

import json
import sys
from pathlib import Path
from typing import Any

import sph_gym
from sph_gym import scenes
from sph_gym.solver import stepping
from sph_gym.studies import assembly
from sph_gym.studies.timing import Runner, own_clock
from sph_gym.studies.variants import left_out


def main() -> None:
    """Answer with one JSON line for every line of input."""
    spec: dict[str, Any] = json.loads(sys.stdin.readline())
    scene = left_out(scenes.make(spec["scene"], **spec["arguments"]), spec["effect"])
    runner = Runner(scene, spec["dtype"], work=spec["work"])
    whole, loop = _count()
    report = {
        "package": str(Path(sph_gym.__file__).parent),
        "instructions": whole,
        "loop": loop,
        "bytes": runner.bytes(),
    }
    print(json.dumps(report), flush=True)
    clock = own_clock()
    for _ in sys.stdin:
        print(json.dumps(runner.seconds(clock)), flush=True)


def _count() -> tuple[int, int] | tuple[None, None]:
    """Instructions of a step and of its pair loop; None where there is no listing to read."""
    try:
        return assembly.count(stepping.advance)
    except (AttributeError, ValueError) as error:
        print(f"no instructions counted: {error}", file=sys.stderr)
        return None, None


if __name__ == "__main__":
    main()
