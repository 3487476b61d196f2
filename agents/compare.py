"""The main job: all agents on the same instances and seeds, and a report of how they did."""

import platform
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import date
from pathlib import Path
from typing import Any

import gymnasium as gym
import imageio.v3 as imageio
import numba
import numpy as np
import pandas as pd
from numpy.typing import NDArray

import sph_gym
from agents import plots, report, static_search
from agents.arguments import BackendArgs, command, launch, option
from agents.evaluate import (
    evaluate,
    instance_ids,
    play,
    shift_table,
    show_summary,
    summary_table,
)
from agents.policies import LEARNED, NAMES, STATIC, Spec, build
from agents.styles import style_of
from sph_gym.controllers import Network
from sph_gym.controllers.shipped import network_of
from sph_gym.env import env_id
from sph_gym.env.instances import ODD
from sph_gym.env.instances import parse as parse_instance
from sph_gym.extras import progress_bar
from sph_gym.files import atomic_write
from sph_gym.solver.checks import known, whole
from sph_gym.studies.machine import describe
from sph_gym.view import Painter, side_by_side, write_video

PANEL_WIDTH = 480
FRAMES_PER_SECOND = 20
# Size that the film is made for [bits]: with what the encoder adds, below 2 MB, to be mailed.
FILM_SIZE = 8 * 1_300_000
Picture = NDArray[np.uint8]


@dataclass
class ComparisonArgs(BackendArgs):
    """Arguments of a comparison."""

    scene: str = option("scene of the environment", "dam_break")
    agents: tuple[str, ...] = option(
        "which agents; besides these, random_search, tpe, cma_es, hindsight and short_lookahead",
        tuple(name for name in NAMES if name not in (*STATIC[1:], "short_lookahead")),
    )
    instances: str = option(
        "nominal, train, val, test or ood; of ood, each shift gets a table of its own too", "test"
    )
    n_instances: int = option("how many of them, the same for every agent", 16)
    n_search: int = option("training instances of the grid search", 6)
    grid: tuple[int, int, int] = option(
        "grid of the search: how many Courant multiples, sound speeds and xsph values", (4, 6, 3)
    )
    networks: tuple[str, ...] = option(
        "exported networks instead of the shipped ones: ppo runs/x/network.npz sac FILE ...", ()
    )
    output: Path = option(
        "folder of the report; finished episodes in it are kept", Path("runs/compare")
    )


def specs(args: ComparisonArgs) -> list[Spec]:
    """Return the agents as plain data; say which have no trained network and are left out.

    Raises ValueError for unknown names, and for networks that are no pairs of agent and file.
    """
    if len(args.networks) % 2:
        raise ValueError(f"networks: expected pairs of agent and file, got {args.networks}")
    networks = dict(zip(args.networks[::2], args.networks[1::2], strict=True))
    for name in args.agents:
        known("agents", name, NAMES)
    for count in args.grid:
        whole("grid", count, at_least=1)
    whole("n_search", args.n_search, at_least=1)
    learned = [agent for agent in args.agents if agent in LEARNED]
    if networks and not learned:
        raise ValueError("networks: expected none, for no learned agent is among --agents")
    for name, path in networks.items():
        known("networks", name, learned)
        Network.load(path)
    chosen, missing = list[Spec](), list[str]()
    for name in dict.fromkeys(args.agents):
        if name in STATIC:
            chosen.append(_search(args, name))
        elif name in LEARNED:
            network = networks.get(name) or network_of(name, args.scene)
            if network is not None:
                chosen.append(Spec(name, network=str(network)))
            else:
                missing.append(name)
        else:
            chosen.append(Spec(name))
    left_out = f"no network for {args.scene} comes with the package: {', '.join(missing)}"
    if not chosen:
        raise ValueError(f"agents: {left_out}; --networks takes one of your own")
    if missing:
        print(f"{left_out}; left out")
    return chosen


def _search(args: ComparisonArgs, name: str) -> Spec:
    """Return a static agent: the best setting on train, or in hindsight that of each instance."""
    n_courant, n_sound, n_xsph = args.grid
    late = name == "hindsight"
    search = static_search.StaticSearchArgs(
        method="grid_search" if late else name,
        scene=args.scene,
        instances=args.instances if late else "train",
        n_instances=args.n_instances if late else args.n_search,
        per="instance" if late else "scene",
        courant=_spread(0.5, 1.2, n_courant),
        sound=_spread(0.2, 1.0, n_sound),
        xsph=_spread(0.1, 0.7, n_xsph),
        trials=n_courant * n_sound * n_xsph,
        output=args.output,
        backend=args.backend,
        address=args.address,
        workers=args.workers,
    )
    found = static_search.best(static_search.search(search))
    return Spec(name, table=str(search.table)) if late else Spec(name, found[args.scene])


def _spread(low: float, high: float, count: int) -> tuple[float, ...]:
    """Return values from low to high at equal ratios."""
    return tuple(round(float(value), 3) for value in np.geomspace(low, high, count))


