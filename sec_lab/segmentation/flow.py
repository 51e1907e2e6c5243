"""Optic flow between two frames, and labels carried along it (step 1, §2.2)."""

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sec_lab.codes import as_array, as_integers
from sec_lab.segmentation.potts import MAX_SPIN, as_picture
from sec_lab.segmentation.record import Labels

if TYPE_CHECKING:
    import cv2

RESIDUAL_LIMIT = 40.0
"""Colour difference (0 to 255 a channel) from which on a pixel is taken for something else than what flowed there."""

FLOW_STEP = 2
"""Pixels of a picture along a side of a pixel of its flow."""


def optic_flow(before: ArrayLike, after: ArrayLike) -> NDArray[np.float32]:
    """Where each pixel of a frame was in the frame before: dense inverse search (OpenCV's DIS).

    Parameters
    ----------
    before, after : (height, width, 3) array_like of uint8
        RGB.

    Returns
    -------
    (⌈height / 2⌉, ⌈width / 2⌉, 2) float32
        Of every field of 2×2 pixels the step (columns, rows) in pixels that leads back to ``before``.

    Raises
    ------
    ValueError
        If a picture is not what is expected, or the two differ in size.

    Notes
    -----
    Computed at half the size with the preset "ultrafast"; finer settings hardly change what becomes of the labels, as
    the lattice corrects their borders. Pictures below 24 pixels at half the size are taken to stand still.

    Examples
    --------
    >>> pixels = np.random.default_rng(0).integers(0, 256, (16, 20, 3), dtype=np.uint8)
    >>> before = np.kron(pixels, np.ones((8, 8, 1), dtype=np.uint8))
    >>> flow = optic_flow(before, np.roll(before, 4, axis=1))
    >>> np.median(flow[..., 0]).round(), np.median(flow[..., 1]).round()
    (np.float32(-4.0), np.float32(0.0))
    """
    first, second = as_picture(before), as_picture(after)
    _check_size(first, second)
    return FLOW_STEP * grey_flow(reduced_grey(first[..., 1]), reduced_grey(second[..., 1]), dense_inverse_search())


def warp_labels(
    labels: ArrayLike,
    before: ArrayLike,
    after: ArrayLike,
    flow: NDArray[np.float32],
    *,
    residual_limit: float = RESIDUAL_LIMIT,
) -> Labels:
    """Labels of a frame carried to the next one.

    Every pixel looks back along the flow, and at its own place; it takes the label where the colour is closer to its
    own. Where neither is close enough (something came up, or was uncovered) it stays vacant.

    Parameters
    ----------
    labels : (height, width) array_like of int
        Labels of the frame before, from 1 on, up to 32,767; 0 is vacant.
    before, after : (height, width, 3) array_like of uint8
        RGB pictures of both frames.
    flow
        See :func:`optic_flow`.
    residual_limit : float, optional
        Largest Euclidean colour difference.

    Returns
    -------
    (height, width) uint16

    Raises
    ------
    ValueError
        If sizes disagree, or labels or the limit are not what is expected.

    Examples
    --------
    >>> before = np.zeros((2, 4, 3), dtype=np.uint8)
    >>> before[:, 1:2] = 250
    >>> after = np.roll(before, 1, axis=1)
    >>> flow = np.zeros((1, 2, 2), dtype=np.float32)
    >>> flow[:, 1, 0] = -1
    >>> warp_labels([[1, 2, 1, 1], [1, 2, 1, 1]], before, after, flow)
    array([[1, 0, 2, 1],
           [1, 0, 2, 1]], dtype=uint16)
    """
    first, second = as_picture(before), as_picture(after)
    _check_size(first, second)
    values = as_integers(labels, what="labels", ndim=2)
    if values.shape != first.shape[:2]:
        raise ValueError(f"labels: expected shape {first.shape[:2]} like the pictures, got {values.shape}")
    if values.min() < 0 or values.max() > MAX_SPIN:
        raise ValueError(f"labels: expected 0 to {MAX_SPIN}, got {values.min()} to {values.max()}")
    size = tuple(-(-n // FLOW_STEP) for n in values.shape)
    steps = as_array(flow, what="flow", ndim=3)
    if steps.shape != (*size, 2):
        raise ValueError(f"flow: expected shape {(*size, 2)}, got {steps.shape}")
    if not residual_limit >= 0:
        raise ValueError(f"residual_limit: expected a number from 0 on, got {residual_limit}")
    from sec_lab.segmentation._track_kernels import warp

    warped: Labels = warp(
        values.astype(np.int16),
        np.ascontiguousarray(np.moveaxis(first, 2, 0)),
        np.ascontiguousarray(np.moveaxis(second, 2, 0)),
        np.ascontiguousarray(steps / FLOW_STEP, np.float32),
        float(residual_limit),
    ).astype(np.uint16)
    return warped


def dense_inverse_search() -> "cv2.DISOpticalFlow":
    """OpenCV's DIS with the preset "ultrafast"; it keeps memory between calls that have pictures of one size."""
    import cv2

    return cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_ULTRAFAST)


def reduced_grey(channel: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """A channel at half the size, rounded up: the picture that flow is computed of."""
    import cv2

    height, width = channel.shape
    size = (width + 1) // FLOW_STEP, (height + 1) // FLOW_STEP
    return np.asarray(cv2.resize(channel, size, interpolation=cv2.INTER_AREA), np.uint8)


def grey_flow(before: NDArray[np.uint8], after: NDArray[np.uint8], search: Any) -> NDArray[np.float32]:
    """Flow from a grey picture back to the one before, in their own pixels; no motion if they are too small for DIS."""
    if min(before.shape) < _LEAST:
        return np.zeros((*before.shape, 2), np.float32)
    return np.asarray(search.calc(after, before, None), np.float32)


_LEAST = 24


def _check_size(first: NDArray[np.uint8], second: NDArray[np.uint8]) -> None:
    if first.shape != second.shape:
        raise ValueError(f"pictures: expected two of one size, got shapes {first.shape} and {second.shape}")
