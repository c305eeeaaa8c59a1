"""Folders whose tables are in a frame of their own: moved to a whole number of metres, and turned back."""

from pathlib import Path

import numpy as np

from ..scene import turned


class FramedFolder:
    """A folder with a manifest that says where its tables lie in the model's own coordinates.

    Attributes:
        folder: where it is stored.
        manifest: contents of manifest.json.
        grid_m: grid step [m].
        origin: whole metres subtracted from the model's coordinates, float64 x 3.
        yaw_deg: the model was then turned back by this about the vertical [degrees].
    """

    def __init__(self, folder: Path, manifest: dict) -> None:
        self.folder = folder
        self.manifest = manifest
        self.grid_m = float(manifest["grid_m"])
        self.origin = np.array(manifest["origin"], np.float64)
        # Older folders do not say, as nothing was turned.
        self.yaw_deg = float(manifest.get("yaw_deg", 0.0))

    def in_model(self, points: np.ndarray) -> np.ndarray:
        """Points of the folder's tables [m] in the model's own coordinates, shape (..., 3), float64.

        A direction is the difference of two points.
        """
        return turned(np.asarray(points, np.float64), self.yaw_deg) + self.origin
