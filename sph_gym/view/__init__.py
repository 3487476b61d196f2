"""Pictures of simulations and recordings: frames without a display, a window, videos."""

from sph_gym.view.frames import Painter
from sph_gym.view.history import History
from sph_gym.view.playback import Recording
from sph_gym.view.video import side_by_side, write_video
from sph_gym.view.window import Window

__all__ = ["History", "Painter", "Recording", "Window", "side_by_side", "write_video"]
