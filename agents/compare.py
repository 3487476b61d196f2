"""The main job: all agents on the same instances and seeds, and a report of how they did."""

import platform
import sys
from dataclasses import dataclass, field
from datetime import date
from pathlib import Path
from typing import Any

import gymnasium as gym
import imageio.v3 as imageio
import numba
import numpy as np
import pandas as pd
import tyro
from numpy.typing import NDArray
from tqdm import tqdm

import sph_gym
from agents import grid_search, plots, report
from agents.evaluate import (
    evaluate,
    instance_ids,
    play,
    readable,
    shift_table,
    show,
    summary_table,
)
from agents.looks import AGENTS
from agents.policies import LEARNED, NAMES, Spec, build, trained_network
from sph_gym.env import env_id
from sph_gym.env.instances import ODD, parse
from sph_gym.view import Painter, side_by_side, write_video

PANEL_WIDTH = 480
FRAMES_PER_SECOND = 20


@dataclass
class Args:
    """Compare agents on unseen instances of a scene; writes a table, plots, a video, a report."""

    scene: str = "dam_break"
    """scene of the environment"""
    agents: tuple[str, ...] = NAMES
    """which agents"""
    instances: str = "test"
    """nominal, train, val, test or ood; of ood, each shift is told by itself too"""
    n_instances: int = 16
    """how many of them, the same for every agent"""
    n_search: int = 6
    """training instances of the grid search"""
    grid: tuple[int, int, int] = (4, 6, 3)
    """grid of the search: how many Courant multiples, sound speeds and xsph values"""
    networks: dict[str, Path] = field(default_factory=dict)
    """exported networks instead of the shipped ones, e.g. --networks ppo runs/x/network.npz"""
    output: Path = Path("runs/compare")
    """folder of the report; finished runs in it are kept"""


def specs(args: Args) -> list[Spec]:
    """The agents as plain data; learned ones without a trained network are left out aloud.

    Raises ValueError for unknown names.
    """
    chosen = []
    for name in args.agents:
        if name not in NAMES:
            raise ValueError(f"agents: expected some of {', '.join(NAMES)}, got {name!r}")
        if name == "grid_search":
            chosen.append(grid_search.best(_search(args)))
        elif name in LEARNED:
            network = args.networks.get(name, trained_network(name, args.scene))
            if not network.exists():
                print(f"{name}: no network has been trained for {args.scene}, left out")
                continue
            chosen.append(Spec(name, network=str(network)))
        else:
            chosen.append(Spec(name))
    return chosen


def _search(args: Args) -> pd.DataFrame:
    n_courant, n_sound, n_xsph = args.grid
    return grid_search.search(
        grid_search.Args(
            scene=args.scene,
            n_instances=args.n_search,
            courant=_spread(0.5, 1.2, n_courant),
            sound=_spread(0.2, 1.0, n_sound),
            xsph=_spread(0.1, 0.5, n_xsph),
            output=args.output,
        )
    )


def _spread(low: float, high: float, count: int) -> tuple[float, ...]:
    """Values from low to high at equal ratios."""
    return tuple(round(float(value), 3) for value in np.geomspace(low, high, count))


class Recorder(gym.Wrapper[Any, Any, Any, Any]):
    """Keeps a picture of every step."""

    def __init__(self, env: gym.Env[Any, Any], label: str) -> None:
        super().__init__(env)
        self._label = label
        self.pictures: list[NDArray[np.uint8]] = []

    def step(self, action: Any) -> Any:
        """One step, and its picture."""
        result = self.env.step(action)
        tuning: Any = self.env.unwrapped
        if not self.pictures:
            self._painter = Painter(tuning.sim.scene, size=PANEL_WIDTH)
        info = result[4]
        end = f"blew up ({info['blowup_cause']})" if result[2] else f"work {info['work']:.2f}"
        self.pictures.append(self._painter.paint(tuning.sim, title=self._label, lines=(end,)))
        return result


