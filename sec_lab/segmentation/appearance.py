"""How pictures are looked at: colours as differences are seen, and what may lie behind things."""

import numpy as np
from numpy.typing import NDArray

Lab = NDArray[np.uint8]


def smoothed_lab(image: NDArray[np.uint8]) -> Lab:
    """CIE L*a*b* of an RGB picture as OpenCV codes it (0 to 255 each), noise reduced a little."""
    import cv2

    return np.asarray(cv2.GaussianBlur(cv2.cvtColor(image, cv2.COLOR_RGB2LAB), (3, 3), 0.7))


def background_behind(picture: NDArray[np.float32], hidden: NDArray[np.uint8]) -> NDArray[np.float32]:
    """What may lie behind hidden pixels: the mean of what is seen around, from as near as possible."""
    import cv2

    known = (hidden == 0).astype(np.float32)
    filled, done, sigma = picture.copy(), known > 0, 4.0
    while not done.all() and sigma < max(picture.shape):
        weight = cv2.GaussianBlur(known, (0, 0), sigma)
        mean = cv2.GaussianBlur(picture * known[..., None], (0, 0), sigma)
        new = (weight > 0.02) & ~done
        filled[new] = mean[new] / weight[new][:, None]
        done |= new
        sigma *= 2
    return filled
