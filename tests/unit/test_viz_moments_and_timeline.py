"""Pictures of some moments of a movie, and of its events over time."""

import numpy as np
import pytest

from sec_lab.observation import Observation
from sec_lab.pipeline import observe
from sec_lab.recording import Recording
from sec_lab.segmentation import Segmentation
from sec_lab.takes_and_puts import match_events
from sec_lab.viz.moments import draw_moments
from sec_lab.viz.style import figure_of, png_bytes
from sec_lab.viz.timeline import draw_events


def movie() -> tuple[Recording, Observation]:
    labels = np.ones((4, 30, 40), dtype=np.uint8)
    labels[:, 10:20, 5:15] = 2
    labels[2:, 10:20, 15:25] = 3
    seen = observe(Segmentation.from_labels(labels, background=1), over_time=None)
    return Recording.from_frames(np.full((4, 30, 40, 3), 90, dtype=np.uint8)), seen


def test_a_moment_shows_the_segments_of_its_frame() -> None:
    recording, seen = movie()
    figure = draw_moments(seen, recording, {1: "before", 3: "after"}, n_columns=2)
    before, after = figure.axes
    assert [text.get_text() for text in before.texts] == ["2"]
    assert [text.get_text() for text in after.texts] == ["2", "3"]
    assert after.get_title(loc="left") == "after"
    # 2 and 3 touch from frame 2 on.
    assert [patch.get_gid() for patch in after.patches] == ["casing", "touching"]
    png_bytes(figure)


def test_moments_that_do_not_exist_are_refused() -> None:
    recording, seen = movie()
    with pytest.raises(ValueError, match="moments: expected frames of the movie that have a label image, got 9"):
        draw_moments(seen, recording, {1: "before", 9: "after"})
    with pytest.raises(ValueError, match="moments: expected at least one"):
        draw_moments(seen, recording, {})
    bare = Observation(seen.graphs, seen.key_frames)
    with pytest.raises(ValueError, match="moments: expected an observation with its segmentation"):
        draw_moments(bare, recording, {1: "before"})


def test_events_stand_at_their_frames() -> None:
    agreement = match_events([("put", 42), ("put", 90)], [("take", 9), ("put", 40)], tolerance_frames=5)
    ax = draw_events(agreement, n_frames=100, spans=[(5, 20)], spans_name="hand")
    drawn = {line.get_label(): (list(line.get_xdata()), list(line.get_ydata())) for line in ax.get_lines()}
    # Rows: take 0, put 1.
    assert drawn == {"true": ([40, 9], [1, 0]), "found, a hit": ([42], [1]), "found, false": ([90], [1])}
    assert ax.get_xlim() == (0, 100)
    legend = ax.get_legend()
    assert legend is not None
    assert [text.get_text() for text in legend.get_texts()] == ["hand", "true", "found, a hit", "found, false"]
    png_bytes(figure_of(ax))


def test_no_event_is_refused() -> None:
    with pytest.raises(ValueError, match="events: expected at least one"):
        draw_events(match_events([], [], tolerance_frames=1), n_frames=10)
