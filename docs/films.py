"""Films of the tuned rule beside the trained policies that the package has.

    python docs/films.py FOLDER

writes one for every environment with a trained policy; the site shows them on its pages.
"""

import sys
from pathlib import Path

from sph_gym.controllers.shipped import network_of
from sph_gym.env import env_id
from sph_gym.env.selection import GROUPS

# Flow that is shown.
INSTANCE = "{}/val/0"


def make(folder: Path) -> dict[str, str]:
    """Write the films that are missing or older than a network of theirs.

    Returns the id of the flow that is shown, by the name of the environment; environments without
    a trained policy have no film.
    """
    from agents.policies import LEARNED

    shown = {}
    for scene in GROUPS["benchmark"]:
        paths = {name: network_of(name, scene) for name in LEARNED}
        networks = {name: path for name, path in paths.items() if path is not None}
        if networks:
            name = env_id(scene).rpartition("/")[2]
            shown[name] = INSTANCE.format(scene)
            _make(scene, networks, folder / name)
    return shown


def _make(scene: str, networks: dict[str, Path], folder: Path) -> None:
    from agents.compare import animate, film
    from agents.policies import Spec

    made = folder / "side_by_side.mp4"
    newest = max(path.stat().st_mtime for path in networks.values())
    if made.exists() and made.stat().st_mtime > newest:
        return
    trained = [Spec(name, network=str(path)) for name, path in networks.items()]
    _, pictures = film([Spec("tuned_cfl"), *trained], scene, INSTANCE.format(scene))
    folder.mkdir(parents=True, exist_ok=True)
    animate(pictures, folder)


if __name__ == "__main__":
    print("films of:", ", ".join(make(Path(sys.argv[1]))) or "none: there is no trained policy")
