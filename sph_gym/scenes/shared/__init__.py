"""Shared parts of several scenes, and the types in which a scene describes itself."""
