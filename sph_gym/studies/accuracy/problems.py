"""The refinement series under their former names."""

from sph_gym.scenes.shared.refinement import RMS, Refinement, names, refinement, share

Problem = Refinement
problem = refinement

__all__ = ["RMS", "Problem", "names", "problem", "share"]
