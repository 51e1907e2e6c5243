"""Segmenters of single frames from other libraries, and the linking of their labels from frame to frame.

OpenCV's GraphSegmentation is in ``cv2.ximgproc``, which only builds with the extra modules have; where it is missing,
OpenCV's mean shift stands in for it. (It is the method of Felzenszwalb and Huttenlocher, like that of scikit-image.)
"""

from collections.abc import Callable, Iterable, Iterator
from functools import partial
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

Picture = NDArray[np.uint8]
Labels = NDArray[np.int64]
Method = Callable[[Picture], Labels]

MIN_SIZE = 100
"""Smallest segment in pixels, for all of them."""

LINK_IOU = 0.3
"""Least overlap, as intersection over union, with which a segment takes over a label of the frame before."""

HAS_GRAPH_SEGMENTATION = hasattr(cv2, "ximgproc")


def felzenszwalb(picture: Picture, *, scale: float) -> Labels:
    from skimage.segmentation import felzenszwalb as of_skimage

    return np.asarray(of_skimage(picture, scale=scale, sigma=0.8, min_size=MIN_SIZE), dtype=np.int64)


def merged_slic(picture: Picture, *, difference: float) -> Labels:
    """Superpixels, of which neighbours are merged, the most similar ones first, while their mean colours are close."""
    from skimage.graph import merge_hierarchical, rag_mean_color
    from skimage.segmentation import slic

    pieces = slic(picture, n_segments=300, compactness=10, start_label=0)
    graph = rag_mean_color(picture, pieces)
    merged = merge_hierarchical(
        pieces,
        graph,
        thresh=difference,
        rag_copy=False,
        in_place_merge=True,
        merge_func=_add_colours,
        weight_func=_colour_difference,
    )
    return np.asarray(merged, dtype=np.int64)


def _add_colours(graph: Any, source: int, target: int) -> None:
    into, of = graph.nodes[target], graph.nodes[source]
    into["total color"] += of["total color"]
    into["pixel count"] += of["pixel count"]
    into["mean color"] = into["total color"] / into["pixel count"]


def _colour_difference(graph: Any, source: int, target: int, neighbour: int) -> dict[str, float]:
    nodes = graph.nodes
    return {"weight": float(np.linalg.norm(nodes[target]["mean color"] - nodes[neighbour]["mean color"]))}


def mean_shift(picture: Picture, *, colour_radius: float) -> Labels:
    """Mean shift in place and colour; then neighbours of nearly the same colour are one segment."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    flat = cv2.pyrMeanShiftFiltering(np.ascontiguousarray(picture), 8, colour_radius).astype(np.int16)
    places = np.arange(picture.shape[0] * picture.shape[1]).reshape(picture.shape[:2])
    joined = []
    for here, there in (((slice(None), slice(1, None)), (slice(None), slice(-1))), (slice(1, None), slice(-1))):
        same = abs(flat[here] - flat[there]).max(axis=-1) <= 4
        joined.append(np.stack([places[here][same], places[there][same]]))
    left, right = np.concatenate(joined, axis=1)
    bonds = coo_array((np.ones(len(left), dtype=bool), (left, right)), shape=(places.size, places.size))
    labels = connected_components(bonds, directed=False)[1].reshape(places.shape)
    return _without_small(labels.astype(np.int64))


def _without_small(labels: Labels) -> Labels:
    """Pixels of small segments go to the nearest large one."""
    from scipy.ndimage import distance_transform_edt

    small = np.bincount(labels.ravel())[labels] < MIN_SIZE
    if small.all():
        return np.zeros_like(labels)
    rows, columns = distance_transform_edt(small, return_distances=False, return_indices=True)
    return labels[rows, columns]


def graph_segmentation(picture: Picture, *, scale: float) -> Labels:
    segmenter = cv2.ximgproc.segmentation.createGraphSegmentation(sigma=0.8, k=scale, min_size=MIN_SIZE)
    return np.asarray(segmenter.processImage(picture), dtype=np.int64)


SCALES = (100, 300, 1000, 3000)

COMPETITORS: dict[str, list[Method]] = {
    "felzenszwalb": [partial(felzenszwalb, scale=scale) for scale in SCALES],
    "SLIC + merging": [partial(merged_slic, difference=difference) for difference in (15, 25, 40, 60)],
}
"""By name, the same method with some settings, of which the best may be chosen by the truth."""
if HAS_GRAPH_SEGMENTATION:
    COMPETITORS["GraphSegmentation"] = [partial(graph_segmentation, scale=scale) for scale in SCALES]
else:
    COMPETITORS["mean shift"] = [partial(mean_shift, colour_radius=radius) for radius in (12, 20, 32, 48)]


def linked(label_images: Iterable[Labels], *, least_iou: float = LINK_IOU) -> Iterator[Labels]:
    """Labels that last: a segment takes over the label of the segment before that it overlaps best, each label once."""
    before: Labels | None = None
    n_labels = 0
    for image in label_images:
        values, compact = np.unique(image, return_inverse=True)
        compact = compact.reshape(image.shape)
        names = np.full(len(values), -1, dtype=np.int64)
        if before is not None:
            shared = np.zeros((len(values), n_labels), dtype=np.int64)
            np.add.at(shared, (compact, before), 1)
            union = shared.sum(axis=1)[:, None] + shared.sum(axis=0) - shared
            iou = shared / np.maximum(union, 1)
            new, old = np.nonzero(iou >= least_iou)
            taken: set[int] = set()
            for place in np.argsort(-iou[new, old], kind="stable"):
                segment, label = int(new[place]), int(old[place])
                if names[segment] < 0 and label not in taken:
                    names[segment] = label
                    taken.add(label)
        fresh = names < 0
        names[fresh] = n_labels + np.arange(fresh.sum())
        n_labels += int(fresh.sum())
        before = names[compact]
        yield before
