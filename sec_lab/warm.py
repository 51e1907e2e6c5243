"""Compile all kernels once, so that no command has to wait for it; called by the set-up."""

import numpy as np

from sec_lab.event_chain import EventChain
from sec_lab.relations import scan_lines
from sec_lab.segmentation.disparity_stream import DisparityEstimator
from sec_lab.similarity import compare, pairwise_similarity, permutations


def warm() -> None:
    """Call every compiled function on the smallest input that reaches it; the compiled code is cached on disk.

    Examples
    --------
    >>> warm()
    """
    for dtype in (np.uint8, np.uint16):
        scan_lines(np.zeros((1, 8), dtype))
    estimator, picture = DisparityEstimator(range_px=(0, 15)), np.zeros((32, 48), np.uint8)
    for _ in range(2):
        estimator(picture, picture)
    chain = EventChain([[0, 2, 0], [0, 0, 2]], [(1, 2), (2, 3)])
    permutations(compare(chain, chain))
    pairwise_similarity([chain, chain])


if __name__ == "__main__":
    warm()
