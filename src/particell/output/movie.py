"""Animations: GIF by Pillow, MP4 by ffmpeg."""

from __future__ import annotations

import base64
import shutil
from collections.abc import Callable, Iterable, Iterator
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from particell.errors import InputError
from particell.output.files import OutputError, reason, replacing

if TYPE_CHECKING:
    from PIL import Image

KINDS = (".gif", ".mp4")


class Movie:
    """An animation in a file; notebooks play it.

    Parameters
    ----------
    path
        The file.
    """

    def __init__(self, path: Path):
        self.path = path

    def __fspath__(self) -> str:
        return str(self.path)

    def __repr__(self) -> str:
        return f"Movie({str(self.path)!r}, {self.path.stat().st_size / 1e6:.2g} MB)"

    def _repr_html_(self) -> str:
        content = base64.b64encode(self.path.read_bytes()).decode()
        name = escape(self.path.name)
        if self.path.suffix.lower() == ".gif":
            return f'<img alt="{name}" src="data:image/gif;base64,{content}">'
        source = f"data:video/mp4;base64,{content}"
        return f'<video controls loop title="{name}" src="{source}"></video>'


def checked(path: str | Path, fps: float) -> Path:
    """The path, where an animation of this kind can be made here.

    Raises
    ------
    InputError
        For another ending, a rate that is not positive, and where ffmpeg is missing.
    """
    path = Path(path)
    if path.suffix.lower() not in KINDS:
        raise InputError("path", str(path), f"a name that ends in {' or '.join(KINDS)}")
    if not fps > 0:
        raise InputError("fps", fps, "positive")
    if path.suffix.lower() == ".mp4" and ffmpeg() is None:
        allowed = "a GIF where ffmpeg is missing (install it, or pip install 'particell[viz]')"
        raise InputError("path", str(path), allowed)
    return path


def ffmpeg() -> str | None:
    """The program that writes MP4: the system's, or that of the package imageio-ffmpeg."""
    found = shutil.which(matplotlib.rcParams["animation.ffmpeg_path"])
    if found is None:
        try:
            import imageio_ffmpeg

            found = imageio_ffmpeg.get_ffmpeg_exe()
        except (ImportError, RuntimeError):
            return None
    return found


def write_movie(
    figure: Figure,
    frames: Iterable[int],
    move: Callable[[Figure, int], None],
    path: Path,
    *,
    fps: float,
    dpi: float,
    shades: int,
) -> Movie:
    """Draw a figure for one frame after the other.

    Parameters
    ----------
    figure
        As it is at first.
    frames
        The numbers that ``move`` gets.
    move
        Makes the figure that of a frame.
    path
        A file that ends in ``.gif`` or ``.mp4``.
    fps
        Frames a second.
    dpi
        Pixels an inch.
    shades
        Colours of a frame of a GIF, at most 256: fewer make it smaller.

    Raises
    ------
    OutputError
        Where the file cannot be written.
    """
    figure.set_dpi(dpi)
    figure.draw_without_rendering()
    figure.set_layout_engine("none")  # or the axes would tremble with the title's width

    with replacing(path) as partial:
        if path.suffix.lower() == ".gif":
            first, *others = _images(figure, frames, move, shades)
            first.save(
                partial,
                save_all=True,
                append_images=others,
                duration=round(1000 / fps),
                loop=0,
                optimize=True,
            )
        else:
            _mp4(figure, frames, move, partial, fps, dpi)
    return Movie(path)


def _images(
    figure: Figure, frames: Iterable[int], move: Callable[[Figure, int], None], shades: int
) -> Iterator[Image.Image]:
    from PIL import Image

    for frame in frames:
        move(figure, frame)
        figure.canvas.draw()
        pixels = np.asarray(figure.canvas.buffer_rgba())[..., :3]  # type: ignore[attr-defined]
        yield Image.fromarray(pixels).quantize(shades, dither=Image.Dither.NONE)


def _mp4(
    figure: Figure,
    frames: Iterable[int],
    move: Callable[[Figure, int], None],
    path: Path,
    fps: float,
    dpi: float,
) -> None:
    from matplotlib.animation import FFMpegWriter

    with matplotlib.rc_context({"animation.ffmpeg_path": ffmpeg()}):
        writer = FFMpegWriter(
            fps=fps,  # type: ignore[arg-type]
            codec="h264",
            extra_args=["-pix_fmt", "yuv420p"],
        )
        try:
            with writer.saving(figure, str(path), dpi):
                for frame in frames:
                    move(figure, frame)
                    writer.grab_frame()
        except (OSError, RuntimeError) as error:
            raise OutputError(f"cannot write {path}: {reason(error)}") from error
