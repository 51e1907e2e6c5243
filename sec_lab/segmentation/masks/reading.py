"""Masks of any tracker: which format it is, and what the file says."""

import os
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, Literal, cast, get_args

from sec_lab.files import UnusableFileError
from sec_lab.recording.json_files import read_json
from sec_lab.recording.numbering import list_files
from sec_lab.segmentation.masks.arrays import open_arrays
from sec_lab.segmentation.masks.coco import open_coco, open_youtube_vis
from sec_lab.segmentation.masks.label_png import header_of, open_label_pngs
from sec_lab.segmentation.masks.mots import open_mots
from sec_lab.segmentation.masks.object_png import object_folders, open_object_pngs
from sec_lab.segmentation.masks.objects import Mask, ObjectMasks, Overlap, check_overlap, flatten
from sec_lab.segmentation.masks.options import MaskOptions, with_path
from sec_lab.segmentation.masks.rgb_png import open_rgb_pngs
from sec_lab.segmentation.masks.sa_v import open_sa_v
from sec_lab.segmentation.record import Labels, Names, Segmentation, as_frames, as_label, as_names

Format = Literal[
    "palette PNG",
    "16-bit PNG",
    "MOTS PNG",
    "RGB PNG",
    "object PNG",
    "COCO",
    "YouTube-VIS",
    "SA-V",
    "MOTS",
    "NumPy",
]

_OBJECT_FORMATS = ("object PNG", "COCO", "YouTube-VIS", "SA-V", "MOTS")
_JSON_FORMATS = ("COCO", "YouTube-VIS", "SA-V")
_MOST_STRIDE = 1_000_000


def open_masks(
    path: str | os.PathLike[str],
    *,
    format: Format | None = None,  # noqa: A002 - the word for it, and never needed as the built-in function here
    background: int | None = 0,
    stride: int | None = None,
    frames: Sequence[int] | None = None,
    overlap: Overlap = "error",
    names: Names | None = None,
    size: tuple[int, int] | None = None,
    video: int | str | None = None,
) -> Segmentation:
    """Open the masks that a tracker wrote, instead of segmenting the movie (step 1, §2.2).

    =============  ========================================================================================
    format         what it is
    =============  ========================================================================================
    palette PNG    folder with a PNG a frame, 8 bits, palette or grey: DAVIS, SAM 2, XMem, Cutie
    16-bit PNG     folder with a grey PNG of 16 bits a frame, any ids
    MOTS PNG       the same with ids of class · 1000 + instance (never guessed: say so to get names)
    RGB PNG        folder with an RGB PNG a frame, id R + 256 G + 65536 B: COCO panoptic, long ids of Cutie
    object PNG     folder with a folder an object, in it a binary PNG a frame: SAM 2, SA-V validation and test
    COCO           JSON with images and annotations, run-length encoded or polygons
    YouTube-VIS    JSON with videos and annotations, or results
    SA-V           JSON of one movie with masklets
    MOTS           text, a line an object and frame
    NumPy          .npy or .npz, (n, height, width)
    =============  ========================================================================================

    The modules of :mod:`sec_lab.segmentation.masks` tell the rules of each. Nothing is decoded before it is asked for.

    Parameters
    ----------
    path : path-like
        File or folder.
    format : str, optional
        One of the above; told by the files themselves if left out.
    background : int, optional
        Label of the background: in label images the one that stands for it there, otherwise the one that is given to
        pixels of no object. None: label images have no background.
    stride : int, optional
        Masks are those of every ``stride``-th frame; in between none is missed. 1 if left out, or what the format says.
    frames : sequence of int, optional
        Frame numbers of the masks, instead of those that the files tell.
    overlap : {"error", "smaller on top", "first on top", "last on top"}, optional
        Whose pixel it is where masks of objects overlap, see :func:`flatten`.
    names : mapping of int to str or None, optional
        Names of objects by the ids of the file; None marks what is no object.
    size : tuple of int, optional
        (height, width) that the masks must have, as the pictures have it.
    video : int or str, optional
        Id or name of the movie, where a file is about several.

    Returns
    -------
    Segmentation
        Ids are kept as labels wherever that is possible.

    Raises
    ------
    UnusableFileError
        If the path does not exist, the format cannot be told, a file is malformed, damaged or hostile, masks are
        missing in the middle, or the size is another. What is found only while label images are read is raised there,
        with the frame.
    ValueError
        If an option is not allowed.

    Examples
    --------
    >>> open_masks("no/such/masks")
    Traceback (most recent call last):
    ...
    sec_lab.files.UnusableFileError: no/such/masks: expected masks, but there is no such file or folder
    """
    check_overlap(overlap)
    place = Path(path)
    chosen, document = _format(place, format)
    options = _options(chosen, background, stride, frames, names, size, video)
    if chosen in _OBJECT_FORMATS:
        segmentation = flatten(_open_objects(place, chosen, document, options), overlap=overlap)
    else:
        segmentation = _open_labels(place, chosen, options)
    return Segmentation(
        partial(_numbered, place, segmentation),
        segmentation.size,
        segmentation.frames,
        segmentation.background,
        segmentation.names,
    )


