"""How far on an image a point moves between the middle of a view cell and its eyes: the error of depth meshes.

The middle of the cell sees a point in the direction of a unit vector u at a distance t; with q = 1 / t an eye at o from
there sees it in that of v(q) = u - q o. With q, v turns by |v x v'| / |v|^2 = |o| sin a / (1 - 2 s cos a + s^2), a
the angle between u and o and s = q |o| < 1; that is greatest where cos a = 2 s / (1 + s^2), namely |o| / (1 - s^2). So
a point that is drawn at q' in place of q, both at most 1 / near, is off by an angle of at most

    |o| |q - q'| / (1 - (|o| / near)^2).

Texels of parallax, p = f rho / z with the focal length f [texels], the cell's half diagonal rho >= |o| and the depth z
along the axis of a face, keep planes planar. As q = f / |(x, y, f)| / z <= p / (f rho), an error of e in p is seen as
one of at most e |o| / rho / (1 - (rho / near)^2) texels in the middle of a face's image, whichever way the eye looks.
At the middle of the cell nothing is off.

The paper (Aliaga et al. 1999, section 3.3) measures its skins, the stretch between neighbouring pixels, in this unit.
"""

from dataclasses import dataclass

import numpy as np

from ...data.camera import Screen

# Factor that covers rounding of all that follows.
ROUNDING = 1 + 2.0**-40


@dataclass(frozen=True)
class EyeRange:
    """Where the eyes of a view cell are, and how near what stands on its depth meshes may be.

    Attributes:
        reach: rho, from the middle of the cell to its corners, > 0.
        near: half the size of the cull box, above `reach`, in the same unit.
        focal: of the faces' images [texels].
    """

    reach: float
    near: float
    focal: float

    def parallax(self, inverse_depths: np.ndarray) -> np.ndarray:
        """Texels of parallax of points whose depths have these inverses, any shape; 0 for what is nowhere."""
        return self.focal * self.reach * inverse_depths

    def worst(self, error: float) -> float:
        """The most that an error in parallax is off by for an eye at a corner of the cell [texels]."""
        return error / (1 - (self.reach / self.near) ** 2) * ROUNDING

    def on_screen(self, error: float, screen: Screen) -> float:
        """The same [pixels], wherever on a screen; its corners stretch angles by 1 + T^2, T their tangent."""
        angle = self.worst(error) / self.focal
        corner = np.hypot(screen.width, screen.height) / (2 * screen.focal)
        if angle >= np.pi / 2 - np.arctan(corner):
            return float(np.inf)
        return float(screen.focal * (np.tan(np.arctan(corner) + angle) - corner) * ROUNDING)
