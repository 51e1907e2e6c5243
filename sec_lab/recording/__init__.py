"""Recordings: movies, stereo movies and picture folders with or without depth, read frame by frame (before step 1)."""

from sec_lab.recording.calibration import Calibration, read_calibration
from sec_lab.recording.record import Frame, Recording
from sec_lab.recording.writing import write_movie

__all__ = ["Calibration", "Frame", "Recording", "read_calibration", "write_movie"]
