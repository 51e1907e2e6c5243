"""Compile all kernels once, so that no command has to wait for it; called by the set-up."""

import numpy as np

from sec_lab.event_chain import EventChain
from sec_lab.learning import learn
from sec_lab.recording import Recording
from sec_lab.relations import scan_lines, steady_relations
from sec_lab.segmentation import lattice_energy, track_segments, warp_labels
from sec_lab.segmentation.disparity_stream import DisparityEstimator
from sec_lab.segmentation.layers import layered_segments
from sec_lab.similarity import compare, pairwise_similarity, permutations


def warm() -> None:
    """Call every compiled function on the smallest input that reaches it; the compiled code is cached on disk.

    Examples
    --------
    >>> warm()
    """
    for dtype in (np.uint8, np.uint16):
        scan_lines(np.zeros((1, 8), dtype))
        seen = np.zeros((1, 8), dtype)
        list(steady_relations([(0, seen, np.ones(seen.shape)), (1, seen)]))
    estimator, picture = DisparityEstimator(range_px=(0, 15)), np.zeros((32, 48), np.uint8)
    for _ in range(2):
        estimator(picture, picture)
    movie = np.zeros((4, 8, 8, 3), np.uint8)
    for _ in track_segments(Recording.from_frames(movie, depth=np.ones(movie.shape[:3]))):
        pass
    # Something comes in from the border, over a block that rests.
    drawn = np.full((12, 32, 48, 3), (60, 120, 80), np.uint8)
    drawn[:, 10:22, 16:28] = 200, 40, 30
    for step, frame in enumerate(drawn[6:]):
        frame[12:24, 44 - 6 * step :] = 210, 170, 140
    for _ in layered_segments(Recording.from_frames(drawn)):
        pass
    labels = np.ones((8, 8), np.int64)
    lattice_energy(movie[0], labels)
    warp_labels(labels, movie[0], movie[1], np.zeros((4, 4, 2), np.float32))
    chain = EventChain([[0, 2, 0], [0, 0, 2]], [(1, 2), (2, 3)])
    permutations(compare(chain, chain))
    pairwise_similarity([chain, chain])
    learn([chain, chain])
    learn([chain, chain], mode="online")


if __name__ == "__main__":
    warm()
