"""COCO's JSON for movies: YouTube-VIS (one annotation an object) and COCO itself (one an object and picture).

YouTube-VIS: ``videos`` with ``id``, ``width``, ``height``, ``length`` and ``file_names``; ``annotations`` with
``id``, ``video_id``, ``category_id`` and ``segmentations``, a list with one entry a frame: a run-length encoding, a
list of polygons, or null where the object is absent; ``categories`` with ``id`` and ``name``. Results of a tracker
are a bare list of such annotations with a ``score`` and without ids.

COCO: ``images`` with ``id``, ``width``, ``height``, ``file_name`` and in movies ``frame_id`` or ``frame_index`` and
``video_id``; ``annotations`` with ``image_id``, ``category_id``, ``segmentation``, and ``track_id`` or
``instance_id`` (as TAO, CocoVID and others call what stays with an object).
"""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import Any

from sec_lab.recording.numbering import frame_numbers
from sec_lab.segmentation.masks.json_fields import as_records, records, size_of, whole_number
from sec_lab.segmentation.masks.objects import Mask, ObjectMasks
from sec_lab.segmentation.masks.options import (
    MaskOptions,
    check_size,
    labels_of_ids,
    names_of_labels,
    number_frames,
)
from sec_lab.segmentation.masks.polygons import polygon_mask
from sec_lab.segmentation.masks.rle import decode
from sec_lab.segmentation.record import as_frames

_FRAME_KEYS = ("frame_id", "frame_index")
_TRACK_KEYS = ("track_id", "instance_id")

Encoded = tuple[int, Any]
"""Label and encoded mask."""


def open_youtube_vis(document: Any, options: MaskOptions, *, background: int) -> ObjectMasks:
    """Masks of one movie of a YouTube-VIS document, or of a list of results.

    Frame numbers are those in ``file_names`` if these differ in one number only; the places in the lists times
    ``stride`` otherwise, and if ``stride`` is given.

    Parameters
    ----------
    document : dict or list
    options : MaskOptions
        ``video``: id or name of the movie, if there are several.
    background : int
        Label of pixels that belong to no object.

    Returns
    -------
    ObjectMasks
        Named by category; several objects of one category are counted.

    Raises
    ------
    ValueError
        If a field is missing or malformed, the movie is not in it, or lists are not as long as the movie.

    Examples
    --------
    >>> masks = [{"size": [1, 2], "counts": [1, 1]}, None]
    >>> results = [{"video_id": 3, "category_id": 7, "segmentations": masks}]
    >>> objects = open_youtube_vis(results, MaskOptions(), background=0)
    >>> objects.size, dict(objects.names), [len(of_frame) for _, of_frame in objects]
    ((1, 2), {1: 'category 7'}, [1, 0])
    """
    video: dict[str, Any] | None = None
    if isinstance(document, list):
        annotations, categories = as_records(document, "results"), {}
        chosen = _chosen({whole_number(entry, "video_id", "result"): "" for entry in annotations}, options)
    else:
        annotations, categories = records(document, "annotations"), _categories(document)
        videos = {whole_number(entry, "id", "video"): entry for entry in records(document, "videos")}
        chosen = _chosen({number: _name_of_video(entry) for number, entry in videos.items()}, options)
        video = videos[chosen]
    mine = [entry for entry in annotations if whole_number(entry, "video_id", "annotation") == chosen]
    masks: dict[int, list[Any]] = {}
    kinds: dict[int, int] = {}
    for place, entry in enumerate(mine, start=1):
        number = whole_number(entry, "id", "annotation") if "id" in entry else place
        if number in masks:
            raise ValueError(f"annotations: expected each id once, got {number} twice")
        if not isinstance(entry.get("segmentations"), list):
            raise ValueError(f"object {number}: expected a list of segmentations, one entry a frame")
        masks[number], kinds[number] = entry["segmentations"], whole_number(entry, "category_id", f"object {number}")
    size = _size_of_first(masks) if video is None else size_of(video, "video")
    check_size(size, options)
    n_frames = _length(video, masks)
    for number, of_object in masks.items():
        if len(of_object) != n_frames:
            raise ValueError(f"object {number}: expected {n_frames} segmentations, one a frame, got {len(of_object)}")
    found = None if video is None or options.stride else _numbers_of_files(video)
    if found is None or options.frames is not None:
        frames = number_frames(None, n_frames, options=options)
    else:
        frames = as_frames(found)
    labels = labels_of_ids(list(masks), background=background)
    by_frame = [
        [(labels[number], of_object[place]) for number, of_object in masks.items() if of_object[place] is not None]
        for place in range(n_frames)
    ]
    names = names_of_labels(labels, told=_names(kinds, categories), options=options, background=background)
    return ObjectMasks(partial(_read, frames.tolist(), by_frame, size), size, frames, background, names)


