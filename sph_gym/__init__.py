"""A 2D SPH fluid solver, and Gymnasium environments in which an agent tunes it."""
