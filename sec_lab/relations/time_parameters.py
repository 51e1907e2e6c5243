"""What decides how steady relations are over time, with the reason for every default."""

from dataclasses import dataclass, replace

import numpy as np

from sec_lab.relations.depth import CONTACT_STEP_M, SKIP_PX

_TUNED_AT_FPS = 25.0
_IN_FRAMES = (
    "hysteresis_frames",
    "together_frames",
    "hold_frames",
    "min_life_frames",
    "motion_frames",
    "pause_frames",
)


@dataclass(frozen=True, kw_only=True)
class TimeParameters:
    """Rules by which relations hold over time; each can be switched off. Frames are those of a movie at 25 per second.

    Parameters
    ----------
    hysteresis_frames : int
        Frames for which a change must last to count; it is then dated to the frame at which it began. A third of a
        second: a hand needs longer to take or to put, flicker at borders is shorter. 0: every frame counts.
    together_frames : int
        Changes that begin within so many frames are one event and share a key frame: which of them came first by a
        fifth of a second is chance. 0: off.
    touching_thresholds, overlapping_thresholds : tuple of float
        Normalized counters of A.1 (scan lines) that a relation needs to go on, and that it needs to begin. Equal: off.
    step_m : float or None
        Largest step in depth of segments in contact, where depth is known, see
        :data:`~sec_lab.relations.depth.CONTACT_STEP_M`. Where too little is known, a relation stays as it is; of what
        rests from the beginning, the picture alone decides. None: depth is not used.
    skip_px : int
        See :data:`~sec_lab.relations.depth.SKIP_PX`.
    smear_spreads : float or None
        Stereo smears the nearer of two surfaces over the farther one, far over one without texture. So where segments
        seem to be in contact by depth, what is nearer than the plane through its segment, by more than so many standard
        deviations of what lies close to it (in inverse depth), is smear, and the plane counts; on the side whose plane
        is the farther one. It parts what seems to touch and never the other way round. 1.5: less than one pixel in ten
        of a flat thing is nearer by its noise alone. None: depth as it was measured.
    hold_frames : int
        A segment that is hidden keeps its relations for so many frames; then it is absent. 0: absent at once.
    leaving_share : float
        A segment that touched the border of the picture, moved and showed no more than this share of its greatest size
        when it was last seen, has left through the border and is absent without being held. Going out takes several
        frames, in which it shrinks; what is lost at full size was lost by the tracker. 1: the size does not matter.
    crumb_share : float
        A segment that was leaving is not back if no more than this share of its greatest size is seen away from the
        border: what a tracker takes for it there is the rim of something that it uncovered. 0: off.
    visible_share : float
        A segment that shows less than this share of its greatest size says nothing of its contacts: what is seen of
        its border is not where it touches. Its relations stay. 0: off.
    min_life_frames : int
        Frames for which a segment must be seen to become a node at all, from its first frame on. Half a second: hands
        and things stay for longer, splinters of a segmentation mostly not. 1: off.
    motion_frames : int
        Frames over which motion is measured.
    rest_px : float or None
        Largest mean shift of the border of a segment, against what rests, over ``motion_frames`` for it to rest. A
        shift by d pixels moves the border by about d / 2 in the mean, so 1.3 is some 8 pixels a second; borders that
        tremble by a pixel stay below. A bar that comes straight in from the border of the picture hardly moves its
        sides and may seem to rest; a hand with fingers does not. None: motion is not measured, and without it the four
        rules below are off unless motion is given with the frames.
    pause_frames : int
        What reaches in from the border of the picture and has moved only pauses when it stands still for less than so
        many frames, and a pause begins and ends no contact with the background: an arm that pours does not come to lie
        on the table below. 0: off.
    freeze : bool
        Two segments that both rest, the smaller one next to something that moves and may hide it, keep their relation.
        Off by default: it keeps wrong relations as well, until the hand has gone, and what it is good for the next rule
        does better.
    contact_by_motion : bool
        Of two segments in contact, both move or both rest: where one moves and the other rests, they are apart. This is
        what tells a hand above a cup from a hand that takes it without any depth, and what keeps borders smeared by
        stereo from making contacts. Things that slide count as lifted, and what has just appeared as moving.
    carried : bool
        A segment that has left its place by more than its own radius is carried by the largest moving segment it
        borders on, however little of it is seen.
    kind_at_rest : bool
        Overlapping is told from touching only between segments that rest and are not next to something that moves;
        contact with what moves is touching. Which of the two a hand shows depends on whether it comes in from the
        border of the picture and on where its fingers happen to be.

    Raises
    ------
    ValueError
        If a parameter is negative or not finite, a threshold to begin is below that to go on, or a share is above 1.

    Examples
    --------
    >>> TimeParameters(hysteresis_frames=5).hold_frames
    60
    """

    hysteresis_frames: int = 8
    together_frames: int = 5
    touching_thresholds: tuple[float, float] = (0.02, 0.05)
    overlapping_thresholds: tuple[float, float] = (0.3, 0.5)
    step_m: float | None = CONTACT_STEP_M
    skip_px: int = SKIP_PX
    smear_spreads: float | None = 1.5
    hold_frames: int = 60
    leaving_share: float = 0.5
    crumb_share: float = 0.02
    visible_share: float = 0.3
    min_life_frames: int = 12
    motion_frames: int = 8
    rest_px: float | None = 1.3
    pause_frames: int = 50
    freeze: bool = False
    contact_by_motion: bool = True
    carried: bool = True
    kind_at_rest: bool = True

    def __post_init__(self) -> None:
        for name in (*_IN_FRAMES, "skip_px"):
            least = 1 if name in ("min_life_frames", "motion_frames") else 0
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < least:
                raise ValueError(f"{name}: expected a whole number from {least} on, got {value!r}")
        for name in ("step_m", "smear_spreads", "rest_px"):
            value = getattr(self, name)
            if value is not None and not (np.isfinite(value) and value >= 0):
                raise ValueError(f"{name}: expected a finite number from 0 on or None, got {value!r}")
        for name in ("leaving_share", "crumb_share", "visible_share"):
            if not 0 <= getattr(self, name) <= 1:
                raise ValueError(f"{name}: expected a share from 0 to 1, got {getattr(self, name)!r}")
        for name in ("touching_thresholds", "overlapping_thresholds"):
            stay, begin = getattr(self, name)
            if not (np.isfinite(begin) and 0 <= stay <= begin):
                raise ValueError(f"{name}: expected (to go on, to begin), ascending from 0 on, got {(stay, begin)}")


