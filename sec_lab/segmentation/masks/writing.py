"""Label images written for other tools: a palette PNG a frame, as DAVIS has them."""

import os
import secrets
import shutil
from collections.abc import Iterable
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike
from PIL import Image

from sec_lab.files import UnusableFileError
from sec_lab.segmentation.record import Segmentation


def write_palette_pngs(folder: str | os.PathLike[str], segmentation: Segmentation | Iterable[ArrayLike]) -> None:
    """Write label images as DAVIS has them: ``00000.png``, … of 8 bits with a palette, in a folder of their own.

    The folder appears with all of its files or not at all.

    Parameters
    ----------
    folder : path-like
        Must not exist yet; the folder that it goes to must.
    segmentation : Segmentation or iterable of (height, width) array_like of int
        Files carry its frame numbers; without any they are counted from 0 on.

    Raises
    ------
    ValueError
        If there is no label image, or a label above 255.
    UnusableFileError
        If the folder exists, or cannot be written.

    Examples
    --------
    >>> write_palette_pngs("no/such/folder/masks", Segmentation.from_labels([[[0, 1]]]))
    Traceback (most recent call last):
    ...
    sec_lab.files.UnusableFileError: no/such/folder/masks: cannot be written, there is no folder no/such/folder
    """
    target = Path(folder)
    if not target.parent.is_dir():
        raise UnusableFileError(f"{target}: cannot be written, there is no folder {target.parent}")
    if target.exists():
        raise UnusableFileError(f"{target}: cannot be written, it exists already")
    neighbour = target.with_name(f".{target.name[:50]}.{secrets.token_hex(4)}")
    images = segmentation.numbered() if isinstance(segmentation, Segmentation) else enumerate(segmentation)
    palette = davis_palette()
    try:
        neighbour.mkdir()
        number = None
        for number, values in images:
            labels = np.asarray(values)
            if labels.max() > 255 or labels.min() < 0:
                raise ValueError(f"frame {number}: expected labels from 0 to 255, got {labels.max()}")
            picture = Image.fromarray(labels.astype(np.uint8))
            picture.putpalette(palette)
            picture.save(neighbour / f"{number:05d}.png")
        if number is None:
            raise ValueError("segmentation: expected at least one label image, got none")
        neighbour.rename(target)
    except UnusableFileError:
        raise
    except OSError as error:
        raise UnusableFileError(f"{target}: cannot be written ({error.strerror or error})") from error
    finally:
        shutil.rmtree(neighbour, ignore_errors=True)


def davis_palette() -> bytes:
    """Colours of DAVIS and PASCAL VOC: the bits of a label, three at a time, become high bits of red, green and blue.

    Returns
    -------
    bytes
        256 times red, green and blue.

    Examples
    --------
    >>> list(davis_palette()[:12])
    [0, 0, 0, 128, 0, 0, 0, 128, 0, 128, 128, 0]
    """
    labels = np.arange(256)
    colours = np.zeros((256, 3), dtype=np.uint8)
    for place in range(8):
        for channel in range(3):
            colours[:, channel] |= ((labels >> (3 * place + channel) & 1) << (7 - place)).astype(np.uint8)
    return colours.tobytes()
