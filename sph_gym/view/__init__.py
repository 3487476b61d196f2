"""Pictures of a running simulation: frames without a display, a window with keys, videos."""

from sph_gym.view.frames import Painter
from sph_gym.view.video import side_by_side, write_video
from sph_gym.view.window import Window

__all__ = ["Painter", "Window", "side_by_side", "write_video"]
