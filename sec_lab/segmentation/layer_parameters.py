"""Parameters of the layered segmentation, one set for every movie."""

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class LayerParameters:
    """Parameters of the layered segmentation."""

    static_cost: float = 4.2
    unknown_cost: float = 12.0
    lightness_sigma: float = 3.0
    chroma_sigma: float = 1.4
    shadow_sigma: float = 5.0
    shadow_cost: float = 6.0
    prediction_cost: float = 2.0
    far_cost: float = 5.0
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


DEFAULT = LayerParameters()
