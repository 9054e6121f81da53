"""Writes a simulated drive as picture files with a table of positions, whole or not at all."""

import tempfile
from pathlib import Path

from retraverse.datasets.simulated.drive import SimulatedDrive
from retraverse.errors import ConfigError, InputError
from retraverse.types import Progress, no_progress

__all__ = ["write_drive"]


def write_drive(
    drive: SimulatedDrive, folder: str | Path, *, quality: int = 95,
    progress: Progress = no_progress,
) -> Path:  # fmt: skip
    """Write a drive as JPEG files and a table of positions.

    Writes ``0000.jpg``, ``0001.jpg``, ... (more digits where needed) and ``positions.csv`` with
    the columns ``frame,name,position_m,on_route``; the position is empty off the route. All is
    written beside the folder first and moved there when complete: a failure or an interrupt
    leaves no part of a drive.

    Parameters
    ----------
    drive : SimulatedDrive
    folder : str or Path
        Made if absent, with the folders above it; must be empty.
    quality : int in [1, 100]
        JPEG quality, as Pillow counts it.
    progress : Progress, optional

    Returns
    -------
    folder : Path

    Raises
    ------
    ConfigError
        `quality` is out of range.
    InputError
        The folder holds something already, or is a file.
    OSError
        A file cannot be written: no space, no permission.
    """
    if isinstance(quality, bool) or not isinstance(quality, int) or not 1 <= quality <= 100:
        raise ConfigError(f"JPEG quality is {quality!r}; expected an integer from 1 to 100")
    target = Path(folder)
    folder = target.resolve()
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise InputError(f"{target} is not an empty folder; expected one to write frames to")
    folder.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix=f".{folder.name}-", dir=folder.parent) as beside:
        part = Path(beside) / "drive"
        part.mkdir()
        _write_files(drive, part, quality, progress)
        if folder.exists():
            folder.rmdir()  # fails if somebody put something there meanwhile
        part.rename(folder)
    return target


def _write_files(drive: SimulatedDrive, folder: Path, quality: int, progress: Progress) -> None:
    """Write pictures and table into an existing folder."""
    from PIL import Image

    digits = max(4, len(str(len(drive) - 1)))
    names = [f"{i:0{digits}d}.jpg" for i in range(len(drive))]
    pictures = progress(drive, total=len(drive), label="rendering frames")
    for name, picture in zip(names, pictures, strict=True):
        Image.fromarray(picture).save(folder / name, quality=quality)
    rows = ["frame,name,position_m,on_route"]
    places = zip(names, drive.positions_m, drive.on_route, strict=True)
    for i, (name, position, on_route) in enumerate(places):
        rows.append(_row(i, name, float(position), bool(on_route)))
    (folder / "positions.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")


def _row(frame: int, name: str, position: float, on_route: bool) -> str:
    shown = f"{position:.3f}" if on_route else ""
    return f"{frame},{name},{shown},{str(on_route).lower()}"
