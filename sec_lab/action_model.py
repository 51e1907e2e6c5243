"""What was learned of a type of manipulation (step 7, §2.9), and what execution needs of its demonstrations (§2.10)."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sec_lab.codes import as_integers
from sec_lab.event_chain import EventChain
from sec_lab.observation import PositionUnit

if TYPE_CHECKING:
    import pandas as pd

NOT_SEEN = -1
"""Key frame of a column that a demonstration does not have."""


@dataclass(frozen=True, eq=False)
class ActionModel:
    """Archetypal event chain of a type of manipulation, with what its demonstrations say about it (§2.9, §2.10).

    Parameters
    ----------
    chain : EventChain
        The model event chain. Its segments stand for *roles*, its key frames count the columns; names are those that
        most demonstrations give to the segment in this role.
    row_weights : (n_rows,) array_like of float
        ω^r: share of the demonstrations that have each row, above 0 up to 1.
    column_weights : (n_columns,) array_like of float
        ω^c: share of the demonstrations that have each column.
    demonstrations : sequence of n str
        Names of the demonstrations that were learned from, each once.
    roles : mapping of str to mapping of int to int
        By demonstration: role (segment of ``chain``) → segment of the demonstration that clearly plays it (§2.8).
    key_frames : (n, n_columns) array_like of int
        Frame of each demonstration in which each column begins (temporal anchor points, §2.10.2), −1 where the
        demonstration does not have the column. Other frame numbers are 0 or greater.
    positions : (n, n_columns, n_roles, 2 or 3) array_like of float, optional
        Position of the segment in each role (in the order of ``chain.segments``) at that key frame (for the spatial
        anchor points, §2.10.3), NaN where it is not known.
    position_unit : {"px", "m", "unknown"}, optional

    Raises
    ------
    ValueError
        If shapes disagree, a weight is not above 0 up to 1, names repeat, a role is no segment of the chain or two
        roles are played by one segment, or the unit is unknown.

    Examples
    --------
    >>> chain = EventChain([[0, 2, 2], [0, 0, 2]], [(1, 2), (2, 3)], names={2: "hand"})
    >>> frames = [[0, 4, 9], [2, 3, -1]]
    >>> model = ActionModel(chain, [1, 0.5], [1, 1, 0.5], ["first", "second"], {"first": {2: 7}}, frames)
    >>> model.to_frame()
                0  1    2  weight
    pair
    1, hand     0  2  2.0     1.0
    hand, 3     0  0  2.0     0.5
    weight    1.0  1  0.5     NaN
    """

    chain: EventChain
    row_weights: NDArray[np.float64]
    column_weights: NDArray[np.float64]
    demonstrations: tuple[str, ...]
    roles: Mapping[str, Mapping[int, int]]
    key_frames: NDArray[np.int64]
    positions: NDArray[np.float64] | None
    position_unit: PositionUnit

    def __init__(
        self,
        chain: EventChain,
        row_weights: ArrayLike,
        column_weights: ArrayLike,
        demonstrations: Sequence[str],
        roles: Mapping[str, Mapping[int, int]],
        key_frames: ArrayLike,
        positions: ArrayLike | None = None,
        position_unit: PositionUnit = "unknown",
    ) -> None:
        if not isinstance(chain, EventChain):
            raise ValueError(f"chain: expected an EventChain, got {type(chain).__name__}")
        if position_unit not in get_args(PositionUnit):
            raise ValueError(f"position_unit: expected one of {get_args(PositionUnit)}, got {position_unit!r}")
        n_rows, n_columns = chain.relations.shape
        names = _as_demonstrations(demonstrations)
        frames = as_integers(key_frames, what="key_frames", ndim=2)
        if frames.shape != (len(names), n_columns):
            raise ValueError(f"key_frames: expected shape {(len(names), n_columns)}, got {frames.shape}")
        if (frames < NOT_SEEN).any():
            raise ValueError(f"key_frames: expected {NOT_SEEN} or frame numbers from 0 on, got {frames.min()}")
        frames.setflags(write=False)
        values: dict[str, Any] = {
            "chain": chain,
            "row_weights": _as_weights(row_weights, n_rows, what="row_weights"),
            "column_weights": _as_weights(column_weights, n_columns, what="column_weights"),
            "demonstrations": names,
            "roles": _as_roles(roles, names, chain),
            "key_frames": frames,
            "positions": _as_positions(positions, (*frames.shape, len(chain.segments))),
            "position_unit": position_unit,
        }
        for name, value in values.items():
            object.__setattr__(self, name, value)

    def __reduce__(self) -> tuple[object, ...]:
        roles = {name: dict(played) for name, played in self.roles.items()}
        arrays = self.chain, self.row_weights, self.column_weights, self.demonstrations
        return type(self), (*arrays, roles, self.key_frames, self.positions, self.position_unit)

    def to_frame(self) -> "pd.DataFrame":
        """Table for people, as Fig. 2.10 (b): the relations, ω^r at the right, ω^c at the bottom."""
        import pandas as pd

        frame = self.chain.to_frame()
        bottom = pd.DataFrame([self.column_weights], index=["weight"], columns=frame.columns)
        whole = pd.concat([frame, bottom]).rename_axis("pair")
        whole.columns.name = None
        whole["weight"] = np.append(self.row_weights, np.nan)
        return whole


def _as_weights(weights: ArrayLike, n: int, *, what: str) -> NDArray[np.float64]:
    values = np.array(weights, np.float64)
    if values.shape != (n,):
        raise ValueError(f"{what}: expected shape ({n},), got {values.shape}")
    wrong = ~((values > 0) & (values <= 1))
    if wrong.any():
        raise ValueError(f"{what}: expected shares above 0 up to 1, got {values[wrong][0]}")
    values.setflags(write=False)
    return values


def _as_demonstrations(demonstrations: Sequence[str]) -> tuple[str, ...]:
    names = tuple(demonstrations)
    wrong = next((name for name in names if not isinstance(name, str)), None)
    if wrong is not None or isinstance(demonstrations, str):
        raise ValueError(f"demonstrations: expected names, got {demonstrations!r}")
    if not names or len(set(names)) < len(names):
        raise ValueError(f"demonstrations: expected at least one name and each once, got {len(names)}")
    return names


def _as_roles(
    roles: Mapping[str, Mapping[int, int]], names: tuple[str, ...], chain: EventChain
) -> Mapping[str, Mapping[int, int]]:
    unknown = next((name for name in roles if name not in set(names)), None)
    if unknown is not None:
        raise ValueError(f"roles: expected names of demonstrations, got {unknown!r}")
    segments = set(chain.segments.tolist())
    frozen: dict[str, Mapping[int, int]] = {}
    for name in names:
        played = {int(role): int(segment) for role, segment in roles.get(name, {}).items()}
        if not played.keys() <= segments:
            raise ValueError(f"roles: expected segments of the chain, got {min(played.keys() - segments)}")
        if len(set(played.values())) < len(played):
            raise ValueError(f"roles: expected another segment for each role, got {played} for {name!r}")
        frozen[name] = MappingProxyType(played)
    return MappingProxyType(frozen)


def _as_positions(positions: ArrayLike | None, shape: tuple[int, ...]) -> NDArray[np.float64] | None:
    if positions is None:
        return None
    values = np.array(positions, np.float64)
    if values.ndim != 4 or values.shape[:3] != shape or values.shape[3] not in (2, 3):
        raise ValueError(f"positions: expected shape {(*shape, '2 or 3')}, got {values.shape}")
    if np.isinf(values).any():
        raise ValueError("positions: expected finite numbers or NaN, got an infinite one")
    values.setflags(write=False)
    return values
