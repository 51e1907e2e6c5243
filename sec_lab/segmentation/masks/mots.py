"""MOTS text files: one line an object and frame, ``frame id class height width rle``.

An id is class · 1000 + instance and stays with its object; class 1 is a car, class 2 a pedestrian; id 10000 is a
region to be ignored (a segment without a name, that is: no object). The mask is COCO's compressed run-length
encoding. A frame without objects has no line, so the file does not tell how long the movie is: without ``frames`` it
is taken to reach from the first frame that is mentioned to the last.
"""

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path

from sec_lab.files import read_whole
from sec_lab.recording.pictures import check_pixels
from sec_lab.segmentation.masks.objects import Mask, ObjectMasks
from sec_lab.segmentation.masks.options import (
    MaskOptions,
    check_size,
    labels_of_ids,
    names_of_labels,
    number_frames,
)
from sec_lab.segmentation.masks.rle import decode_runs

_CLASSES = {1: "car", 2: "pedestrian"}
_IGNORED = 10_000

Line = tuple[int, str]
"""Label and encoded mask."""


def open_mots(path: Path, options: MaskOptions, *, background: int) -> ObjectMasks:
    """Masks of a MOTS text file.

    Parameters
    ----------
    path : path-like
    options : MaskOptions
        ``frames``: the frames that the file is about, those without objects included.
    background : int
        Label of pixels that belong to no object.

    Returns
    -------
    ObjectMasks

    Raises
    ------
    UnusableFileError
        If there is no such file.
    ValueError
        If a line is malformed, sizes differ, or an object is mentioned twice in a frame, or out of the given frames.

    Examples
    --------
    >>> open_mots(Path("no/such/0002.txt"), MaskOptions(), background=0)
    Traceback (most recent call last):
    ...
    sec_lab.files.UnusableFileError: no/such/0002.txt: expected masks (MOTS), but there is no such file
    """
    text = read_whole(path, expected="masks (MOTS)").decode(errors="replace")
    classes: dict[int, int] = {}
    masks: dict[int, dict[int, str]] = {}
    size: tuple[int, int] | None = None
    for place, line in enumerate(text.splitlines(), start=1):
        if not line.strip():
            continue
        frame, number, class_id, height, width, encoded = _fields(line, place)
        if size is None:
            size = height, width
            check_pixels(size)
            check_size(size, options)
        if (height, width) != size:
            raise ValueError(f"line {place}: expected a mask of {size[0]}×{size[1]} as before, got {height}×{width}")
        if classes.setdefault(number, class_id) != class_id:
            raise ValueError(f"line {place}: expected object {number} in class {classes[number]}, got class {class_id}")
        if number in masks.setdefault(frame, {}):
            raise ValueError(f"line {place}: expected object {number} once in frame {frame}, got it again")
        masks[frame][number] = encoded
    if size is None:
        raise ValueError("expected at least one line, got none")
    return _objects(masks, classes, size, options, background)


def _objects(
    masks: Mapping[int, Mapping[int, str]],
    classes: Mapping[int, int],
    size: tuple[int, int],
    options: MaskOptions,
    background: int,
) -> ObjectMasks:
    labels = labels_of_ids(sorted(classes), background=background)
    mentioned = range(min(masks), max(masks) + 1, options.stride or 1)
    frames = number_frames(mentioned, len(options.frames or mentioned), options=options)
    odd = set(masks) - set(frames.tolist())
    if odd:
        raise ValueError(
            f"expected masks for the frames {frames[0]} to {frames[-1]} only, got one for frame {min(odd)}"
        )
    told = {number: name_of_id(number, class_id=class_id) for number, class_id in classes.items()}
    lines = [[(labels[number], text) for number, text in masks.get(frame, {}).items()] for frame in frames.tolist()]
    return ObjectMasks(
        partial(_read, frames.tolist(), lines, size),
        size,
        frames,
        background,
        names_of_labels(labels, told=told, options=options, background=background),
    )


def name_of_id(number: int, *, class_id: int) -> str | None:
    """Name of a MOTS object, e.g. of id 1005 in class 1; None for regions to be ignored.

    Examples
    --------
    >>> name_of_id(1005, class_id=1), name_of_id(3001, class_id=3), name_of_id(10_000, class_id=10)
    ('car 5', 'class 3, 1', None)
    """
    if number == _IGNORED:
        return None
    name = _CLASSES.get(class_id)
    return f"class {class_id}, {number % 1000}" if name is None else f"{name} {number % 1000}"


def _fields(line: str, place: int) -> tuple[int, int, int, int, int, str]:
    words = line.split()
    if len(words) != 6 or not all(word.isascii() and word.isdecimal() and len(word) < 10 for word in words[:5]):
        raise ValueError(f"line {place}: expected 'frame id class height width rle', got {line[:60]!r}")
    frame, number, class_id, height, width = (int(word) for word in words[:5])
    return frame, number, class_id, height, width, words[5]


def _read(
    frames: Sequence[int], lines: Sequence[Sequence[Line]], size: tuple[int, int]
) -> Iterator[tuple[int, list[tuple[int, Mask]]]]:
    for frame, of_frame in zip(frames, lines, strict=True):
        masks = []
        for label, encoded in of_frame:
            try:
                masks.append((label, decode_runs(encoded, size)))
            except ValueError as error:
                raise ValueError(f"frame {frame}: object {label}: {error}") from error
        yield frame, masks