class FilmedEnv(gym.Wrapper[Any, Any, Any, Any]):
    """Keeps a picture of every step."""

    def __init__(self, env: gym.Env[Any, Any], title: str) -> None:
        super().__init__(env)
        self._title = title
        self.pictures: list[Picture] = []

    def step(self, action: Any) -> Any:
        """Make one step, and its picture."""
        result = self.env.step(action)
        tuning: Any = self.env.unwrapped
        if not self.pictures:
            self._painter = Painter(tuning.sim.scene, size=PANEL_WIDTH)
        info = result[4]
        end = f"blew up ({info['blowup_cause']})" if result[2] else f"work {info['work']:.2f}"
        self.pictures.append(self._painter.paint(tuning.sim, title=self._title, lines=(end,)))
        return result


def film(
    chosen: list[Spec], scene: str, instance: str
) -> tuple[dict[str, list[dict[str, Any]]], list[list[Picture]]]:
    """Play an episode of every agent on one instance; return infos by agent, and pictures."""
    episodes, pictures = {}, []
    with progress_bar(len(chosen), "recording", "agent") as bar:
        for spec in chosen:
            env = FilmedEnv(gym.make(env_id(scene)), style_of(spec.name).label)
            episodes[spec.name] = play(env, build(spec, 0), instance, seed=0)
            pictures.append(env.pictures)
            bar.update()
    return episodes, pictures


def animate(pictures: list[list[Picture]], folder: Path) -> None:
    """Write all agents side by side, as a film and as a still from a third into it.

    One that blew up stays on its last picture.
    """
    length = max(map(len, pictures))

    def at(k: int) -> Picture:
        return side_by_side([own[min(k, len(own) - 1)] for own in pictures])

    bitrate = round(FILM_SIZE * FRAMES_PER_SECOND / length)
    write_video(folder / "side_by_side.mp4", map(at, range(length)), FRAMES_PER_SECOND, bitrate)
    with atomic_write(folder / "side_by_side.png") as draft:
        imageio.imwrite(draft, at(length // 3))


def compare(args: ComparisonArgs) -> Path:
    """Run everything that is missing and write the folder. Returns the path of the report."""
    instances = instance_ids(args.scene, args.instances, args.n_instances)
    chosen = specs(args)
    runs = evaluate(chosen, args.scene, instances, args.output / "runs.csv", args.where())
    summary, shifts = summary_table(runs), shift_table(runs)
    report.write_tables(summary, args.output)
    if len(shifts):
        report.write_tables(shifts, args.output, "table_by_shift")
    plots.plot_returns(runs, args.output / "returns.png")
    plots.plot_cost_against_error(runs, args.output / "cost_against_error.png")
    plots.plot_reward_terms(runs, args.output / "reward_terms.png")
    episodes, pictures = film(chosen, args.scene, instances[0])
    scene = parse_instance(instances[0]).build()
    nominal = scene.fluid.stiffness(scene.fluid.c0)
    plots.plot_controls(episodes, args.output / "controls.png", nominal)
    animate(pictures, args.output)
    page = report.write_report(args.output, _context(args, chosen, summary, instances))
    show_summary(runs, f"{args.scene}: {len(instances)} instances of {args.instances!r}")
    print("mean ± half of the 95 % bootstrap interval over instances; best return first")
    return page


def _context(
    args: ComparisonArgs, chosen: Sequence[Spec], summary: pd.DataFrame, instances: list[str]
) -> dict[str, Any]:
    return {
        "notes": _notes(args, chosen),
        "scene": args.scene,
        "summary": summary,
        "instances": instances,
        "recorded_instance": instances[0],
        "command": command(),
        "versions": {
            "sph_gym": sph_gym.__version__,
            "python": platform.python_version(),
            "numpy": np.__version__,
            "numba": numba.__version__,
        },
        "cpu": describe()["processor"],
        "date": date.today().isoformat(),
    }


def _notes(args: ComparisonArgs, chosen: Sequence[Spec]) -> list[str]:
    """Return sentences about how the agents were set up."""
    notes = []
    for spec in chosen:
        if spec.network is not None:
            label = style_of(spec.name).label
            notes.append(f"{label} plays the network {Path(spec.network).name}.")
        elif spec.settings is not None:
            courant, sound, xsph = spec.settings
            notes.append(
                f"{style_of(spec.name).label} tried {np.prod(args.grid)} settings on "
                f"{args.n_search} training instances; the best was dt = {courant:g} h/c, "
                f"c = {sound:g} c0, xsph = {xsph:g}."
            )
        elif spec.table is not None:
            notes.append(
                f"{style_of(spec.name).label} is the best of {np.prod(args.grid)} settings on the "
                "very instance."
            )
    if args.instances == "ood":
        notes.append(
            f"These flows are out of distribution in {len(ODD)} ways, in turns: "
            f"{', '.join(ODD.values())}"
            ". The table takes them together; table_by_shift.csv and table_by_shift.md have each "
            "by itself."
        )
    return notes


def main(args: ComparisonArgs) -> None:
    """Compare agents, and say where the report is."""
    print(f"report: {compare(args)}")


if __name__ == "__main__":
    launch(main, ComparisonArgs, __doc__)
