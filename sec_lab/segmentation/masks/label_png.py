"""Label images as PNG, one a frame: palette or grey of 8 bits, and grey of 16 bits.

- DAVIS, and SAM 2, XMem and Cutie when they write one picture a frame: 8 bits with a palette; the index is the
  object, 0 the background. The colours mean nothing. DAVIS 2016 uses grey with 255 for its one object; in other years
  255 marks pixels that are left out of the evaluation: say ``names={255: None}`` to have them taken for a segment
  that is no object.
- Grey of 16 bits: any ids up to 65,535. In MOTS an id is class · 1000 + instance, 0 is the background and 10000 a
  region to be ignored (a segment without a name, that is: no object).
"""

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from sec_lab.files import UnusableFileError
from sec_lab.recording.numbering import frame_numbers, list_files
from sec_lab.recording.pictures import PngHeader, png_header, read_png
from sec_lab.segmentation.masks.mots import name_of_id
from sec_lab.segmentation.masks.options import MaskOptions, check_size, number_frames
from sec_lab.segmentation.record import FoundNames, Names, Segmentation

Kind = Literal["palette PNG", "16-bit PNG", "MOTS PNG", "RGB PNG"]

_EXPECTED = {
    "palette PNG": "a mask of 8 bits, palette or grey",
    "16-bit PNG": "a mask of 16 bits, grey",
    "MOTS PNG": "a mask of 16 bits, grey",
    "RGB PNG": "a mask of RGB colours",
}


def open_label_pngs(path: Path, options: MaskOptions, *, kind: Kind) -> Segmentation:
    """Label images in a folder of PNGs, or in a single one.

    Parameters
    ----------
    path : path-like
    options : MaskOptions
    kind : {"palette PNG", "16-bit PNG", "MOTS PNG"}

    Returns
    -------
    Segmentation

    Raises
    ------
    UnusableFileError
        If there is no such folder, it has no PNG, or the first is of another kind.
    ValueError
        If masks are missing in the middle or of another size than asked for.

    Examples
    --------
    >>> open_label_pngs(Path("no/such/folder"), MaskOptions(), kind="palette PNG")
    Traceback (most recent call last):
    ...
    sec_lab.files.UnusableFileError: no/such/folder: expected a folder of masks, but there is no such folder
    """
    files, frames, size = numbered_pngs(path, options, kind)
    read = partial(_read, files, frames.tolist(), kind, size)
    names = options.names
    if kind == "MOTS PNG":
        names = FoundNames(partial(_mots_names, read, options.names, options.background))
    return Segmentation(read, size, frames, options.background, names)


def numbered_pngs(
    path: Path, options: MaskOptions, kind: Kind
) -> tuple[list[Path], NDArray[np.int64], tuple[int, int]]:
    """Files of masks with their frame numbers, and the size of the first."""
    files = [path] if path.is_file() else list_files(path, {".png"}, expected="masks")
    frames = number_frames(frame_numbers([file.name for file in files]), len(files), options=options)
    header = header_of(files[0])
    check_kind(files[0], header, kind)
    check_size(header.size, options)
    return files, frames, header.size


def header_of(file: Path) -> PngHeader:
    """Header of a PNG file.

    Raises
    ------
    UnusableFileError
        If it cannot be read or is no PNG.

    Examples
    --------
    >>> header_of(Path("no/such/mask.png"))
    Traceback (most recent call last):
    ...
    sec_lab.files.UnusableFileError: no/such/mask.png: expected a mask, but it cannot be read (No such file or ...)
    """
    try:
        with file.open("rb") as stream:
            return png_header(stream.read(64))
    except OSError as error:
        raise UnusableFileError(f"{file}: expected a mask, but it cannot be read ({error.strerror})") from error
    except ValueError as error:
        raise UnusableFileError(f"{file}: expected a mask: {error}") from error


def check_kind(file: Path, header: PngHeader, kind: Kind) -> None:
    """Refuse a PNG of another kind.

    Raises
    ------
    UnusableFileError
        If it is so.

    Examples
    --------
    >>> check_kind(Path("1.png"), PngHeader((4, 5), 8, "RGB"), "palette PNG")
    Traceback (most recent call last):
    ...
    sec_lab.files.UnusableFileError: 1.png: expected a mask of 8 bits, palette or grey, got RGB of 8 bits
    """
    fits = {
        "palette PNG": header.bits <= 8 and header.colours in ("palette", "grey"),
        "16-bit PNG": header.bits == 16 and header.colours == "grey",
        "MOTS PNG": header.bits == 16 and header.colours == "grey",
        "RGB PNG": header.bits == 8 and header.colours in ("RGB", "RGBA"),
    }
    if not fits[kind]:
        raise UnusableFileError(f"{file}: expected {_EXPECTED[kind]}, got {header.colours} of {header.bits} bits")


def read_mask(file: Path, kind: Kind, size: tuple[int, int]) -> NDArray[Any]:
    """Values of a mask of a known kind and size.

    Raises
    ------
    UnusableFileError
        If it is of another kind or size, or damaged.

    Examples
    --------
    >>> read_mask(Path("no/such/1.png"), "palette PNG", (4, 5))
    Traceback (most recent call last):
    ...
    sec_lab.files.UnusableFileError: no/such/1.png: expected a mask of 8 bits, palette or grey, but there is no such ...
    """
    header, values = read_png(file, expected=_EXPECTED[kind])
    check_kind(file, header, kind)
    if header.size != size:
        raise UnusableFileError(
            f"{file}: expected a mask of {size[0]}×{size[1]} as before, got {header.size[0]}×{header.size[1]}"
        )
    return values


def _read(
    files: Sequence[Path], frames: Sequence[int], kind: Kind, size: tuple[int, int]
) -> Iterator[tuple[int, NDArray[Any]]]:
    for number, file in zip(frames, files, strict=True):
        yield number, read_mask(file, kind, size)


def _mots_names(
    read: Callable[[], Iterator[tuple[int, NDArray[Any]]]], given: Names | None, background: int | None
) -> Names:
    ids: set[int] = set()
    for _, image in read():
        ids.update(np.flatnonzero(np.bincount(image.ravel())).tolist())
    names = {number: name_of_id(number, class_id=number // 1000) for number in sorted(ids) if number != background}
    return {**({} if background is None else {background: "background"}), **names, **(given or {})}
