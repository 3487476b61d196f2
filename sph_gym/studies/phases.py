"""The phases of a step, each repeated within one compiled call, so that it can be timed.

A call from Python takes as long as a phase of a small fluid, so the repetition is compiled too.
Every phase leaves what the next one needs, as it does within a step.
"""

from sph_gym.solver.boundary import compute_wall_density
from sph_gym.solver.density import compute_fluid_density
from sph_gym.solver.integrators import move
from sph_gym.solver.jit import jit
from sph_gym.solver.neighbors import read_grid, sort_into_cells


@jit
def sort(world, model, standstill, repeats):
    """Sort particles into the order of their cells."""
    cells = world.cells
    for _ in range(repeats):
        sort_into_cells(0, 1, world.team, world.spare, cells.fluid, world.sorting, cells.start)


@jit
def wall_density(world, model, standstill, repeats):
    """Compute density and pressure of wall particles."""
    for _ in range(repeats):
        grid = read_grid(world.sorting.frame)
        compute_wall_density(world.cells.walls, 0, 1, world.cells, model, grid)


@jit
def fluid_density(world, model, standstill, repeats):
    """Compute neighbour lists, density and pressure of the fluid."""
    n = world.cells.fluid.id.size
    for _ in range(repeats):
        grid = read_grid(world.sorting.frame)
        compute_fluid_density(0, 1, 0, n, world.cells, model, grid, standstill)


@jit
def force(world, model, standstill, repeats):
    """Integrate by a time step `standstill`, which is 0 in the precision of the particles."""
    n = world.cells.fluid.id.size
    for _ in range(repeats):
        move(model.integrator, 0, 0, n, world.cells, world.spare, model, 0.0, standstill)


# In the order of a step.
PHASES = {
    "sort": sort,
    "wall density": wall_density,
    "lists, fluid density": fluid_density,
    "force, integration": force,
}
