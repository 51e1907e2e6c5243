"""Label masks of any tracker: what DAVIS, SAM 2, XMem, Cutie, MOTS, COCO, YouTube-VIS, SA-V and NumPy users write."""

from sec_lab.segmentation.masks.objects import ObjectMasks, flatten
from sec_lab.segmentation.masks.reading import open_masks, open_objects
from sec_lab.segmentation.masks.writing import write_palette_pngs

__all__ = ["ObjectMasks", "flatten", "open_masks", "open_objects", "write_palette_pngs"]
