"""Compile all kernels once, so that no command has to wait for it; called by the set-up."""

import numpy as np

from sec_lab.event_chain import EventChain
from sec_lab.relations import scan_lines, steady_relations
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
    chain = EventChain([[0, 2, 0], [0, 0, 2]], [(1, 2), (2, 3)])
    permutations(compare(chain, chain))
    pairwise_similarity([chain, chain])


if __name__ == "__main__":
    warm()
