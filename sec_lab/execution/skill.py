"""What is learned of a dual-object manipulation, and what a plan is made of."""

from dataclasses import dataclass, field

from sec_lab.action_model import ActionModel
from sec_lab.codes import LETTER_OF, Relation
from sec_lab.execution.anchors import Points
from sec_lab.execution.relative_poses import Hand, Placed
from sec_lab.worlds.katana.records import TABLE, Move, Point


class SceneError(ValueError):
    """Nothing can be done in the scene as it is seen; the message says why."""


@dataclass(frozen=True)
class Rule:
    """A transition of the model (§2.10.5).

    Parameters
    ----------
    column : int
        In which it is reached.
    pair : tuple of str
        Whose relation changes.
    change : str
        Such as "NT".
    """

    column: int
    pair: tuple[str, str]
    change: str


@dataclass(frozen=True, eq=False)
class Skill:
    """What was learned of a dual-object manipulation: the model, and the anchor points of its demonstrations.

    Parameters
    ----------
    model : ActionModel
    rules : tuple of Rule
    prime, first, second : str
        Prime mover, first and second touched object.
    starts, touches, ends : Points
        D2, D3 (relative, along the connection vector) and D8.
    standoff_m : float
        From the border of the first object to the tip as it touches: the lower quartile of the demonstrations, as
        touching is perceived a little early where it is seen well.
    press_m : float
        By which the tip went beyond E₁ + Δ at the end of the second segment, mostly negative: the tip has a size (D7).
    side_rad : float
        Direction from the origin in which the tip touches, from the connection vector.
    speed_m_s : float
        Mean speed of the tip on the second segment.
    contact_gap_m : float
        Widest gap that was seen between first and second object while they stood touching in the end.
    hand : Hand, optional
        Relative pose between prime mover and first object, and what the fingers did.
    placed : Placed or None
        Relative pose between the objects in the end; None where it is not needed, as for pushing (§2.10).
    ground : str, optional
        What all things stand on: touching it is no touching of a second object.
    """

    model: ActionModel
    rules: tuple[Rule, ...]
    prime: str
    first: str
    second: str
    starts: Points
    touches: Points
    ends: Points
    standoff_m: float
    press_m: float
    side_rad: float
    speed_m_s: float
    contact_gap_m: float
    hand: Hand = field(default_factory=Hand)
    placed: Placed | None = None
    ground: str = TABLE


@dataclass(frozen=True)
class Step:
    """Moves of the arm that follow one rule.

    Parameters
    ----------
    rule : Rule
        If one motion reaches several, that of the objects, with the column of the last.
    moves : tuple of Move
    heading_rad : float
        Of the connection vector.
    column_is_last : bool
        Whether the model ends there.
    onward : tuple of float, optional
        Unit vector along which the last move may go on where the rule is not reached yet; all 0 if it may not. Along
        the heading if left out.
    """

    rule: Rule
    moves: tuple[Move, ...]
    heading_rad: float
    column_is_last: bool
    onward: Point | None = None


def rules_of(model: ActionModel) -> tuple[Rule, ...]:
    """Rules of a model: its transitions between N, T and A, column after column.

    Parameters
    ----------
    model : ActionModel
    """
    chain = model.chain
    rules = []
    for column in range(1, chain.relations.shape[1]):
        for row, (one, other) in enumerate(chain.pairs):
            before, after = (LETTER_OF[Relation(int(chain.relations[row, at]))] for at in (column - 1, column))
            if before != after:
                pair = (str(chain.names[int(one)]), str(chain.names[int(other)]))
                rules.append(Rule(column, pair, before + after))
    return tuple(rules)


def told(rule: Rule) -> str:
    """A rule in words, such as "{red box, robot arm} N→T"."""
    return "{" + ", ".join(sorted(rule.pair)) + "} " + "→".join(rule.change)
