"""Videos that can be read again, complete or not at all; tiles."""

import subprocess
import sys

import numpy as np
import pytest

from sph_gym.view import side_by_side, write_video


def frames(n=5, height=48, width=64):
    for k in range(n):
        picture = np.full((height, width, 3), 240, np.uint8)
        picture[:, : 8 * (k + 1)] = (200, 40, 40)
        yield picture


def decoded(path):
    """All bytes of all frames; imageio's own reader leaves files open."""
    ffmpeg = pytest.importorskip("imageio_ffmpeg").get_ffmpeg_exe()
    command = [ffmpeg, "-v", "error", "-i", str(path), "-f", "rawvideo", "-pix_fmt", "rgb24", "-"]
    return np.frombuffer(subprocess.run(command, capture_output=True, check=True).stdout, np.uint8)


@pytest.mark.parametrize("ending", [".mp4", ".gif", ".MP4"])
@pytest.mark.parametrize("size", [(48, 64), (49, 65)])
def test_a_video_can_be_read_again(tmp_path, ending, size):
    path = tmp_path / f"run{ending}"
    write_video(path, frames(5, *size), fps=10)
    shape = (5, size[0] + size[0] % 2, size[1] + size[1] % 2, 3)
    found = decoded(path).reshape(shape)
    for k, wanted in enumerate(frames(5, *size)):
        clear = np.abs(found[k, : size[0], : size[1]].astype(int) - wanted).mean()
        assert clear < 6
    assert [file.name for file in tmp_path.iterdir()] == [path.name]


@pytest.mark.parametrize("ending", [".mp4", ".gif"])
def test_an_interrupted_write_leaves_what_was_there(tmp_path, ending):
    pytest.importorskip("imageio")
    path = tmp_path / f"run{ending}"
    path.write_bytes(b"before")

    def interrupted():
        yield from frames(3)
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_video(path, interrupted(), fps=10)
    assert path.read_bytes() == b"before"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("ending", [".mp4", ".gif"])
@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ([], "at least one picture, got none"),
        ([np.zeros((4, 4), np.uint8)], r"frames\[0\]: expected shape \(height, width, 3\)"),
        ([np.zeros((4, 4, 3))], r"frames\[0\]: .*uint8.*float64"),
        ([*frames(1), *frames(1, width=32)], r"frames\[1\]: expected the shape of the first"),
    ],
)
def test_wrong_frames_are_named(tmp_path, ending, wrong, message):
    pytest.importorskip("imageio")
    with pytest.raises(ValueError, match=message):
        write_video(tmp_path / f"run{ending}", wrong, fps=10)
    assert not list(tmp_path.iterdir())


def test_wrong_paths_and_rates_are_named(tmp_path):
    with pytest.raises(ValueError, match=r"path: expected a name ending in \.mp4 or \.gif"):
        write_video(tmp_path / "run.avi", frames(), fps=10)
    with pytest.raises(ValueError, match="fps"):
        write_video(tmp_path / "run.gif", frames(), fps=0)
    with pytest.raises(FileNotFoundError, match="no directory"):
        write_video(tmp_path / "nowhere" / "run.gif", frames(), fps=10)


@pytest.mark.parametrize("ending", [".mp4", ".gif"])
def test_without_imageio_the_extra_is_named(tmp_path, ending, monkeypatch):
    for name in [module for module in sys.modules if module.split(".")[0] == "imageio"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "imageio", None)
    with pytest.raises(ImportError, match=r'pip install "sph_gym\[studies\]"'):
        write_video(tmp_path / f"run{ending}", frames(), fps=10)


@pytest.mark.parametrize("n", range(1, 8))
@pytest.mark.parametrize("size", [(101, 64), (48, 200)])
def test_tiles_are_whole_and_in_order(n, size):
    pictures = [np.full((*size, 3), 10 * k, np.uint8) for k in range(n)]
    tiled = side_by_side(pictures)
    assert tiled.dtype == np.uint8
    assert tiled.shape[0] % 2 == tiled.shape[1] % 2 == 0
    for k in range(n):
        assert (tiled == 10 * k).all(axis=-1).sum() == size[0] * size[1]
    corners = [tuple(np.argwhere((tiled == 10 * k).all(axis=-1))[0]) for k in range(n)]
    assert corners == sorted(corners)


def test_wide_pictures_are_stacked_and_four_squares_make_a_square():
    wide = side_by_side([np.zeros((50, 300, 3), np.uint8)] * 3)
    assert wide.shape == (158, 300, 3)
    square = side_by_side([np.zeros((50, 50, 3), np.uint8)] * 4)
    assert square.shape == (104, 104, 3)


def test_smaller_pictures_are_centred_in_their_tile():
    tiled = side_by_side([np.zeros((20, 20, 3), np.uint8), np.full((10, 10, 3), 9, np.uint8)])
    rows, columns = np.nonzero((tiled == 9).all(axis=-1))
    assert (rows.min(), rows.max(), columns.min()) == (5, 14, 29)


@pytest.mark.parametrize("wrong", [[], [np.zeros((3, 3), np.uint8)], [np.zeros((3, 3, 3))]])
def test_what_is_no_picture_cannot_be_tiled(wrong):
    with pytest.raises(ValueError, match="frames"):
        side_by_side(wrong)


def test_a_bitrate_bounds_the_size(tmp_path):
    rng = np.random.default_rng(0)
    frames = [rng.integers(0, 256, (120, 160, 3), dtype=np.uint8) for _ in range(40)]
    write_video(tmp_path / "free.mp4", frames, 20)
    write_video(tmp_path / "small.mp4", frames, 20, bitrate=400_000)
    free, small = ((tmp_path / f"{name}.mp4").stat().st_size for name in ("free", "small"))
    # two seconds of 400 kbit/s
    assert small < 1.5 * 100_000 < free