def open_coco(document: Any, options: MaskOptions, *, background: int) -> ObjectMasks:
    """Masks of one movie of a COCO document, whose images are the frames.

    Frame numbers are ``frame_id`` or ``frame_index``, those in ``file_name`` if these differ in one number only, or the
    places in the list of images times ``stride``. Without ``track_id`` or ``instance_id`` an object is known by its
    category, as long as no image shows two of one.

    Parameters
    ----------
    document : dict
    options : MaskOptions
        ``video``: id of the movie, if there are several.
    background : int
        Label of pixels that belong to no object.

    Returns
    -------
    ObjectMasks
        Named by category; several objects of one category are counted.

    Raises
    ------
    ValueError
        If a field is missing or malformed, sizes differ, objects cannot be told apart, or frames are missing.

    Examples
    --------
    >>> document = {
    ...     "images": [{"id": 5, "height": 1, "width": 2, "file_name": "0.png"}],
    ...     "annotations": [{"image_id": 5, "category_id": 2, "segmentation": {"size": [1, 2], "counts": "11"}}],
    ...     "categories": [{"id": 2, "name": "cup"}],
    ... }
    >>> dict(open_coco(document, MaskOptions(), background=0).names)
    {2: 'cup'}
    """
    images = records(document, "images")
    if any("video_id" in image for image in images):
        of_image = [whole_number(image, "video_id", "image") for image in images]
        chosen = _chosen(dict.fromkeys(of_image, ""), options)
        images = [image for image, number in zip(images, of_image, strict=True) if number == chosen]
    if not images:
        raise ValueError("images: expected at least one, got none")
    size = size_of(images[0], "image")
    check_size(size, options)
    for image in images:
        if size_of(image, "image") != size:
            found = size_of(image, "image")
            raise ValueError(f"image {image.get('id')}: expected {size[0]}×{size[1]}, got {found[0]}×{found[1]}")
    images, numbers = _in_order(images)
    frames = number_frames(numbers, len(images), options=options)
    place_of = {whole_number(image, "id", "image"): place for place, image in enumerate(images)}
    if len(place_of) < len(images):
        raise ValueError("images: expected each id once, got one twice")
    annotations = [
        entry for entry in records(document, "annotations") if whole_number(entry, "image_id", "annotation") in place_of
    ]
    objects = _ids_of_objects(annotations)
    kinds: dict[int, int] = {}
    by_place: list[dict[int, Any]] = [{} for _ in images]
    for number, entry in zip(objects, annotations, strict=True):
        of_frame = by_place[place_of[entry["image_id"]]]
        if number in of_frame:
            raise ValueError(f"image {entry['image_id']}: expected object {number} once, got it twice")
        if "segmentation" not in entry:
            raise ValueError(f"image {entry['image_id']}: expected a segmentation of object {number}, got none")
        of_frame[number] = entry["segmentation"]
        kinds.setdefault(number, whole_number(entry, "category_id", "annotation"))
    labels = labels_of_ids(list(kinds), background=background)
    by_frame = [[(labels[number], encoded) for number, encoded in of_frame.items()] for of_frame in by_place]
    names = names_of_labels(labels, told=_names(kinds, _categories(document)), options=options, background=background)
    return ObjectMasks(partial(_read, frames.tolist(), by_frame, size), size, frames, background, names)


def mask_of(encoded: Any, size: tuple[int, int]) -> Mask:
    """Mask of a segmentation as COCO writes it: run-length encoding or list of polygons.

    Raises
    ------
    ValueError
        If it is something else, malformed or of another size.

    Examples
    --------
    >>> mask_of([[0, 0, 1, 0, 1, 1, 0, 1]], (1, 2))
    array([[ True, False]])
    """
    return polygon_mask(encoded, size) if isinstance(encoded, list) else decode(encoded, size)


def _read(
    frames: Sequence[int], by_frame: Sequence[Sequence[Encoded]], size: tuple[int, int]
) -> Iterator[tuple[int, list[tuple[int, Mask]]]]:
    for frame, of_frame in zip(frames, by_frame, strict=True):
        masks = []
        for label, encoded in of_frame:
            try:
                masks.append((label, mask_of(encoded, size)))
            except ValueError as error:
                raise ValueError(f"frame {frame}: object {label}: {error}") from error
        yield frame, masks


