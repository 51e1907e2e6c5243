"""Step 1: segments of every frame that keep their labels in time (§2.2), found here or taken over from a tracker."""

from sec_lab.segmentation.flow import optic_flow, warp_labels
from sec_lab.segmentation.potts import PottsParameters, lattice_energy, superparamagnetic_clustering
from sec_lab.segmentation.record import Segmentation, check_fit
from sec_lab.segmentation.tracking import (
    SegmentEvent,
    TrackedFrame,
    TrackingParameters,
    track_segments,
    tracked_frames,
)

__all__ = [
    "PottsParameters",
    "SegmentEvent",
    "Segmentation",
    "TrackedFrame",
    "TrackingParameters",
    "check_fit",
    "lattice_energy",
    "optic_flow",
    "superparamagnetic_clustering",
    "track_segments",
    "tracked_frames",
    "warp_labels",
]
