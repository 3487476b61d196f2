"""Read recordings of any solver: `open_recording`."""

from sph_gym.doctor.reading.files import open_recording
from sph_gym.doctor.reading.frames import Frame, Known, Recording

__all__ = ["Frame", "Known", "Recording", "open_recording"]
