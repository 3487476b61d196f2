from types import SimpleNamespace

import numpy as np


def planted(scene, v, time=0.0, x=None, p=None, mass=None, **numbers):
    """What a simulation of `scene` would show, with given velocities of its fluid, (n, 2).

    numbers: diagnostics that are to be others, or more, than what x and v say.
    """
    x = np.asarray(scene.x) if x is None else np.asarray(x)
    walls = np.zeros((0, 2))
    wall_v = walls
    if scene.walls is not None and scene.walls.particles is not None:
        walls, wall_v = np.asarray(scene.walls.particles), scene.walls.velocities
    mass = scene.fluid.rho0 * scene.dx**2 if mass is None else mass
    shown = {
        "kinetic_energy": 0.5 * mass * float((v**2).sum()),
        "potential_energy": 0.0,
        "internal_energy": 0.0,
        "com_x": float(x[:, 0].mean()),
        "com_y": float(x[:, 1].mean()),
        "momentum_x": mass * float(v[:, 0].sum()),
        "momentum_y": mass * float(v[:, 1].sum()),
        "angular_momentum": mass * float((x[:, 0] * v[:, 1] - x[:, 1] * v[:, 0]).sum()),
        "max_speed": float(np.hypot(*v.T).max()),
    }
    return SimpleNamespace(
        scene=scene,
        time=time,
        mass=mass,
        n_fluid=len(x),
        n_particles=len(x) + len(walls),
        x=np.concatenate([x, walls]),
        v=np.concatenate([v, wall_v]),
        p=np.zeros(len(x) + len(walls)) if p is None else p,
        diagnostics=lambda: shown | numbers,
    )
