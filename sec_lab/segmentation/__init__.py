"""Step 1: segments of every frame that keep their labels in time (§2.2), found here or taken over from a tracker."""

from sec_lab.segmentation.potts import PottsParameters, superparamagnetic_clustering
from sec_lab.segmentation.record import Segmentation, check_fit

__all__ = ["PottsParameters", "Segmentation", "check_fit", "superparamagnetic_clustering"]
