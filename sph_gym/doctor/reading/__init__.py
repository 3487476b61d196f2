"""Read recordings of any solver: `open_recording`."""

from sph_gym.doctor.reading.files import open_recording
from sph_gym.doctor.reading.frames import Frame, Known, RecordedFrames

__all__ = ["Frame", "Known", "RecordedFrames", "open_recording"]
