"""A film that grows picture by picture, while its window goes on."""

import threading
from collections.abc import Iterator
from pathlib import Path
from queue import Full, Queue

from sph_gym.view.video import Picture, write_video

# Number of pictures that may wait for the encoder; with more, the window waits.
WAITING = 32
# How long the window waits at a time [s], to see whether the encoder has failed.
NAP = 0.1


class Film:
    """Writes pictures as .mp4 in a thread of its own; the file appears when it is closed.

    path: of the file; fps: pictures a second.
    """

    def __init__(self, path: Path, fps: float) -> None:
        self.path, self.n_pictures = path, 0
        self._queue: Queue[Picture | None] = Queue(WAITING)
        self._failure: Exception | None = None
        self._thread = threading.Thread(target=self._write, args=(fps,), daemon=True)
        self._thread.start()

    def _write(self, fps: float) -> None:
        try:
            write_video(self.path, self._pictures(), fps)
        except Exception as error:
            # told to the window by `close`
            self._failure = error

    def _pictures(self) -> Iterator[Picture]:
        while (picture := self._queue.get()) is not None:
            yield picture

    def add(self, picture: Picture) -> None:
        """Append a picture (height, width, 3) uint8, of the size of the first."""
        self.n_pictures += 1
        self._put(picture)

    def _put(self, picture: Picture | None) -> None:
        while self._thread.is_alive():
            try:
                self._queue.put(picture, timeout=NAP)
            except Full:
                continue
            break

    def close(self) -> str:
        """Finish the file, and return a sentence about it or about why there is none."""
        self._put(None)
        self._thread.join()
        if self._failure is not None:
            return f"not recorded: {self._failure}"
        return f"recorded {self.n_pictures} pictures: {self.path}"


def free_path(stem: str, suffix: str) -> Path:
    """Return a path in the working directory that is not taken: with -2, -3, ... if need be."""
    path, number = Path(f"{stem}{suffix}"), 2
    while path.exists():
        path = Path(f"{stem}-{number}{suffix}")
        number += 1
    return path
