"""Cameras: a screen, the eyes and directions along a path, and where boxes fall on the screen.

Metres, Z up. Camera coordinates are right, up and forward of the eye; on the screen x runs to the right and y up, in
pixels from its middle.
"""

from dataclasses import dataclass
from itertools import product

import numpy as np

from .errors import InputError

# Nearer to the eye, along the direction of view, nothing is drawn.
NEAR_M = 0.01
# Rectangles on the screen are this much larger than computed [pixels]: far more than float64 errs.
ROUNDING_PIXELS = 1.0e-3
PIXELS_MOST = 2**26
# Rays across a rectangle, each way, to tell how much of it a box covers.
RAYS = 8
# Boxes whose rays are cast together.
BOXES = 256
CORNERS = np.array(list(product((0, 1), repeat=3)))
EDGES = np.array([(a, b) for a in range(8) for b in range(a) if np.abs(CORNERS[a] - CORNERS[b]).sum() == 1])


@dataclass(frozen=True)
class Screen:
    """What a frame is drawn on.

    Attributes:
        width: [pixels].
        height: [pixels].
        fov_deg: vertical field of view.

    Raises:
        InputError: a size below 1, too many pixels, or a field of view that is not between 0 and 180 degrees.
    """

    width: int = 640
    height: int = 480
    fov_deg: float = 60.0

    def __post_init__(self) -> None:
        if min(self.width, self.height) < 1 or self.width * self.height > PIXELS_MOST:
            raise InputError(
                f"image: expected at least 1x1 and at most {PIXELS_MOST:,} pixels, found {self.width}x{self.height}"
            )
        if not 0 < self.fov_deg < 180:
            raise InputError(f"fov: expected degrees between 0 and 180, found {self.fov_deg}")

    @property
    def focal(self) -> float:
        """Distance from the eye at which a metre is a metre's worth of pixels: half the height over the tangent."""
        return self.height / 2 / np.tan(np.radians(self.fov_deg) / 2)


@dataclass(frozen=True)
class CameraPath:
    """Eyes and directions of view, one per frame.

    Attributes:
        eyes: [m], relative to the model's origin, shape (frames, 3), float64.
        yaw_deg: from the x axis towards the y axis, shape (frames,), float64.
        pitch_deg: upwards, shape (frames,), float64.
        t: time [s], ascending, shape (frames,), float64.
    """

    eyes: np.ndarray
    yaw_deg: np.ndarray
    pitch_deg: np.ndarray
    t: np.ndarray

    def __len__(self) -> int:
        return len(self.eyes)

    def axes(self) -> np.ndarray:
        """Right, up and forward of each frame as rows, shape (frames, 3, 3), float64."""
        yaw, pitch = np.radians(self.yaw_deg), np.radians(self.pitch_deg)
        out = np.zeros((len(yaw), 3, 3))
        right, up, forward = out[:, 0], out[:, 1], out[:, 2]
        right[:, 0], right[:, 1] = np.sin(yaw), -np.cos(yaw)
        forward[:, 2], level = np.sin(pitch), np.cos(pitch)
        forward[:, 0], forward[:, 1] = -right[:, 1] * level, right[:, 0] * level
        # Right times forward, of which right has no height.
        up[:, 0], up[:, 1] = right[:, 1] * forward[:, 2], -right[:, 0] * forward[:, 2]
        up[:, 2] = right[:, 0] * forward[:, 1] - right[:, 1] * forward[:, 0]
        return out