def record(
    chosen: list[Spec], scene: str, instance: str
) -> tuple[dict[str, list[dict[str, Any]]], list[list[NDArray[np.uint8]]]]:
    """One episode of every agent on the same instance: its infos and its pictures."""
    episodes, pictures = {}, []
    for spec in tqdm(chosen, desc="recording", unit="agent"):
        env = Recorder(gym.make(env_id(scene)), AGENTS[spec.name][0])
        episodes[spec.name] = play(env, build(spec, 0), instance, seed=0)
        pictures.append(env.pictures)
    return episodes, pictures


def animate(pictures: list[list[NDArray[np.uint8]]], folder: Path) -> None:
    """All agents side by side, as a film and as a still from a third into it.

    One that blew up stays on its last picture.
    """
    length = max(map(len, pictures))

    def at(k: int) -> NDArray[np.uint8]:
        return side_by_side([own[min(k, len(own) - 1)] for own in pictures])

    write_video(folder / "side_by_side.mp4", map(at, range(length)), FRAMES_PER_SECOND)
    imageio.imwrite(folder / "side_by_side.png", at(length // 3))


def compare(args: Args) -> Path:
    """Run everything that is missing and write the folder. Returns the path of the report."""
    instances = instance_ids(args.scene, args.instances, args.n_instances)
    chosen = specs(args)
    runs = evaluate(chosen, args.scene, instances, args.output / "runs.csv")
    summary, shifts = summary_table(runs), shift_table(runs)
    report.write_tables(summary, args.output)
    if len(shifts):
        report.write_tables(shifts, args.output, "table_by_shift")
    plots.plot_returns(runs, args.output / "returns.png")
    plots.plot_cost_against_error(runs, args.output / "cost_against_error.png")
    plots.plot_reward_terms(runs, args.output / "reward_terms.png")
    episodes, pictures = record(chosen, args.scene, instances[0])
    scene = parse(instances[0]).build()
    nominal = scene.fluid.stiffness(scene.fluid.c0)
    plots.plot_controls(episodes, args.output / "controls.png", nominal)
    animate(pictures, args.output)
    page = report.write_report(args.output, _context(args, chosen, summary, instances))
    show(readable(summary), f"{args.scene}: {len(instances)} instances of {args.instances!r}")
    if len(shifts):
        show(readable(shifts), f"{args.scene}, by what is out of distribution")
    print("mean ± half of the 95 % bootstrap interval over instances; best return first")
    return page


def _context(
    args: Args, chosen: list[Spec], summary: pd.DataFrame, instances: list[str]
) -> dict[str, Any]:
    return {
        "notes": _notes(args, chosen),
        "scene": args.scene,
        "summary": summary,
        "instances": instances,
        "recorded_instance": instances[0],
        "command": "python -m agents.compare " + " ".join(sys.argv[1:]),
        "versions": {
            "sph_gym": sph_gym.__version__,
            "python": platform.python_version(),
            "numpy": np.__version__,
            "numba": numba.__version__,
        },
        "cpu": report.cpu_name(),
        "date": date.today().isoformat(),
    }


def _notes(args: Args, chosen: list[Spec]) -> list[str]:
    notes = [_note(spec, args) for spec in chosen if spec.settings or spec.network]
    if args.instances == "ood":
        kinds = ", ".join(ODD.values())
        notes.append(
            f"These flows are out of distribution in four ways, in turns: {kinds}. The table "
            "takes them together; table_by_shift.csv and table_by_shift.md tell them apart."
        )
    return notes


def _note(spec: Spec, args: Args) -> str:
    if spec.settings is None:
        return f"{AGENTS[spec.name].label} plays the network {Path(str(spec.network)).name}."
    courant, sound, xsph = spec.settings
    return (
        f"The grid search tried {np.prod(args.grid)} settings on {args.n_search} training "
        f"instances; the best was dt = {courant:g} h/c, c = {sound:g} c0, xsph = {xsph:g}."
    )


if __name__ == "__main__":
    print(f"report: {compare(tyro.cli(Args, description=__doc__))}")
