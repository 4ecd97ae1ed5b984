"""Video of a replay page, from pictures in a headless browser."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from tetra_drake.errors import InputError
from tetra_drake.files import whole_file
from tetra_drake.formatting import Say, silent
from tetra_drake.machine import check_package
from tetra_drake.visualization.browser import (
    do,
    launch_browser,
    picture_of,
    wait_until_loaded,
)

VIEWS = {
    "free": None,
    "side": (0.0, -1.0, 0.15),
    "front": (1.0, 0.0, 0.15),
    "top": (0.0, -0.01, 1.0),
}
"""Directions in World from the robot to the camera, by name of the view; `free` is the page's."""

_GIF = "split[a][b];[a]palettegen[p];[b][p]paletteuse=dither=none"
"""Filter of ffmpeg: colours of the video itself. Dithered frames would be twice as large."""

KINDS: dict[str, Any] = {
    ".mp4": {"codec": "libx264", "quality": 8},
    ".gif": {
        "codec": "gif",
        "pix_fmt_out": "pal8",
        "ffmpeg_log_level": "error",  # else a line for every equal pair of colours
        "output_params": ["-filter_complex", _GIF],
    },
}
"""Settings of ffmpeg by suffix of the file."""


def check_video(path: Path) -> None:
    """Raises InputError if a video cannot be written: its suffix is not one of KINDS, or a package
    is missing."""
    if path.suffix not in KINDS:
        raise InputError(path, "", f"expected a file that ends in {' or '.join(KINDS)}")
    check_package("imageio_ffmpeg", extra="video", source="video")


def make_video(
    replay: Path,
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
        replay: the page, see replay.save_replay().
        size: width and height in pixels; both are even.
        fps: frames per second.
        view: a name in VIEWS. The camera follows the robot.
        speed: speed of the robot in the video, as a multiple of its own.
        say: is told the progress.

    Raises:
        InputError: if the file cannot be written, or what draws it is not installed.
    """
    check_video(path)
    import imageio_ffmpeg

    with launch_browser() as browser, whole_file(path) as temporary:
        page = browser.new_page(viewport={"width": size[0], "height": size[1]})
        page.goto(replay.resolve().as_uri())
        wait_until_loaded(page)
        do(page, "dress", False)
        do(page, "camera", {"follow": True, "from": VIEWS[view]})
        times = np.arange(0.0, page.evaluate("film.duration"), speed / fps).tolist()
        kind = {"macro_block_size": 2, **KINDS[path.suffix]}
        film = imageio_ffmpeg.write_frames(str(temporary), size, fps=fps, **kind)
        film.send(None)
        for number, time in enumerate(times):
            do(page, "show", time)
            film.send(np.asarray(picture_of(page)))
            if number % 50 == 0:
                say(f"frame {number + 1} of {len(times)}")
        film.close()