def _chosen(videos: Mapping[int, str], options: MaskOptions) -> int:
    """Id of the movie that is asked for, by id or name, or of the only one."""
    if options.video is None and len(videos) == 1:
        return next(iter(videos))
    fitting = [number for number, name in videos.items() if options.video in (number, name) and options.video != ""]
    if len(fitting) == 1:
        return fitting[0]
    known = ", ".join(f"{number} ({name})" if name else str(number) for number, name in list(videos.items())[:5])
    got = "none was chosen" if options.video is None else f"got {options.video!r}"
    raise ValueError(f"video: expected one of the {len(videos)} movies ({known}{', …' * (len(videos) > 5)}), {got}")


def _name_of_video(video: Mapping[str, Any]) -> str:
    """Name of a movie, or of the folder that its first frame lies in."""
    files = video.get("file_names")
    first = files[0] if isinstance(files, list) and files else ""
    name = video.get("name", first.rpartition("/")[0] if isinstance(first, str) else "")
    return name if isinstance(name, str) else ""


def _size_of_first(masks: Mapping[int, Sequence[Any]]) -> tuple[int, int]:
    for of_object in masks.values():
        for encoded in of_object:
            if isinstance(encoded, dict) and isinstance(encoded.get("size"), list) and len(encoded["size"]) == 2:
                return size_of(dict(zip(("height", "width"), encoded["size"], strict=True)), "segmentation")
    raise ValueError("results: expected at least one run-length encoding with a size, got none")


def _length(video: Mapping[str, Any] | None, masks: Mapping[int, Sequence[Any]]) -> int:
    if video is None:
        return max((len(of_object) for of_object in masks.values()), default=0)
    files = video.get("file_names")
    if files is not None and not (isinstance(files, list) and all(isinstance(name, str) for name in files)):
        raise ValueError("video: expected file_names as a list of texts")
    if "length" not in video and files is None:
        raise ValueError("video: expected length or file_names, got neither")
    length = whole_number(dict(video), "length", "video") if "length" in video else len(files or [])
    if files is not None and len(files) != length:
        raise ValueError(f"video: expected {length} file_names, got {len(files)}")
    # Whatever the length claims, there is a list of that many entries somewhere.
    if files is None and not any(len(of_object) == length for of_object in masks.values()):
        raise ValueError(f"video: expected {length} segmentations of its objects")
    return length


def _numbers_of_files(video: Mapping[str, Any]) -> tuple[int, ...] | None:
    names = [name.rpartition("/")[2] for name in video.get("file_names") or []]
    return frame_numbers(names) if names else None


def _in_order(images: Sequence[dict[str, Any]]) -> tuple[list[dict[str, Any]], list[int] | None]:
    """Images in the order of their frame numbers, and these, if they are told."""
    numbers: Sequence[int] | None = None
    for key in _FRAME_KEYS:
        if all(key in image for image in images):
            numbers = [whole_number(image, key, "image") for image in images]
            break
    else:
        names = [image.get("file_name") for image in images]
        if all(isinstance(name, str) for name in names):
            numbers = frame_numbers([str(name).rpartition("/")[2] for name in names])
    if numbers is None:
        return list(images), None
    order = sorted(range(len(images)), key=numbers.__getitem__)
    return [images[place] for place in order], [numbers[place] for place in order]


def _ids_of_objects(annotations: Sequence[dict[str, Any]]) -> list[int]:
    """What stays with an object: its track, or its category if no image shows two of one."""
    for key in _TRACK_KEYS:
        if any(key in entry for entry in annotations):
            return [whole_number(entry, key, "annotation") for entry in annotations]
    kinds = [whole_number(entry, "category_id", "annotation") for entry in annotations]
    shown = Counter((entry["image_id"], kind) for entry, kind in zip(annotations, kinds, strict=True))
    for (image, kind), n_shown in shown.items():
        if n_shown > 1:
            raise ValueError(
                f"annotations: expected a {_TRACK_KEYS[0]} that stays with each object, "
                f"as image {image} shows {n_shown} of category {kind}"
            )
    return kinds


def _names(kinds: Mapping[int, int], categories: Mapping[int, str]) -> dict[int, str | None]:
    """Names of objects by their categories; several of one category are counted."""
    n_of_kind = Counter(kinds.values())
    seen: Counter[int] = Counter()
    names: dict[int, str | None] = {}
    for number, kind in kinds.items():
        seen[kind] += 1
        name = categories.get(kind, f"category {kind}")
        names[number] = name if n_of_kind[kind] == 1 else f"{name} {seen[kind]}"
    return names


def _categories(document: Mapping[str, Any]) -> dict[int, str]:
    found = {}
    for entry in as_records(document.get("categories", []), "categories"):
        name = entry.get("name")
        if not isinstance(name, str):
            raise ValueError(f"categories: expected a name of category {entry.get('id')}, got {name!r}")
        found[whole_number(entry, "id", "category")] = name
    return found