def project_boxes(screen: Screen, eyes: np.ndarray, axes: np.ndarray, boxes: np.ndarray) -> np.ndarray:
    """Rectangles on the screen's plane that hold all of each box that lies beyond the near plane.

    Args:
        screen: gives the focal length; rectangles are not cut to it.
        eyes: [m], shape (n, 3), float64.
        axes: shape (n, 3, 3), float64, of `CameraPath.axes`.
        boxes: low and high corners [m], shape (n, 2, 3), float64.

    Returns:
        Low and high corner [pixels from the middle], shape (n, 2, 2), float64; low above high for a box that lies
        before the near plane. Never smaller than the truth.
    """
    rows = np.arange(len(boxes))[:, None, None]
    corners = boxes[rows, CORNERS, np.arange(3)] - eyes[:, None]
    local = np.einsum("nij,nkj->nki", axes, corners)
    near, far = local[:, EDGES[:, 0]], local[:, EDGES[:, 1]]
    swap = near[..., 2:] > far[..., 2:]
    near, far = np.where(swap, far, near), np.where(swap, near, far)
    run = far[..., 2] - near[..., 2]
    crosses = (near[..., 2] < NEAR_M) & (far[..., 2] >= NEAR_M)
    part = np.divide(NEAR_M - near[..., 2], run, out=np.zeros_like(run), where=crosses)
    near = near + part[..., None] * (far - near)
    points = np.concatenate([near, far], axis=1)
    depth = points[..., 2:]
    drawn = np.concatenate([far[..., 2:] >= NEAR_M] * 2, axis=1)
    # A point moved onto the near plane lies there up to rounding.
    place = screen.focal * points[..., :2] / np.maximum(depth, NEAR_M)
    low = np.where(drawn, place, np.inf).min(axis=1) - ROUNDING_PIXELS
    high = np.where(drawn, place, -np.inf).max(axis=1) + ROUNDING_PIXELS
    return np.stack([low, high], axis=1)


def on_screen(screen: Screen, rectangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """What of rectangles of `project_boxes` is on the screen.

    Returns:
        Rectangles cut to the screen, shape (n, 2, 2), float64; and whether anything is left, shape (n,), bool: a box
        of which anything is in the view frustum is never called outside.
    """
    half = np.array([screen.width, screen.height]) / 2
    cut = np.stack([np.maximum(rectangles[:, 0], -half), np.minimum(rectangles[:, 1], half)], axis=1)
    return cut, (cut[:, 0] <= cut[:, 1]).all(axis=1)


def covered_pixels(
    screen: Screen, eyes: np.ndarray, axes: np.ndarray, boxes: np.ndarray, rectangles: np.ndarray
) -> np.ndarray:
    """About how many pixels boxes cover: the area of their rectangles times the share of 8 x 8 rays that meet the box.

    Args:
        screen: gives the focal length.
        eyes: as for `project_boxes`.
        axes: likewise.
        boxes: likewise.
        rectangles: cut to the screen, of `on_screen`, shape (n, 2, 2).

    Returns:
        Shape (n,), float64, at least 1.
    """
    area = (rectangles[:, 1] - rectangles[:, 0]).prod(axis=1)
    hits = np.zeros(len(boxes))
    low, high = boxes[:, 0] - eyes, boxes[:, 1] - eyes
    steps = (np.arange(RAYS) + 0.5) / RAYS
    grid = np.array(list(product(steps, steps)))
    # All rays of a few boxes at a time: numbers that a cache holds, and calls that do not outweigh them.
    for first in range(0, len(boxes), BOXES):
        some = slice(first, first + BOXES)
        corner, size = rectangles[some, 0], rectangles[some, 1] - rectangles[some, 0]
        right, up = (corner[:, k, None] + size[:, k, None] * grid[:, k] for k in range(2))
        enter, leave = np.full(right.shape, -np.inf), np.full(right.shape, np.inf)
        for k in range(3):
            own = axes[some, :, k, None]
            rays = right * own[:, 0] + up * own[:, 1] + screen.focal * own[:, 2]
            # A ray along a face's plane must not divide by 0.
            rays[np.abs(rays) < 1e-12] = 1e-12
            near, far = low[some, k, None] / rays, high[some, k, None] / rays
            np.maximum(enter, np.minimum(near, far), out=enter)
            np.minimum(leave, np.maximum(near, far), out=leave)
        hits[some] = ((leave >= enter) & (leave > 0)).sum(axis=1)
    return np.maximum(area * hits / RAYS**2, 1.0)
