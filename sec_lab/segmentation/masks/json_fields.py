"""Fields of JSON documents: there and of the right kind, or one clear error that says where."""

from typing import Any

from sec_lab.recording.pictures import check_pixels


def records(document: Any, key: str) -> list[dict[str, Any]]:
    """List of objects under a key.

    Raises
    ------
    ValueError
        If it is missing or something else.

    Examples
    --------
    >>> records({"videos": [{"id": 1}]}, "videos")
    [{'id': 1}]
    """
    return as_records(document.get(key), key)


def as_records(values: Any, what: str) -> list[dict[str, Any]]:
    """List of objects, or one clear error.

    Raises
    ------
    ValueError
        If it is something else.

    Examples
    --------
    >>> as_records([1], "videos")
    Traceback (most recent call last):
    ...
    ValueError: videos[0]: expected an object, got int
    """
    if not isinstance(values, list):
        raise ValueError(f"{what}: expected a list, got {type(values).__name__}")
    for place, value in enumerate(values):
        if not isinstance(value, dict):
            raise ValueError(f"{what}[{place}]: expected an object, got {type(value).__name__}")
    return values


def whole_number(record: dict[str, Any], key: str, what: str) -> int:
    """Whole number from 0 on under a key; 480.0 counts as one.

    Raises
    ------
    ValueError
        If it is missing or something else.

    Examples
    --------
    >>> whole_number({"height": 480.0}, "height", "video")
    480
    """
    value: Any = record.get(key)
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    if not is_number or not 0 <= value < 1 << 62 or value != int(value):
        raise ValueError(f"{what}.{key}: expected a whole number from 0 on, got {str(value)[:40]}")
    return int(value)


def size_of(record: dict[str, Any], what: str, *, prefix: str = "") -> tuple[int, int]:
    """(height, width) of a picture, by fields of these names.

    Raises
    ------
    ValueError
        If one is missing, or the picture has no pixels or too many.

    Examples
    --------
    >>> size_of({"height": 240, "width": 320}, "video")
    (240, 320)
    """
    size = whole_number(record, f"{prefix}height", what), whole_number(record, f"{prefix}width", what)
    try:
        check_pixels(size)
    except ValueError as error:
        raise ValueError(f"{what}: {error}") from error
    return size
