"""Single pictures from files: colour pictures, depth pictures and whatever else comes as PNG."""

import io
import os
import struct
import warnings
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageOps

from sec_lab.files import UnusableFileError, read_whole

MAX_PIXELS = 1 << 26
"""Most pixels of one picture (67 million): files of a few bytes may claim many more."""

PICTURE_SUFFIXES = frozenset({".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".webp", ".ppm", ".pgm"})
DEPTH_SUFFIXES = frozenset({".png", ".npy"})

_FORMATS = ("PNG", "JPEG", "BMP", "TIFF", "WEBP", "PPM")
_PNG_SIGNATURE = b"\x89PNG\r\n\x1a\n"
# What Pillow raises on damaged files, beside errors of the operating system.
_DAMAGE = (OSError, SyntaxError, ValueError, EOFError, KeyError, IndexError, struct.error, zlib.error, MemoryError)


@dataclass(frozen=True)
class PngHeader:
    """What the first chunk of a PNG says.

    Parameters
    ----------
    size : tuple of int
        (height, width) in pixels.
    bits : int
        Bits a channel: 1, 2, 4, 8 or 16.
    colours : {"grey", "palette", "RGB", "grey with alpha", "RGBA"}
    """

    size: tuple[int, int]
    bits: int
    colours: str


def png_header(content: bytes) -> PngHeader:
    """Header of a PNG, read without decoding anything.

    Raises
    ------
    ValueError
        If the bytes do not begin like a PNG, or the picture has no pixels or more than ``MAX_PIXELS``.

    Examples
    --------
    >>> png_header(b"GIF89a")
    Traceback (most recent call last):
    ...
    ValueError: expected a PNG, but it does not begin like one
    """
    if len(content) < 26 or not content.startswith(_PNG_SIGNATURE) or content[12:16] != b"IHDR":
        raise ValueError("expected a PNG, but it does not begin like one")
    width, height, bits, kind = struct.unpack(">IIBB", content[16:26])
    colours = {0: "grey", 2: "RGB", 3: "palette", 4: "grey with alpha", 6: "RGBA"}.get(kind)
    if colours is None:
        raise ValueError(f"expected a PNG, got one of unknown colour type {kind}")
    check_pixels((height, width))
    return PngHeader((height, width), bits, colours)


def check_png(content: bytes) -> None:
    """Refuse a PNG that is not whole or was damaged: decoders pass over much of that.

    Raises
    ------
    ValueError
        If a chunk's checksum is another, or the file ends before its last chunk does.

    Examples
    --------
    >>> check_png(_PNG_SIGNATURE + bytes(4) + b"IDAT")
    Traceback (most recent call last):
    ...
    ValueError: expected a whole PNG, but it ends early
    """
    position = len(_PNG_SIGNATURE)
    kind = b""
    while kind != b"IEND":
        end = position + 8 + int.from_bytes(content[position : position + 4], "big")
        kind = content[position + 4 : position + 8]
        if end + 4 > len(content):
            raise ValueError("expected a whole PNG, but it ends early")
        if zlib.crc32(memoryview(content)[position + 4 : end]) != int.from_bytes(content[end : end + 4], "big"):
            raise ValueError(f"expected a sound PNG, but the checksum of {kind.decode(errors='replace')!r} is another")
        position = end + 4


def check_pixels(size: tuple[int, int]) -> None:
    """Refuse a picture size that has no pixels, or more than ``MAX_PIXELS``.

    Raises
    ------
    ValueError
        If it is so.

    Examples
    --------
    >>> check_pixels((100_000, 100_000))
    Traceback (most recent call last):
    ...
    ValueError: expected 1 to 67108864 pixels, got 100000×100000
    """
    height, width = size
    if height < 1 or width < 1 or height * width > MAX_PIXELS:
        raise ValueError(f"expected 1 to {MAX_PIXELS} pixels, got {height}×{width}")


def read_png(path: str | os.PathLike[str], *, expected: str) -> tuple[PngHeader, NDArray[Any]]:
    """Values of a PNG as they stand in the file: palette indices stay indices, 16 bits stay 16 bits.

    Parameters
    ----------
    path : path-like
        The file.
    expected : str
        What the caller needs, for the error message.

    Returns
    -------
    header : PngHeader
    values : (height, width) or (height, width, channels) ndarray of uint8 or uint16

    Raises
    ------
    UnusableFileError
        If it is no PNG, is damaged, has more than ``MAX_PIXELS`` pixels, or colours of 16 bits a channel, which Pillow
        would round to 8.

    Examples
    --------
    >>> read_png("no/such/mask.png", expected="a mask")
    Traceback (most recent call last):
    ...
    sec_lab.files.UnusableFileError: no/such/mask.png: expected a mask, but there is no such file
    """
    content = read_whole(path, expected=expected)
    try:
        header = png_header(content)
        check_png(content)
    except ValueError as error:
        raise UnusableFileError(f"{path}: expected {expected}: {error}") from error
    if header.bits == 16 and header.colours != "grey":
        raise UnusableFileError(f"{path}: expected {expected}, got {header.colours} of 16 bits a channel")
    try:
        with Image.open(io.BytesIO(content), formats=("PNG",)) as picture:
            values = np.asarray(picture)
    except _DAMAGE as error:
        raise _damaged(path, expected, error) from error
    if values.dtype == np.bool_:
        values = values.astype(np.uint8)
    elif header.colours == "grey" and header.bits < 8:
        # Pillow stretches 2 and 4 bits of grey to the full range.
        values = values // (255 // ((1 << header.bits) - 1))
    return header, values


def read_picture(path: str | os.PathLike[str]) -> NDArray[np.uint8]:
    """Read a colour or grey picture the way up in which it is meant to be seen.

    Parameters
    ----------
    path : path-like
        PNG, JPEG, BMP, TIFF, WebP or PPM of 8 bits a channel.

    Returns
    -------
    (height, width, 3) ndarray of uint8
        RGB.

    Raises
    ------
    UnusableFileError
        If it is no such picture, is damaged, holds several pictures, is partly transparent, has more than 8 bits a
        channel, or more than ``MAX_PIXELS`` pixels.

    Examples
    --------
    >>> read_picture("no/such/picture.png")
    Traceback (most recent call last):
    ...
    sec_lab.files.UnusableFileError: no/such/picture.png: expected a picture, but there is no such file
    """
    content = read_whole(path, expected="a picture")
    try:
        if content.startswith(_PNG_SIGNATURE):
            check_png(content)
            if png_header(content).bits > 8:
                # Pillow would round colours to 8 bits without a word.
                raise ValueError("it has 16 bits a channel, not 8")
        with warnings.catch_warnings():
            # Beyond the limit of Pillow comes an error anyway, and below it our own limit decides.
            warnings.simplefilter("error", Image.DecompressionBombWarning)
            with Image.open(io.BytesIO(content), formats=_FORMATS) as picture:
                return _as_rgb(picture)
    except (*_DAMAGE, Image.DecompressionBombError, Image.DecompressionBombWarning) as error:
        raise _damaged(path, "a picture", error) from error


def read_depth(path: str | os.PathLike[str], *, unit_m: float) -> NDArray[np.float32]:
    """Depth of every pixel.

    Parameters
    ----------
    path : path-like
        Grey PNG of 16 bits, or ``.npy``.
    unit_m : float
        Metres that one step of whole numbers stands for; floating-point numbers are metres already.

    Returns
    -------
    (height, width) ndarray of float32
        Metres; 0 where nothing was measured, as depth cameras write it.

    Raises
    ------
    UnusableFileError
        If it is no such file, is damaged, or is no picture.

    Examples
    --------
    >>> read_depth("no/such/depth.png", unit_m=0.001)
    Traceback (most recent call last):
    ...
    sec_lab.files.UnusableFileError: no/such/depth.png: expected a depth picture, but there is no such file
    """
    if Path(path).suffix.lower() == ".npy":
        values: NDArray[Any] = map_array(path, expected="a depth picture")
    else:
        header, values = read_png(path, expected="a depth picture")
        if header.bits != 16:
            raise UnusableFileError(
                f"{path}: expected a depth picture of 16 bits, got {header.colours} of {header.bits} bits"
            )
    if values.ndim != 2:
        raise UnusableFileError(f"{path}: expected a depth picture of shape (height, width), got {values.shape}")
    return depth_in_metres(values, unit_m=unit_m)


def depth_in_metres(values: NDArray[Any], *, unit_m: float) -> NDArray[np.float32]:
    """Depth as float32 metres: whole numbers are multiplied by the unit, floating-point numbers are metres.

    Raises
    ------
    ValueError
        If the values are not numbers.

    Examples
    --------
    >>> depth_in_metres(np.array([[1500]], dtype=np.uint16), unit_m=0.001)
    array([[1.5]], dtype=float32)
    """
    if values.dtype.kind not in "uif":
        raise ValueError(f"depth: expected numbers, got values of type {values.dtype}")
    if values.dtype.kind == "f":
        return values.astype(np.float32)
    return (values * np.float64(unit_m)).astype(np.float32)


def map_array(path: str | os.PathLike[str], *, expected: str) -> NDArray[Any]:
    """Array of a ``.npy`` file, left on the disk until it is used.

    Raises
    ------
    UnusableFileError
        If there is no such file, or it is damaged or holds Python objects.

    Examples
    --------
    >>> map_array("no/such/array.npy", expected="masks")
    Traceback (most recent call last):
    ...
    sec_lab.files.UnusableFileError: no/such/array.npy: expected masks, but there is no such file
    """
    try:
        array: NDArray[Any] = np.lib.format.open_memmap(Path(path), mode="r")
    except FileNotFoundError as error:
        raise UnusableFileError(f"{path}: expected {expected}, but there is no such file") from error
    except (OSError, ValueError, SyntaxError, EOFError, TypeError, OverflowError) as error:
        raise UnusableFileError(f"{path}: expected {expected} (.npy), but it cannot be read ({error})") from error
    return array


def _as_rgb(picture: Image.Image) -> NDArray[np.uint8]:
    check_pixels((picture.height, picture.width))
    n_pictures = getattr(picture, "n_frames", 1)
    if n_pictures != 1:
        raise ValueError(f"got {n_pictures} pictures in one file")
    if picture.mode not in ("1", "L", "P", "RGB", "CMYK", "YCbCr", "LA", "PA", "RGBA"):
        raise ValueError(f"got values of kind {picture.mode}, not of 8 bits a channel")
    upright = ImageOps.exif_transpose(picture)
    if upright.has_transparency_data:
        upright = upright.convert("RGBA")
        least, _ = upright.getchannel("A").getextrema()
        if least != 255:
            raise ValueError("it is partly transparent")
    return np.asarray(upright.convert("RGB"))


def _damaged(path: str | os.PathLike[str], expected: str, error: BaseException) -> UnusableFileError:
    reason = " ".join(str(error).split()) or type(error).__name__
    if "cannot identify image file" in reason:
        reason = "it is no picture of a known kind"
    return UnusableFileError(f"{path}: expected {expected}, but it cannot be decoded ({reason})")
