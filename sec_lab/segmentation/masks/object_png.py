"""Binary PNGs, one an object and frame, in one folder an object: ``video/object_id/frame.png``.

So SA-V's validation and test sets, and SAM 2 when it writes objects one by one. Whatever is not 0 is the object. An
object that has no file for a frame for which others have one is absent there. SA-V annotates every fourth frame:
``stride=4``.
"""

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path

from sec_lab.files import UnusableFileError
from sec_lab.recording.numbering import frame_numbers, list_files, natural_key
from sec_lab.segmentation.masks.label_png import check_kind, header_of, read_mask
from sec_lab.segmentation.masks.objects import Mask, ObjectMasks
from sec_lab.segmentation.masks.options import (
    MaskOptions,
    check_size,
    labels_of_ids,
    names_of_labels,
    number_frames,
)


def open_object_pngs(path: Path, options: MaskOptions, *, background: int) -> ObjectMasks:
    """Masks of single objects, each in a folder of its own.

    Parameters
    ----------
    path : path-like
        Folder of the folders. If all of their names are numbers, these are the ids; objects are numbered from 1 on in
        natural order otherwise, and called by the names of the folders.
    options : MaskOptions
    background : int
        Label of pixels that belong to no object.

    Returns
    -------
    ObjectMasks

    Raises
    ------
    UnusableFileError
        If there is no such folder, or no PNGs in folders in it.
    ValueError
        If frame numbers cannot be told or are missing in the middle, or the masks are of another size than asked for.

    Examples
    --------
    >>> open_object_pngs(Path("no/such/folder"), MaskOptions(), background=0)
    Traceback (most recent call last):
    ...
    sec_lab.files.UnusableFileError: no/such/folder: expected folders of masks, one an object, got none
    """
    folders = object_folders(path)
    if not folders:
        raise UnusableFileError(f"{path}: expected folders of masks, one an object, got none")
    ids = ids_of_folders(folders)
    labels = labels_of_ids(ids, background=background)
    files = {
        number: list_files(folder, {".png"}, expected="masks") for number, folder in zip(ids, folders, strict=True)
    }
    numbers = _numbers_of_names({file.name for found in files.values() for file in found})
    masks: dict[int, list[tuple[int, Path]]] = {number: [] for number in sorted(numbers.values())}
    for number, found in files.items():
        for file in found:
            masks[numbers[file.name]].append((labels[number], file))
    frames = number_frames(list(masks), len(masks), options=options)
    first = files[ids[0]][0]
    header = header_of(first)
    check_kind(first, header, "palette PNG")
    check_size(header.size, options)
    told = {} if _are_numbers(folders) else {number: folder.name for number, folder in zip(ids, folders, strict=True)}
    return ObjectMasks(
        partial(_read, frames.tolist(), list(masks.values()), header.size),
        header.size,
        frames,
        background,
        names_of_labels(labels, told=told, options=options, background=background),
    )


def object_folders(path: Path) -> list[Path]:
    """Folders in a folder in natural order, without hidden ones; none if it is no folder.

    Examples
    --------
    >>> object_folders(Path("no/such/folder"))
    []
    """
    if not path.is_dir():
        return []
    found = (folder for folder in path.iterdir() if folder.is_dir() and not folder.name.startswith("."))
    return sorted(found, key=lambda folder: natural_key(folder.name))


def ids_of_folders(folders: Sequence[Path]) -> list[int]:
    """Ids of objects by the names of their folders: their numbers, or 1, 2, 3, … if they are no numbers.

    Raises
    ------
    ValueError
        If two folders have the same number.

    Examples
    --------
    >>> ids_of_folders([Path("masks/000"), Path("masks/007")]), ids_of_folders([Path("masks/cup"), Path("masks/hand")])
    ([0, 7], [1, 2])
    """
    if not _are_numbers(folders):
        return list(range(1, len(folders) + 1))
    ids = [int(folder.name) for folder in folders]
    for number in ids:
        if ids.count(number) > 1:
            raise ValueError(f"objects: expected one folder an object, got two with the number {number}")
    return ids


def _are_numbers(folders: Sequence[Path]) -> bool:
    return all(folder.name.isdecimal() for folder in folders)


def _numbers_of_names(names: set[str]) -> Mapping[str, int]:
    ordered = sorted(names, key=natural_key)
    numbers = frame_numbers(ordered)
    if numbers is None:
        raise ValueError("file names: expected names that differ in one number, the frame number")
    return dict(zip(ordered, numbers, strict=True))


def _read(
    frames: Sequence[int], masks: Sequence[Sequence[tuple[int, Path]]], size: tuple[int, int]
) -> Iterator[tuple[int, list[tuple[int, Mask]]]]:
    for number, of_frame in zip(frames, masks, strict=True):
        yield number, [(label, _read_mask(file, size)) for label, file in of_frame]


def _read_mask(file: Path, size: tuple[int, int]) -> Mask:
    values = read_mask(file, "palette PNG", size)
    mask: Mask = values != 0
    most = values.max()
    if (mask & (values != most)).any():
        raise UnusableFileError(f"{file}: expected the mask of one object, 0 and one other value, got several")
    return mask
