"""Step 1: segments of every frame that keep their labels in time (§2.2); so far, taken over from any other tracker."""

from sec_lab.segmentation.record import Segmentation, check_fit

__all__ = ["Segmentation", "check_fit"]
