"""Video of a replay page, from pictures in a headless browser."""

from __future__ import annotations

import contextlib
import tempfile
from collections.abc import Iterable, Iterator
from pathlib import Path
from subprocess import DEVNULL, PIPE, Popen
from typing import TYPE_CHECKING

import numpy as np

from tetra_drake.errors import InputError
from tetra_drake.files import check_file, whole_file
from tetra_drake.formatting import Say, silent
from tetra_drake.lab.films.browser import do, launch_browser, picture_of, wait_until_loaded
from tetra_drake.machine import check_package

if TYPE_CHECKING:
    from playwright.sync_api import Page

VIEWS = {
    "free": None,
    "side": (0.0, -1.0, 0.15),
    "front": (1.0, 0.0, 0.15),
    "top": (0.0, -0.01, 1.0),
}
"""Directions in World from the robot to the camera, by name of the view; `free` is the page's."""

_GIF = "split[a][b];[a]palettegen[p];[b][p]paletteuse=dither=none"
"""Filter of ffmpeg: colours of the video itself. Dithered frames would be twice as large."""

KINDS = {
    ".mp4": ["-codec", "libx264", "-pix_fmt", "yuv420p", "-crf", "10"],
    ".gif": ["-filter_complex", _GIF],
}
"""Options of ffmpeg by suffix of the file."""

MOST_FRAMES = 100_000
_MOST_FPS_OF_GIF = 50.0
"""Frames per second of a GIF, at most. Browsers show frames of less than 0.02 s for 0.1 s."""


def check_video(path: Path, *, fps: float) -> None:
    """Raises InputError if a video cannot be written: its suffix is not one of KINDS, a GIF has too
    many frames per second, or a package is missing."""
    check_file(path)
    if path.suffix not in KINDS:
        raise InputError(path, "", f"expected a file that ends in {' or '.join(KINDS)}")
    if path.suffix == ".gif" and fps > _MOST_FPS_OF_GIF:
        expected = f"expected {_MOST_FPS_OF_GIF:g} at most for a GIF"
        raise InputError("video", "fps", f"found {fps:g} frames per second, {expected}")
    check_package("imageio_ffmpeg", extra="video", source="video")


def make_video(
    replay: str,
    path: Path,
    *,
    size: tuple[int, int] = (1920, 1080),
    fps: float = 30.0,
    view: str = "free",
    speed: float = 1.0,
    say: Say = silent,
) -> None:
    """Writes a video of a replay page: an MP4 or a GIF, by the suffix of `path`.

    Args:
        replay: the page as HTML, see replay.Replay.page().
        path: the file to write.
        size: width and height in pixels; both are even.
        fps: frames per second.
        view: a name in VIEWS. The camera follows the robot.
        speed: speed of the robot in the video, as a multiple of its own.
        say: function that gets lines of text about the progress.

    Raises:
        InputError: if the file cannot be written, the video has more than MOST_FRAMES frames, or
            what draws it is not installed or fails.
    """
    check_video(path, fps=fps)
    with launch_browser() as browser:
        page = browser.new_page(viewport={"width": size[0], "height": size[1]})
        page.set_content(replay)
        wait_until_loaded(page)
        do(page, "dress", False)
        do(page, "camera", {"follow": True, "from": VIEWS[view]})
        duration = page.evaluate("film.duration")
        if not (fps > 0.0 and speed > 0.0 and duration * fps / speed <= MOST_FRAMES):
            problem = f"found {fps:g} at {speed:g} times the speed, expected fewer frames than"
            raise InputError("video", "fps", f"{problem} {MOST_FRAMES} in all")
        encode(_frames(page, np.arange(0.0, duration, speed / fps), say), path, size=size, fps=fps)


def _frames(page: Page, times: np.ndarray, say: Say) -> Iterator[bytes]:
    """Screenshots of a replay page at these times (s) of the simulation, as the bytes of their RGB
    pixels. `say` gets a line of text about the progress every 50 screenshots."""
    for number, time in enumerate(times.tolist()):
        do(page, "show", time)
        yield picture_of(page).tobytes()
        if number % 50 == 0:
            say(f"frame {number + 1} of {len(times)}")


def encode(frames: Iterable[bytes], path: Path, *, size: tuple[int, int], fps: float) -> None:
    """Writes a video of frames (bytes of RGB pixels) by ffmpeg. `size` is width and height in
    pixels, `fps` the number of frames per second.

    Raises InputError unless ffmpeg takes all frames and ends well.
    """
    import imageio_ffmpeg

    given = f"-f rawvideo -pix_fmt rgb24 -s {size[0]}x{size[1]} -r {fps:.9g} -i -".split()
    with whole_file(path) as temporary, tempfile.TemporaryFile() as log:
        try:
            ffmpeg = [imageio_ffmpeg.get_ffmpeg_exe(), "-y", "-v", "error"]
            command = [*ffmpeg, *given, *KINDS[path.suffix], str(temporary)]
            process = Popen(command, stdin=PIPE, stdout=DEVNULL, stderr=log)
        except (OSError, RuntimeError) as error:
            hint = "reinstall imageio-ffmpeg, or set IMAGEIO_FFMPEG_EXE to an ffmpeg"
            raise InputError("video", "", f"ffmpeg does not start: {error}; {hint}") from error
        took_all = False
        with process, contextlib.suppress(BrokenPipeError):
            assert process.stdin is not None
            try:
                for frame in frames:
                    process.stdin.write(frame)
                process.stdin.close()
                took_all = True
            finally:
                if not took_all:
                    process.kill()
        if process.returncode or not took_all:
            log.seek(0)
            lines = log.read().decode(errors="replace").splitlines() or ["it was ended"]
            reason = lines[-1].rpartition("] ")[2]
            raise InputError(path, "", f"cannot be written: ffmpeg failed: {reason}")