PICTURE_ALONE = TimeParameters(
    hysteresis_frames=0,
    together_frames=0,
    touching_thresholds=(0.02, 0.02),
    overlapping_thresholds=(0.4, 0.4),
    step_m=None,
    smear_spreads=None,
    hold_frames=0,
    visible_share=0.0,
    leaving_share=1.0,
    crumb_share=0.0,
    min_life_frames=1,
    rest_px=None,
    pause_frames=0,
)
"""All rules off: the relations of every single picture as :func:`~sec_lab.relations.scan_line_relations` finds them."""


def at_frame_rate(parameters: TimeParameters, frames_per_second: float) -> TimeParameters:
    """The same times for a movie with another number of frames per second than 25.

    Parameters
    ----------
    parameters : TimeParameters
        For 25 frames per second.
    frames_per_second : float

    Returns
    -------
    TimeParameters
        A rule that is on stays on: it has at least one frame.

    Raises
    ------
    ValueError
        If the frame rate is not a positive, finite number.

    Examples
    --------
    >>> at_frame_rate(TimeParameters(hysteresis_frames=8), 50).hysteresis_frames
    16
    """
    if not (np.isfinite(frames_per_second) and frames_per_second > 0):
        raise ValueError(f"frames_per_second: expected a finite number above 0, got {frames_per_second}")
    factor = frames_per_second / _TUNED_AT_FPS
    scaled = {name: getattr(parameters, name) for name in _IN_FRAMES}
    return replace(parameters, **{name: max(min(n, 1), round(n * factor)) for name, n in scaled.items()})
