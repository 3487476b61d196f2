"""Videos from frames, and several pictures tiled into one."""

import math
import os
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sph_gym.extras import needs_extra
from sph_gym.files import atomic_write, target_path
from sph_gym.solver.checks import positive
from sph_gym.view.colors import PAGE, RULE
from sph_gym.view.layout import even

Picture = NDArray[np.uint8]

ENDINGS = (".mp4", ".gif")
# Gap between tiles [pixels].
GAP = 4
# Width over height that a grid of tiles comes near to.
GRID_RATIO = 1.5


def write_video(
    path: str | os.PathLike[str],
    frames: Iterable[Picture],
    fps: float,
    bitrate: int | None = None,
) -> None:
    """Write pictures, each (height, width, 3) uint8, as .mp4 or .gif, `fps` of them a second.

    bitrate: mean of an .mp4 [bit/s], to keep the file small; by default as many as it looks good
    with. Odd sizes are padded to even ones. The file appears when it is complete: an interrupted or
    failed write leaves what was there before. A GIF is held in memory, and its frames last whole
    hundredths of a second, at least two.

    Raises ValueError for other endings, for no frames, for frames of another type or of unequal
    shapes, and for fps <= 0; FileNotFoundError if there is no such directory; ImportError that
    names the extra to install if imageio is missing.
    """
    target = target_path("path", path, ENDINGS)
    fps = positive("fps", fps)
    with atomic_write(target) as draft:
        if target.suffix.lower() == ".gif":
            _write_gif(draft, _checked(frames), fps)
        else:
            _write_mp4(draft, _checked(frames), fps, bitrate)


def side_by_side(frames: Sequence[Picture]) -> Picture:
    """Return one picture, (height, width, 3) uint8, of several in a balanced grid, row by row.

    frames: (height, width, 3) uint8 each; smaller ones are centred in their tile, and the whole
    is padded to even sizes. Raises ValueError for an empty list and for anything else in it.
    """
    pictures = [_picture(f"frames[{k}]", frame) for k, frame in enumerate(frames)]
    if not pictures:
        raise ValueError("frames: expected at least one picture, got none")
    tile = np.array([picture.shape[:2] for picture in pictures]).max(axis=0)
    n_columns = _columns(len(pictures), *tile.tolist())
    n_rows = math.ceil(len(pictures) / n_columns)
    height, width = np.array([n_rows, n_columns]) * (tile + GAP) - GAP
    canvas = np.empty((even(height), even(width), 3), np.uint8)
    canvas[:] = RULE
    for k in range(n_rows * n_columns):
        top, left = np.array(divmod(k, n_columns)) * (tile + GAP)
        canvas[top : top + tile[0], left : left + tile[1]] = PAGE
        if k < len(pictures):
            rows, columns = pictures[k].shape[:2]
            top, left = top + (tile[0] - rows) // 2, left + (tile[1] - columns) // 2
            canvas[top : top + rows, left : left + columns] = pictures[k]
    return canvas


def _columns(n: int, height: int, width: int) -> int:
    """Return how many columns bring n tiles nearest to `GRID_RATIO`; empty places count against."""

    def badness(n_columns: int) -> float:
        n_rows = math.ceil(n / n_columns)
        ratio = n_columns * (width + GAP) / (n_rows * (height + GAP))
        return abs(math.log(ratio / GRID_RATIO)) + (n_rows * n_columns - n) / n

    return min(range(1, n + 1), key=badness)


def _picture(name: str, frame: Any) -> Picture:
    """Return the frame as an array, or raise ValueError that names it."""
    array = np.asarray(frame)
    if array.ndim != 3 or array.shape[2] != 3 or array.dtype != np.uint8 or array.size == 0:
        raise ValueError(
            f"{name}: expected shape (height, width, 3) and type uint8, "
            f"got {array.shape} and {array.dtype}"
        )
    return array


def _checked(frames: Iterable[Picture]) -> Iterator[Picture]:
    """Yield the frames, padded to even sizes; ValueError at the first one that doesn't fit."""
    shape = None
    for k, frame in enumerate(frames):
        picture = _picture(f"frames[{k}]", frame)
        shape = shape or picture.shape
        if picture.shape != shape:
            raise ValueError(
                f"frames[{k}]: expected the shape of the first, {shape}, got {picture.shape}"
            )
        rows, columns = shape[0] % 2, shape[1] % 2
        yield np.pad(picture, ((0, rows), (0, columns), (0, 0)), mode="edge")
    if shape is None:
        raise ValueError("frames: expected at least one picture, got none")


def _write_mp4(path: Path, frames: Iterator[Picture], fps: float, bitrate: int | None) -> None:
    with needs_extra("studies"):
        import imageio.v2 as imageio
        import imageio_ffmpeg  # noqa: F401
    # a block of two is what yuv420p asks for; quality 8 of 10 keeps small discs crisp
    options: dict[str, Any] = {"codec": "libx264", "macro_block_size": 2}
    options |= {"quality": 8} if bitrate is None else {"quality": None, "bitrate": bitrate}
    first = next(frames)
    writer: Any = imageio.get_writer(path, format="FFMPEG", mode="I", fps=fps, **options)
    try:
        writer.append_data(first)
        for frame in frames:
            writer.append_data(frame)
    finally:
        # its context manager would leave the encoder running after an error
        writer.close()


def _write_gif(path: Path, frames: Iterator[Picture], fps: float) -> None:
    with needs_extra("studies"):
        import imageio.v3 as imageio
    milliseconds = max(round(100 / fps), 2) * 10
    imageio.imwrite(path, list(frames), plugin="pillow", duration=milliseconds, loop=0)
