"""The phases of a step, each repeated within one compiled call, so that it can be timed.

A call from Python takes as long as a phase of a small fluid, so the repetition is compiled too.
Every phase leaves what the next one needs, as it does within a step.
"""

from sph_gym.solver.density import compute_fluid_density, compute_wall_density
from sph_gym.solver.integrators import move
from sph_gym.solver.jit import jit
from sph_gym.solver.neighbors import read_grid, sort_into_cells


@jit
def sort(world, model, standstill, repeats):
    """Sort particles into the order of their cells."""
    for _ in range(repeats):
        grid = read_grid(world.sorting.frame)
        sort_into_cells(
            0, 1, world.team, grid, world.spare, world.fluid, world.sorting, world.start,
        )  # fmt: skip


@jit
def wall_density(world, model, standstill, repeats):
    """Compute density and pressure of wall particles."""
    for _ in range(repeats):
        grid = read_grid(world.sorting.frame)
        compute_wall_density(
            0, 1, world.walls, world.wall_sums, world.wall_start, world.fluid, world.start,
            grid, world.lists, model.kernel, model.eos, model.constants,
        )  # fmt: skip


@jit
def fluid_density(world, model, standstill, repeats):
    """Compute neighbour lists, density and pressure of the fluid."""
    for _ in range(repeats):
        grid = read_grid(world.sorting.frame)
        compute_fluid_density(
            0, 1, 0, world.fluid.id.size, world.fluid, world.start, world.walls, world.wall_start,
            grid, world.lists, model.kernel, model.eos, model.constants, model.effects,
            model.alone, standstill,
        )  # fmt: skip


@jit
def force(world, model, standstill, repeats):
    """Integrate by a time step `standstill`, which is 0 in the precision of the particles."""
    for _ in range(repeats):
        move(
            model.integrator, 0, 0, world.fluid.id.size, world.fluid, world.spare, world.walls,
            world.lists, model, 0.0, standstill,
        )  # fmt: skip


# In the order of a step.
PHASES = {
    "sort": sort,
    "wall density": wall_density,
    "lists, fluid density": fluid_density,
    "force, integration": force,
}
