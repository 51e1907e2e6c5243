"""Relations of boxes in space (§4.2)."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sec_lab.codes import Relation
from sec_lab.relations import box_relations

N, T = Relation.NON_TOUCHING, Relation.TOUCHING

UNIT = ((0.0, 0.0, 0.0), (1.0, 1.0, 1.0))


def moved(*shift: float) -> tuple[tuple[float, ...], ...]:
    return tuple(tuple(c + s for c, s in zip(corner, shift, strict=True)) for corner in UNIT)


@pytest.mark.parametrize(
    ("shift", "gap_m", "expected"),
    [
        ((0.5, 0.5, 0.5), 0.0, T),
        ((1.0, 0.0, 0.0), 0.0, T),  # a common face
        ((1.0, 1.0, 1.0), 0.0, T),  # a common corner
        ((1.01, 0.0, 0.0), 0.0, N),
        ((1.01, 0.0, 0.0), 0.02, T),
        ((0.0, 0.0, -1.01), 0.02, T),
        ((1.03, 1.04, 0.0), 0.049, N),  # 3-4-5: edges are 5 cm apart
        ((1.03, 1.04, 0.0), 0.051, T),
        ((0.0, 0.0, 5.0), 0.0, N),
    ],
)
def test_two_boxes(shift: tuple[float, float, float], gap_m: float, expected: Relation) -> None:
    boxes = [UNIT, moved(*shift)]
    assert box_relations(boxes, gap_m=gap_m).relation(1, 2) is expected
    assert box_relations(boxes[::-1], gap_m=gap_m).relation(1, 2) is expected


def test_box_inside_another_touches() -> None:
    inside = ((0.4, 0.4, 0.4), (0.6, 0.6, 0.6))
    assert box_relations([UNIT, inside]).relation(1, 2) is T


def test_rounding_opens_no_gap() -> None:
    lower, upper = [[0, 0, 0], [1, 1, 0.1 + 0.1 + 0.1]], [[0, 0, 0.3], [1, 1, 1]]
    assert lower[1][2] > upper[0][2]
    raised = [[0, 0, 0.1 + 0.1 + 0.1], [1, 1, 1]]
    flat = [[0, 0, 0], [1, 1, 0.3]]
    assert box_relations([flat, raised]).relation(1, 2) is T
    assert box_relations([lower, upper]).relation(1, 2) is T


def test_labels_and_centres() -> None:
    graph = box_relations([moved(2, 0, 0), UNIT], segments=[9, 4])
    assert graph.segments.tolist() == [4, 9]
    assert graph.positions is not None
    assert graph.positions.tolist() == [[0.5, 0.5, 0.5], [2.5, 0.5, 0.5]]


def test_no_box() -> None:
    assert len(box_relations(np.zeros((0, 2, 3))).segments) == 0


@given(st.integers(0, 2**32 - 1))
def test_intersection_of_whole_boxes(seed: int) -> None:
    """Boxes with whole corners share a point exactly if they share one with whole coordinates."""
    corners = np.sort(np.random.default_rng(seed).integers(0, 6, (5, 2, 3)), axis=1)
    graph = box_relations(corners)
    points = [
        {(x, y, z) for x in range(a[0], b[0] + 1) for y in range(a[1], b[1] + 1) for z in range(a[2], b[2] + 1)}
        for a, b in corners.tolist()
    ]
    for i, j in np.ndindex(5, 5):
        assert graph.relations[i, j] == (T if i != j and points[i] & points[j] else N)


@pytest.mark.parametrize(
    ("boxes", "options", "message"),
    [
        (np.zeros((2, 3)), {}, r"expected shape \(n, 2, 3\), got \(2, 3\)"),
        (np.zeros((2, 3, 2)), {}, r"expected shape \(n, 2, 3\)"),
        ([[[0, 0, 0], [1, 1, np.nan]]], {}, "finite coordinates, got nan"),
        ([[[0, 0, 0], [1, -1, 1]]], {}, "got 0.0 and -1.0 for y of box 0"),
        (np.zeros((1, 2, 3)), {"gap_m": -1.0}, "gap_m: expected a finite number"),
        (np.zeros((1, 2, 3)), {"gap_m": np.nan}, "gap_m: expected a finite number"),
        (np.zeros((2, 2, 3)), {"segments": [1]}, "for 1 segments"),
        (np.zeros((2, 2, 3)), {"segments": [1, 1]}, "each label once"),
        ([[[0, 0, 0], [1, 1]]], {}, "ragged"),
    ],
)
def test_bad_boxes(boxes: object, options: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        box_relations(boxes, **options)  # type: ignore[arg-type]
