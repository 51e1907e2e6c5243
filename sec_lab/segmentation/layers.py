"""The default segmentation: a static scene, what moves in it, and what the movement takes, puts or brings to light.

Plain tracking gives a label to whatever is of one colour; what makes a segment *permanent* is that it rests, moves as
one, or is carried. So the scene is kept in layers: the picture of all that rests with the label of every pixel, the
background that lies behind it, and the segments that move. Each pixel of a new frame has a cost under every layer (how
well the picture of the static scene explains it, a shadow allowed; how usual its colour is in a moving segment near
by; a constant for something unknown), and a relaxation on the lattice of pixels with bonds between like colours (§2.2)
decides. Nothing is known of objects or hands. It is causal: a frame is labelled from what came before it.
"""

import warnings
from collections.abc import Iterator
from functools import partial
from itertools import chain, islice
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from sec_lab.recording.sharing import ReadAhead
from sec_lab.segmentation.appearance import smoothed_lab
from sec_lab.segmentation.layer_parameters import DEFAULT, LayerParameters
from sec_lab.segmentation.record import Segmentation
from sec_lab.segmentation.scene_layers import Layers
from sec_lab.segmentation.static_scene import static_segments

if TYPE_CHECKING:
    from sec_lab.recording import Frame, Recording


def layered_segments(recording: "Recording", *, parameters: LayerParameters = DEFAULT) -> Segmentation:
    """Segments of a movie that keep their labels: what rests, what moves, what is carried (step 1, §2.2).

    Parameters
    ----------
    recording : Recording
        Its depth, where it has any, tells objects from what they lie on in the first frames.
    parameters : LayerParameters, optional

    Returns
    -------
    Segmentation
        Lazy; label 1 is the background. The first label image comes after ``parameters.opening_frames`` frames were
        read, every other one after its own frame.

    Raises
    ------
    ValueError
        While it is read: for the reasons of :class:`~sec_lab.recording.Recording`, or if there are more than 65,535
        segments.

    Examples
    --------
    A square that moves from the left to the right:

    >>> from sec_lab.recording import Recording
    >>> movie = np.full((12, 40, 60, 3), (60, 120, 80), dtype=np.uint8)
    >>> for place, frame in zip((5, 5, 5, 5, 5, 8, 11, 14, 17, 20, 23, 26), movie, strict=True):
    ...     frame[10:26, place : place + 16] = 200, 40, 30
    >>> segmentation = layered_segments(Recording.from_frames(movie))
    >>> [int(image[18, 12]) for image in segmentation][::11]
    [2, 1]
    """
    return Segmentation(partial(_layered, recording, parameters), recording.size, background=1)


def _layered(recording: "Recording", parameters: LayerParameters) -> Iterator[tuple[int, NDArray[np.uint16]]]:
    frames = iter(recording)
    opening = list(islice(frames, parameters.opening_frames))
    if not opening:
        return
    layers = Layers(opening[0].image, _static_scene(opening, parameters), parameters)
    yield opening[0].index, layers.label_image
    coming = ((frame.index, smoothed_lab(frame.image)) for frame in chain(opening[1:], frames))
    for number, picture in ReadAhead(coming):
        layers.step(picture)
        yield number, layers.label_image


def _static_scene(opening: list["Frame"], parameters: LayerParameters) -> NDArray[np.uint8]:
    """Segments of the first frame; its depth is less noisy as the median over the first frames where nothing moves."""
    image = opening[0].image
    depth = None
    if opening[0].depth_m is not None:
        depths = np.stack([frame.depth_m for frame in opening if frame.depth_m is not None])
        known = np.where(depths > 0, depths, np.nan)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)  # pixels that are never known
            median = np.nanmedian(known, axis=0)
        depth = np.nan_to_num(median, nan=0.0).astype(np.float32)
    height, width = image.shape[:2]
    return static_segments(image, depth_m=depth, least_px=max(12, round(2 * height * width * parameters.least_share)))
