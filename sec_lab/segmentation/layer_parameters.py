"""Parameters of the layered segmentation, one set for every movie, with the reason for every default."""

import math
from dataclasses import dataclass, fields

from sec_lab.codes import as_integers

_LONGEST = 250
"""Frames at rest are counted up to here, in 8 bits."""

_WHOLE = {
    "reach_px": (0, 100),
    "sweeps": (0, 1000),
    "settle_frames": (1, _LONGEST),
    "wait_frames": (0, _LONGEST),
    "moved_by": (0, 255),
    "young_frames": (0, math.inf),
    "opening_frames": (1, math.inf),
}
_SIGMAS = ("lightness_sigma", "chroma_sigma")
_SHARES = ("memory", "least_share", "new_share", "inner_share", "close_share")


@dataclass(frozen=True, kw_only=True)
class LayerParameters:
    """How the layers of a scene are told apart.

    Costs are minus logarithms of densities of colours, in CIE L*a*b* as OpenCV codes it (0 to 255 each). Under uniform
    noise a colour costs 16, the largest cost there is. Frames are those of a movie at 25 per second.

    Parameters
    ----------
    static_cost : float, optional
        Of a pixel that looks as it did at rest; more is added as it differs. A normal density with the two standard
        deviations below has ln((2π)^1.5 · 3 · 1.4²) ≈ 4.5 at its middle; what rests is given a small advantage.
    unknown_cost : float, optional
        Of something that no layer explains. 8 more than ``static_cost`` are 4 standard deviations of noise; and no
        colour that a moving segment shows often costs as much.
    lightness_sigma, chroma_sigma : float, optional
        Standard deviations of noise of a smoothed pixel, in lightness and in each of a* and b*. Compression and
        flicker are in lightness more than in chroma.
    shadow_sigma : float, optional
        Added to both for a shade of 0 (black): a shadow of 30 % adds 1.5. Shadows change colours, too, as other light
        falls into them.
    shadow_cost : float, optional
        Of a shade of 0; a shadow of 30 % costs 1.7, so that a shadow is preferred to something unknown and no shadow
        to a shadow.
    prediction_cost : float, optional
        Of what rests, where the optic flow says that something else comes: the table is not to show through a hand of
        its colour.
    far_cost : float, optional
        Of a carried segment farther than ``reach_px`` from where it is expected. It may come to light there, from
        under the hand, but not by noise.
    hidden_cost : float, optional
        The same of a segment of which little is to be seen: it has to be somewhere.
    fitting_cost : float, optional
        Mean cost of colours up to which a part of the picture may belong to a segment. Colours of one thing cost 4 to 9
        under what was learned of it, those of another one 12 to 16.
    reach_px : int, optional
        How far beyond its expected place a moving segment may grow from frame to frame, in pixels: errors of the flow.
    sweeps : int, optional
        Relaxations of the lattice per frame. Hardly a pixel changes after four.
    bond : float, optional
        Cost of a bond between neighbours of one colour with different labels; 0.15 of it between unlike ones. Eight
        of them, 6.4, outweigh the noise of a single pixel, while a border along an edge is almost free.
    settle_frames : int, optional
        Frames at rest after which a pixel becomes part of the static scene, up to 250: 0.4 s, longer than a hand that
        puts something down holds still.
    wait_frames : int, optional
        Frames for which something unknown, or left behind by what moves, must be at rest before it is given a segment,
        up to 250. Shorter than ``settle_frames``, so that nothing settles under the label of the hand.
    moved_by : int, optional
        Step of lightness from frame to frame that counts as motion, above noise and compression (almost three
        ``lightness_sigma``).
    memory : float, optional
        Share of the learned colours kept from frame to frame. 0.96: after 17 frames half of them are newer, so that a
        turning hand is still known and a shadow on it not for long.
    least_share : float, optional
        Smallest part that may stand for itself, as a share of the picture: 20 pixels of 320×256.
    new_share : float, optional
        Smallest new segment inside the picture, as a share of the picture: 98 pixels of 320×256. Smaller ones are
        mostly highlights and rims.
    inner_share : float, optional
        Share of pixels more than two away from the border that a new segment must have: rims are thin, things are not.
        A thinner part that nothing explains is shared out among what is around it.
    close_share : float, optional
        Distance up to which a segment is near by, as a share of the longer side: 26 pixels of 320×256, a hand's step in
        two or three frames.
    touched_cost : float, optional
        Of what rests and is next to a mover, elsewhere than where it rests: it may be taken, but is not yet. Twice that
        where it rests: what looks otherwise there is mostly something before it.
    young_frames : int, optional
        Frames for which a mover that has just come in takes in unknown colours next to it: half a second, in which a
        hand and its arm come to be seen.
    opening_frames : int, optional
        Frames read before the first one is labelled, over which depth is the median, which nearly halves its
        noise.

    Raises
    ------
    ValueError
        If a value is not finite, a cost is negative, a standard deviation not above 0, a share not from 0 to 1, or a
        whole number out of its range.

    Examples
    --------
    >>> LayerParameters(settle_frames=25).settle_frames
    25
    >>> LayerParameters(memory=1.5)
    Traceback (most recent call last):
    ...
    ValueError: memory: expected a share from 0 to 1, got 1.5
    """

    static_cost: float = 4.2
    unknown_cost: float = 12.0
    lightness_sigma: float = 3.0
    chroma_sigma: float = 1.4
    shadow_sigma: float = 5.0
    shadow_cost: float = 6.0
    prediction_cost: float = 2.0
    far_cost: float = 5.0
    hidden_cost: float = 3.0
    fitting_cost: float = 10.0
    reach_px: int = 4
    sweeps: int = 4
    bond: float = 0.8
    settle_frames: int = 10
    wait_frames: int = 8
    moved_by: int = 8
    memory: float = 0.96
    least_share: float = 0.00025
    new_share: float = 0.0012
    inner_share: float = 0.3
    close_share: float = 0.08
    touched_cost: float = 2.0
    young_frames: int = 12
    opening_frames: int = 5

    def __post_init__(self) -> None:
        for name, (low, high) in _WHOLE.items():
            whole = int(as_integers(getattr(self, name), what=name, ndim=0))
            if not low <= whole <= high:
                told = f"from {low} on" if high == math.inf else f"from {low} to {high}"
                raise ValueError(f"{name}: expected a whole number {told}, got {whole}")
            object.__setattr__(self, name, whole)
        for name in (field.name for field in fields(self) if field.name not in _WHOLE):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
                raise ValueError(f"{name}: expected a finite number, got {value!r}")
            if name in _SHARES and not 0 <= value <= 1:
                raise ValueError(f"{name}: expected a share from 0 to 1, got {value}")
            if name in _SIGMAS and value <= 0:
                raise ValueError(f"{name}: expected a number above 0, got {value}")
            if value < 0:
                raise ValueError(f"{name}: expected a number from 0 on, got {value}")


DEFAULT = LayerParameters()
"""Parameters where none are said."""