def open_objects(
    path: str | os.PathLike[str],
    *,
    format: Format | None = None,  # noqa: A002
    background: int = 0,
    stride: int | None = None,
    frames: Sequence[int] | None = None,
    names: Names | None = None,
    size: tuple[int, int] | None = None,
    video: int | str | None = None,
) -> ObjectMasks:
    """Open masks of single objects with their overlaps as they are; :func:`flatten` makes label images of them.

    Parameters
    ----------
    path : path-like
        File or folder of the format object PNG, COCO, YouTube-VIS, SA-V or MOTS.
    format, background, stride, frames, names, size, video
        See :func:`open_masks`.

    Returns
    -------
    ObjectMasks

    Raises
    ------
    UnusableFileError, ValueError
        As :func:`open_masks`, and if the format has no masks of single objects.

    Examples
    --------
    >>> open_objects("no/such/masks.json")
    Traceback (most recent call last):
    ...
    sec_lab.files.UnusableFileError: no/such/masks.json: expected masks, but there is no such file or folder
    """
    place = Path(path)
    chosen, document = _format(place, format)
    if chosen not in _OBJECT_FORMATS:
        raise ValueError(
            f"format: expected one of {_OBJECT_FORMATS}, which have masks of single objects, got {chosen!r}"
        )
    options = _options(chosen, background, stride, frames, names, size, video)
    objects = _open_objects(place, chosen, document, options)
    return replace(objects, read=partial(_named, place, objects))


def _open_objects(path: Path, chosen: Format, document: Any, options: MaskOptions) -> ObjectMasks:
    background = options.background
    if background is None:
        raise ValueError("background: expected a label for the pixels of no object, got None")
    try:
        if chosen == "object PNG":
            return open_object_pngs(path, options, background=background)
        if chosen == "MOTS":
            return open_mots(path, options, background=background)
        if chosen == "YouTube-VIS" and isinstance(document, dict | list):
            return open_youtube_vis(document, options, background=background)
        if not isinstance(document, dict):
            raise ValueError(f"expected masks ({chosen}), an object, got {type(document).__name__}")
        return (open_coco if chosen == "COCO" else open_sa_v)(document, options, background=background)
    except UnusableFileError:
        raise
    except ValueError as error:
        raise UnusableFileError(f"{path}: {error}") from error


def _open_labels(path: Path, chosen: Format, options: MaskOptions) -> Segmentation:
    try:
        if chosen == "NumPy":
            return open_arrays(path, options)
        if chosen == "RGB PNG":
            return open_rgb_pngs(path, options)
        assert chosen in ("palette PNG", "16-bit PNG", "MOTS PNG")
        return open_label_pngs(path, options, kind=chosen)
    except UnusableFileError:
        raise
    except ValueError as error:
        raise UnusableFileError(f"{path}: {error}") from error


def _format(path: Path, told: str | None) -> tuple[Format, Any]:
    """Format that is asked for, or that the file or folder looks like; and the document of a JSON file."""
    if told is not None and told not in get_args(Format):
        raise ValueError(f"format: expected one of {get_args(Format)}, got {told!r}")
    if not path.exists():
        raise UnusableFileError(f"{path}: expected masks, but there is no such file or folder")
    suffix = path.suffix.lower()
    if told in _JSON_FORMATS or (told is None and suffix == ".json" and not path.is_dir()):
        document = read_json(path, expected=f"masks ({told or 'JSON'})")
        return cast(Format, told) if told else _format_of_document(path, document), document
    if told is not None:
        return cast(Format, told), None
    if path.is_dir():
        return _format_of_folder(path), None
    if suffix == ".png":
        return _format_of_png(path), None
    if suffix == ".txt":
        return "MOTS", None
    if suffix in (".npy", ".npz"):
        return "NumPy", None
    raise UnusableFileError(
        f"{path}: expected masks: a folder of PNGs, or a file with the ending .json, .txt, .npy, .npz or .png"
    )


def _format_of_folder(path: Path) -> Format:
    if any(entry.suffix.lower() == ".png" for entry in path.iterdir()):
        return _format_of_png(list_files(path, {".png"}, expected="masks")[0])
    folders = object_folders(path)
    if folders and all(folder.name.isdecimal() for folder in folders):
        return "object PNG"
    if folders:
        raise UnusableFileError(
            f"{path}: expected masks, got folders that may be movies or objects: open one movie's folder, "
            "or say format='object PNG'"
        )
    raise UnusableFileError(f"{path}: expected masks, but the folder holds no PNG and no folder")


def _format_of_png(file: Path) -> Format:
    header = header_of(file)
    if header.colours in ("RGB", "RGBA"):
        return "RGB PNG"
    return "16-bit PNG" if header.bits == 16 else "palette PNG"


def _format_of_document(path: Path, document: Any) -> Format:
    if isinstance(document, list):
        return "YouTube-VIS"
    if isinstance(document, dict) and "masklet" in document:
        return "SA-V"
    if isinstance(document, dict) and "annotations" in document:
        return "COCO" if "images" in document else "YouTube-VIS"
    raise UnusableFileError(f"{path}: expected masks (COCO, YouTube-VIS or SA-V), but it looks like none of these")


def _options(
    chosen: Format,
    background: int | None,
    stride: int | None,
    frames: Sequence[int] | None,
    names: Names | None,
    size: tuple[int, int] | None,
    video: int | str | None,
) -> MaskOptions:
    if background is not None and chosen != "RGB PNG":
        background = as_label(background, what="background")
    if stride is not None and not 1 <= stride <= _MOST_STRIDE:
        raise ValueError(f"stride: expected a whole number from 1 to {_MOST_STRIDE}, got {stride!r}")
    if frames is not None:
        frames = as_frames(frames).tolist()
    if size is not None and len(size) != 2:
        raise ValueError(f"size: expected (height, width), got {size}")
    return MaskOptions(background, stride, frames, as_names(names), size, video)


def _numbered(path: Path, segmentation: Segmentation) -> Iterator[tuple[int, Labels]]:
    return with_path(path, segmentation.numbered())


def _named(path: Path, objects: ObjectMasks) -> Iterator[tuple[int, Sequence[tuple[int, Mask]]]]:
    return with_path(path, iter(objects))
