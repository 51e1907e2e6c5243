"""What the benches call ours: the default segmentation, and the chains from pixels and from the truth."""

from importlib.util import find_spec

import pytest

import sec_lab as sl
from sec_lab.observation import Observation
from sec_lab.recording import Recording
from sec_lab.segmentation import Segmentation
from tests.benchmarks.movies import Movie

READY = hasattr(sl, "observe") and find_spec("sec_lab.segmentation.layers") is not None

needed = pytest.mark.skipif(not READY, reason="sl.observe or its default segmentation is not there")


def segmentation_of(recording: Recording) -> Segmentation:
    """Step 1 with its defaults."""
    from sec_lab.pipeline import segmenter

    return segmenter("layers")(recording)


def from_pixels(movie: Movie) -> Observation:
    return sl.observe(movie.recording)


def from_truth(movie: Movie) -> Observation:
    """True labels and true depth through the same rules."""
    labels = Segmentation.from_labels(movie.labels, background=movie.background)
    if not READY:
        return sl.observe_segments(labels)
    recording = Recording.from_frames(
        movie.pictures, depth=movie.depth_m, frames_per_second=movie.recording.frames_per_second
    )
    return sl.observe(recording, segmentation=labels)
