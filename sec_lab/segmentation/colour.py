"""Segments by colour: the simple HSV segmentation of §2.10.1, and the names that colours give to segments."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sec_lab.codes import as_array
from sec_lab.segmentation.record import Labels, Segmentation, as_label

if TYPE_CHECKING:
    from sec_lab.recording import Recording

Components = Literal["largest", "all"]
Range = tuple[float, float]

# 8-bit pictures of OpenCV have hues in steps of 2°, and 255 for all of saturation and value.
_HUE_STEP_DEGREES, _FULL = 2, 255


@dataclass(frozen=True)
class NamedColour:
    """A name and the pixels that belong to it: a box of hues, saturations and values (HSV).

    A range holds its lower end and not its upper one, so that ranges may follow one another; only 100 percent belongs
    to a range that ends there.

    Parameters
    ----------
    name : str
        Name of the object of this colour.
    hue_degrees : tuple of float
        From the first to the second, 0 to 360; red is at 0. A first one that is larger goes through 0: (345, 15).
        OpenCV rounds hues to 2 degrees. Greys have the hue 0.
    saturation_percent, value_percent : tuple of float, optional
        From the first to the second, 0 to 100; all if left out.

    Raises
    ------
    ValueError
        If the name is no text or empty, or a range is empty or reaches too far.

    Examples
    --------
    >>> NamedColour("red box", (345, 15), (50, 100))
    NamedColour(name='red box', hue_degrees=(345.0, 15.0), saturation_percent=(50.0, 100.0), value_percent=(0.0, 100.0))
    """

    name: str
    hue_degrees: Range
    saturation_percent: Range = (0.0, 100.0)
    value_percent: Range = (0.0, 100.0)

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not self.name:
            raise ValueError(f"name: expected the name of an object, got {self.name!r}")
        for what, most in (("hue_degrees", 360.0), ("saturation_percent", 100.0), ("value_percent", 100.0)):
            low, high = _as_range(getattr(self, what), most=most, what=f"{self.name}: {what}")
            if low == high or (low > high and (what != "hue_degrees" or low == most)):
                raise ValueError(f"{self.name}: {what}: expected a range that is not empty, got ({low:g}, {high:g})")
            object.__setattr__(self, what, (low, high))

    @property
    def hue_pieces_degrees(self) -> tuple[Range, ...]:
        """The range of hues, in two pieces if it goes through 0."""
        low, high = self.hue_degrees
        pieces = [(low, high)] if low < high else [(low, 360.0), (0.0, high)]
        return tuple(piece for piece in pieces if piece[0] < piece[1])


def colour_segments(
    image: ArrayLike,
    colours: Sequence[NamedColour],
    *,
    minimum_px: int = 20,
    components: Components = "largest",
    background: int = 0,
) -> Labels:
    """Segments of one picture by colour (§2.10.1): the label of a segment is the place of its colour, counted from 1.

    Parameters
    ----------
    image : (height, width, 3) array_like of uint8
        RGB.
    colours : sequence of NamedColour
        None of which shares a colour with another.
    minimum_px : int, optional
        Connected parts (8 neighbours) of fewer pixels are noise, and go to the background.
    components : {"largest", "all"}, optional
        Keep the largest connected part of each colour (default; of equal ones the uppermost, then the leftmost), or
        all parts that are large enough: an object that a hand covers in the middle stays whole then.
    background : int, optional
        Label of all other pixels.

    Returns
    -------
    (height, width) uint16 ndarray

    Raises
    ------
    ValueError
        If the picture has another shape or type, there is no colour, two colours have a name or a part of their ranges
        in common, the background has the label of a colour, or an option is not allowed.

    Examples
    --------
    >>> row = [[255, 0, 0], [250, 0, 20], [90, 90, 90], [0, 200, 0]]
    >>> red, green = NamedColour("red box", (345, 15), (50, 100)), NamedColour("green box", (90, 150), (50, 100))
    >>> colour_segments([row], [red, green], minimum_px=1)
    array([[1, 1, 0, 2]], dtype=uint16)
    """
    _check_options(colours, minimum_px=minimum_px, components=components, background=background)
    hsv = _hsv(image)
    labels = np.full(hsv.shape[:2], background, dtype=np.uint16)
    for label, colour in enumerate(colours, start=1):
        labels[_kept(_mask(hsv, colour), minimum_px=minimum_px, components=components)] = label
    return labels


def colour_segmentation(
    recording: "Recording",
    colours: Sequence[NamedColour],
    *,
    minimum_px: int = 20,
    components: Components = "largest",
    background: int = 0,
) -> Segmentation:
    """Segments of a movie by colour, which tracks them and names them at once (§2.10.1).

    Parameters
    ----------
    recording : Recording
    colours, minimum_px, components, background
        As of :func:`colour_segments`.

    Returns
    -------
    Segmentation
        Lazy; with the names of the colours.

    Raises
    ------
    ValueError
        As :func:`colour_segments`, before a picture is read.

    Examples
    --------
    >>> from sec_lab.recording import Recording
    >>> picture = np.full((4, 6, 3), 90, dtype=np.uint8)
    >>> picture[1:3, 1:3] = 255, 0, 0
    >>> found = colour_segmentation(Recording.from_frames([picture]), [NamedColour("box", (345, 15), (50, 100))],
    ...                             minimum_px=4)
    >>> next(iter(found))[1], dict(found.names)
    (array([0, 1, 1, 0, 0, 0], dtype=uint16), {0: 'background', 1: 'box'})
    """
    _check_options(colours, minimum_px=minimum_px, components=components, background=background)
    read = partial(
        _read, recording, tuple(colours), minimum_px=minimum_px, components=components, background=background
    )
    names = {label: colour.name for label, colour in enumerate(colours, start=1)}
    return Segmentation(read, recording.size, None, background, names)


def names_by_colour(
    image: ArrayLike, labels: ArrayLike, colours: Sequence[NamedColour], *, minimum_percent: float = 50.0
) -> dict[int, str]:
    """Names of segments that were found in any other way, by their colour (the object recognition of §2.10.1).

    Parameters
    ----------
    image : (height, width, 3) array_like of uint8
        RGB.
    labels : (height, width) array_like of int
        Label image of the picture.
    colours : sequence of NamedColour
        As of :func:`colour_segments`.
    minimum_percent : float, optional
        Share of its pixels that must have the colour for a segment to get the name.

    Returns
    -------
    dict of int to str
        Name of each segment that has one; several segments may have the same.

    Raises
    ------
    ValueError
        If the label image has another size, the share is not from 0 to 100, or for the reasons of
        :func:`colour_segments`.

    Examples
    --------
    >>> red = NamedColour("red box", (345, 15), (50, 100))
    >>> names_by_colour([[[255, 0, 0], [250, 0, 20], [90, 90, 90]]], [[4, 4, 7]], [red])
    {4: 'red box'}
    """
    _check_options(colours, minimum_px=1, components="all", background=0)
    if not 0 <= minimum_percent <= 100:
        raise ValueError(f"minimum_percent: expected 0 to 100, got {minimum_percent}")
    hsv = _hsv(image)
    segments = as_array(labels, what="label image", ndim=2)
    if segments.shape != hsv.shape[:2] or segments.dtype.kind not in "ui":
        raise ValueError(
            f"label image: expected whole numbers of shape {hsv.shape[:2]}, got {segments.shape} of {segments.dtype}"
        )
    found, places = np.unique(segments, return_inverse=True)
    places = places.reshape(segments.shape)
    shares_percent = np.empty((len(colours), len(found)))
    sizes = np.bincount(places.ravel(), minlength=len(found))
    for share, colour in zip(shares_percent, colours, strict=True):
        share[:] = 100 * np.bincount(places[_mask(hsv, colour)], minlength=len(found)) / sizes
    best = shares_percent.argmax(axis=0)
    return {
        label: colours[best[place]].name
        for place, label in enumerate(found.tolist())
        if shares_percent[best[place], place] >= max(minimum_percent, 1e-9)
    }


def _read(
    recording: "Recording",
    colours: Sequence[NamedColour],
    *,
    minimum_px: int,
    components: Components,
    background: int,
) -> Iterator[tuple[int, Labels]]:
    for frame in recording:
        yield (
            frame.index,
            colour_segments(frame.image, colours, minimum_px=minimum_px, components=components, background=background),
        )


def _hsv(image: ArrayLike) -> NDArray[np.uint8]:
    # Imported when it is used: who only names colours needs no pictures.
    import cv2

    picture = as_array(image, what="image", ndim=3)
    if picture.dtype != np.uint8 and picture.dtype.kind in "ui" and picture.size:
        # Lists of whole numbers come as a wider type.
        if picture.min() < 0 or picture.max() > _FULL:
            raise ValueError(f"image: expected values from 0 to 255, got {picture.min()} to {picture.max()}")
        picture = picture.astype(np.uint8)
    if picture.dtype != np.uint8 or picture.shape[2] != 3 or not picture.size:
        raise ValueError(
            f"image: expected shape (height, width, 3) of type uint8, got {picture.shape} of {picture.dtype}"
        )
    hsv: NDArray[np.uint8] = np.asarray(cv2.cvtColor(np.ascontiguousarray(picture), cv2.COLOR_RGB2HSV), dtype=np.uint8)
    return hsv


def _mask(hsv: NDArray[np.uint8], colour: NamedColour) -> NDArray[np.bool_]:
    import cv2

    saturations = _steps(colour.saturation_percent, step=100 / _FULL, last=100.0)
    values = _steps(colour.value_percent, step=100 / _FULL, last=100.0)
    mask = np.zeros(hsv.shape[:2], dtype=np.bool_)
    for piece in colour.hue_pieces_degrees:
        box = np.array([_steps(piece, step=_HUE_STEP_DEGREES), saturations, values])
        if (box[:, 0] <= box[:, 1]).all():
            mask |= cv2.inRange(hsv, box[:, 0], box[:, 1]) != 0
    return mask


def _steps(of: Range, *, step: float, last: float = float("nan")) -> tuple[int, int]:
    """First and last whole number whose multiple of the step lies in a range; its upper end only where it is last."""
    low, high = (end / step for end in of)
    # A multiple that should meet an end exactly may miss it by rounding.
    first, beyond = int(np.ceil(low - 1e-9)), int(np.ceil(high - 1e-9))
    return first, beyond if of[1] == last else beyond - 1


def _kept(mask: NDArray[np.bool_], *, minimum_px: int, components: Components) -> NDArray[np.bool_]:
    import cv2

    n, parts, statistics, _ = cv2.connectedComponentsWithStats(mask.view(np.uint8), connectivity=8)
    areas = statistics[:, cv2.CC_STAT_AREA].copy()
    areas[0] = 0
    keep = areas >= minimum_px
    keep[0] = False
    if components == "largest" and n > 1:
        largest = np.flatnonzero(areas == areas.max())
        first = int(largest[0])
        if len(largest) > 1:
            # Which of them comes first in the picture, as their numbers need not say it.
            flat = parts.ravel()
            first = int(flat[np.isin(flat, largest).argmax()])
        keep[np.arange(n) != first] = False
    kept: NDArray[np.bool_] = keep[parts]
    return kept


def _check_options(colours: Sequence[NamedColour], *, minimum_px: int, components: Components, background: int) -> None:
    if not colours:
        raise ValueError("colours: expected at least one, got none")
    if minimum_px < 1:
        raise ValueError(f"minimum_px: expected at least 1, got {minimum_px}")
    if components not in get_args(Components):
        raise ValueError(f"components: expected one of {get_args(Components)}, got {components!r}")
    if 1 <= as_label(background, what="background") <= len(colours):
        raise ValueError(f"background: expected a label that no colour has (1 to {len(colours)}), got {background}")
    for place, colour in enumerate(colours):
        for earlier in colours[:place]:
            if colour.name == earlier.name:
                raise ValueError(f"colours: expected every name once, got {colour.name!r} twice")
            if _overlap(colour, earlier):
                raise ValueError(
                    f"colours: expected ranges apart, got {earlier.name!r} and {colour.name!r} overlapping"
                )


def _overlap(a: NamedColour, b: NamedColour) -> bool:
    hues = any(_meet(one, other) for one in a.hue_pieces_degrees for other in b.hue_pieces_degrees)
    return hues and _meet(a.saturation_percent, b.saturation_percent) and _meet(a.value_percent, b.value_percent)


def _meet(one: Range, other: Range) -> bool:
    return max(one[0], other[0]) < min(one[1], other[1])


def _as_range(values: object, *, most: float, what: str) -> Range:
    try:
        low, high = (float(end) for end in values)  # type: ignore[attr-defined]
    except (TypeError, ValueError) as error:
        raise ValueError(f"{what}: expected (from, to), got {values!r}") from error
    if not (0 <= low <= most and 0 <= high <= most):
        raise ValueError(f"{what}: expected numbers from 0 to {most:g}, got ({low:g}, {high:g})")
    return low, high
