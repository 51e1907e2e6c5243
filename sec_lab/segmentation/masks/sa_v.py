"""SA-V's JSON of one movie: ``masklet``, a list over frames of lists over objects of run-length encodings.

The movie's size and number of frames stand in ``video_height``, ``video_width`` and ``video_frame_count``, the ids in
``masklet_id``; manual and automatic masklets come in two files. Movies have 24 frames a second and masks 6, so the
masks are those of every fourth frame. Objects are counted from 0 on; where 0 occurs, labels are ids + 1, as in SAM 2's
own loader. Objects may overlap: a hand and the person it belongs to.
"""

from collections.abc import Iterator, Sequence
from functools import partial
from typing import Any

from sec_lab.segmentation.masks.json_fields import size_of, whole_number
from sec_lab.segmentation.masks.objects import Mask, ObjectMasks
from sec_lab.segmentation.masks.options import (
    MaskOptions,
    check_size,
    labels_of_ids,
    names_of_labels,
    number_frames,
)
from sec_lab.segmentation.masks.rle import decode

_STRIDE = 4


def open_sa_v(document: Any, options: MaskOptions, *, background: int) -> ObjectMasks:
    """Masks of an SA-V document.

    Parameters
    ----------
    document : dict
    options : MaskOptions
        ``stride`` is 4 if left out.
    background : int
        Label of pixels that belong to no object.

    Returns
    -------
    ObjectMasks

    Raises
    ------
    ValueError
        If a field is missing or malformed, a frame has more or fewer objects than others, or there are masks for more
        frames than the movie has.

    Examples
    --------
    >>> frame = [{"size": [1, 2], "counts": [1, 1]}]
    >>> document = {"masklet": [frame, frame], "masklet_id": [0], "video_height": 1.0, "video_width": 2.0}
    >>> objects = open_sa_v(document, MaskOptions(), background=0)
    >>> objects.frames, [label for label, _ in next(iter(objects))[1]]
    (array([0, 4]), [1])
    """
    frames_of_masks = document.get("masklet")
    if not isinstance(frames_of_masks, list) or not frames_of_masks:
        raise ValueError("masklet: expected a list of frames, at least one")
    size = size_of(document, "video", prefix="video_")
    check_size(size, options)
    ids = _ids(document, frames_of_masks[0])
    for place, of_frame in enumerate(frames_of_masks):
        if not isinstance(of_frame, list) or len(of_frame) != len(ids):
            got = len(of_frame) if isinstance(of_frame, list) else type(of_frame).__name__
            raise ValueError(f"masklet[{place}]: expected masks of {len(ids)} objects, got {got}")
    frames = number_frames(None, len(frames_of_masks), options=options, default_stride=_STRIDE)
    if "video_frame_count" in document:
        n_frames = whole_number(document, "video_frame_count", "video")
        if frames[-1] >= n_frames:
            raise ValueError(f"masklet: expected masks of {n_frames} frames, got one of frame {frames[-1]}")
    labels = labels_of_ids(ids, background=background)
    return ObjectMasks(
        partial(_read, frames.tolist(), frames_of_masks, list(labels.values()), size),
        size,
        frames,
        background,
        names_of_labels(labels, told={}, options=options, background=background),
    )


def _ids(document: dict[str, Any], first: Any) -> list[int]:
    if not isinstance(first, list):
        raise ValueError(f"masklet[0]: expected a list of masks, got {type(first).__name__}")
    ids = document.get("masklet_id", list(range(len(first))))
    if not isinstance(ids, list):
        raise ValueError(f"masklet_id: expected a list of ids, got {type(ids).__name__}")
    numbers = [whole_number({"id": number}, "id", "masklet") for number in ids]
    if len(set(numbers)) != len(numbers):
        raise ValueError("masklet_id: expected each id once, got one twice")
    return numbers


def _read(
    frames: Sequence[int], frames_of_masks: Sequence[Sequence[Any]], labels: Sequence[int], size: tuple[int, int]
) -> Iterator[tuple[int, list[tuple[int, Mask]]]]:
    for frame, of_frame in zip(frames, frames_of_masks, strict=True):
        masks = []
        for label, encoded in zip(labels, of_frame, strict=True):
            if encoded is None:
                continue
            try:
                masks.append((label, decode(encoded, size)))
            except ValueError as error:
                raise ValueError(f"frame {frame}: object {label}: {error}") from error
        yield frame, masks
