"""Elliptical drop and dam break of PySPH, as its examples set them: results and times.

`python pysph_accuracy.py SCENE --across N`, with a Python that has PySPH. Prints one line
`RES {json}`: seconds from the first step on, by the clock on the wall and of its own, and of the
drop the farthest particle along y, of the dam break the front over time. PEERS: a folder for what
PySPH writes.
"""

import argparse
import json
import os
import time

# The front is compared up to T = t sqrt(2 g / width) = 3.3, and has then come 4.5 widths far.
GRAVITY, LAST, TANK = 9.81, 3.3, 5.0


def main() -> None:
    """Run a scene and print its result."""
    parser = argparse.ArgumentParser()
    parser.add_argument("scene", choices=("elliptical_drop", "dam_break"))
    parser.add_argument("--across", type=int, required=True, help="particles along its length")
    options = parser.parse_args()
    run = {"elliptical_drop": elliptical_drop, "dam_break": dam_break}[options.scene]
    print("RES " + json.dumps(run(options.across)), flush=True)


def arguments(*more: str) -> list[str]:
    """Return PySPH's command line: one thread, no files."""
    folder = os.path.join(os.environ.get("PEERS", "."), "pysph_output")
    return [*more, "--disable-output", "-q", "-d", folder, "--logfile", "", "--no-openmp"]


def timed(application: type) -> type:
    """Return the application with a clock that begins with its first step."""

    class TimedApplication(application):
        began = own = 0.0
        steps = 0

        def pre_step(self, solver):
            if not self.steps:
                self.start = self.look(solver)
                self.began, self.own = time.perf_counter(), time.process_time()

        def post_step(self, solver):
            self.steps += 1
            self.seen(solver)

        def clocks(self):
            wall, own = time.perf_counter(), time.process_time()
            return {"seconds": wall - self.began, "own": own - self.own}

        def look(self, solver):
            return None

        def seen(self, solver):
            return None

    return TimedApplication


def elliptical_drop(across: int) -> dict:
    """Return the farthest particle from the middle at the start, and along y in the end."""
    from pysph.examples.elliptical_drop import EllipticalDrop

    class Drop(timed(EllipticalDrop)):  # type: ignore[misc]
        def look(self, solver):
            fluid = self.particles[0]
            return float(((fluid.x**2 + fluid.y**2) ** 0.5).max())

    app = Drop(fname="elliptical_drop")
    app.run(arguments("--nx", str(across)))
    clocks, fluid = app.clocks(), app.particles[0]
    return {
        **clocks,
        "steps": app.steps,
        "particles": int(fluid.get_number_of_particles()),
        "time": float(app.solver.t),
        "radius": app.start,
        "tip": float(abs(fluid.y).max()),
        "dx": 1.0 / across,
    }


def dam_break(across: int) -> dict:
    """Return the foremost particle over time, of a column one wide and two high, in a long tank."""
    import pysph.examples.dam_break_2d as example

    dx = 1.0 / across
    # the example takes these from a dx of its own
    example.h, example.m = example.hdx * dx, dx * dx * example.ro
    # and the front would meet the right wall of its tank too early
    shorter, example.container_width = example.get_2d_tank, TANK
    example.get_2d_tank = lambda **given: shorter(**{**given, "base_center": [TANK / 2, 0]})
    history = []

    class Dam(timed(example.DamBreak2D)):  # type: ignore[misc]
        def seen(self, solver):
            history.append((float(solver.t), float(self.particles[0].x.max())))

    app = Dam(fname="dam_break_2d")
    # a column wider by dx than it says, the first row of which stands dx from the wall's
    end = LAST * ((1 + dx) / (2 * GRAVITY)) ** 0.5
    app.run(arguments("--dx", repr(dx), "--tf", repr(end)))
    clocks = app.clocks()
    stride = max(len(history) // 400, 1)
    return {
        **clocks,
        "steps": app.steps,
        "particles": sum(int(part.get_number_of_particles()) for part in app.particles),
        "history": history[::stride] + history[-1:],
        "dx": dx,
        "width": 1 + dx,
    }


if __name__ == "__main__":
    main()
