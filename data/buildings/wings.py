"""Wings joined end to end, each turned relative to the one before; between two lies a foyer that fills the gap.

Seen from above, the corridors of both wings open into the foyer (p: passages):

    +-----------------+--.
    |                 |   '-.  <- inner wall
    |   wing A        p       ' .
    |                 |     p    ' wing B
    +-----------------+--- .' <- outer wall
"""

from dataclasses import dataclass
from itertools import combinations

import numpy as np
import shapely

from ..errors import InputError
from ..scene import Mesh, Role
from .furnish import turned
from .prisms import slanted
from .shapes import pierced_block
from .works import Works

# Length of a foyer along its shorter side.
GAP_M = 1.5
# So much of their thickness the walls of a foyer reach into those of the wings: what is rounded in different frames
# leaves no slit then.
EMBED = 0.4
MOST_WINGS, STEEPEST_DEG = 12, 120.0
LETTERS = "ABCDEFGHIJKL"
WINDOW_M, WINDOW_MARGIN_M = 2.0, 1.0


@dataclass(frozen=True)
class Joint:
    """The gap between two wings, a trapezoid: the planes of their ends, and lines that join the ends' corners.

    In its own frame x points from the first wing to the next along the shorter side, and the trapezoid lies on one
    side of it; a depth is a distance from the shorter side.

    Attributes:
        frame: to the scene's, shape (4, 4).
        gap: length of the shorter side [m].
        depth: from there to the longer side [m].
        slope: by how much either end recedes for a metre of depth.
        left: whether the next wing turns left, so that the foyer lies to the right.
    """

    frame: np.ndarray
    gap: float
    depth: float
    slope: float
    left: bool

    def strip(
        self,
        depths: tuple[float, float],
        levels: tuple[float, float],
        embed: tuple[float, float] = (0.0, 0.0),
        holes: list[np.ndarray] | None = None,
    ) -> Mesh:
        """What lies between two depths and two levels, in the joint's frame.

        Args:
            depths: near and far [m].
            levels: bottom and top [m].
            embed: how far it reaches beyond the ends, into the wings, at the near and at the far depth [m].
            holes: boxes that are left out [m], each of shape (2, 3).
        """
        wide = [depth * self.slope + more for depth, more in zip(depths, embed, strict=True)]
        ends = [(-more, self.gap + more) for more in wide]
        (near, far), (one, other) = depths, ends
        if self.left:  # the trapezoid lies towards -y, so that the far depth is low
            (near, far), (one, other) = (-far, -near), (other, one)
        low = np.array([min(one[0], other[0]), near, levels[0]])
        high = np.array([max(one[1], other[1]), far, levels[1]])
        block = pierced_block(low, high, holes or [])
        return slanted(block, 0, (one[0], other[0]), (one[1], other[1]))

    def corners(self) -> np.ndarray:
        """The trapezoid in the scene's x and y [m], shape (4, 2)."""
        y = -self.depth if self.left else self.depth
        wide = self.depth * self.slope
        points = np.array([[0.0, 0.0], [self.gap, 0.0], [self.gap + wide, y], [-wide, y]])
        return points @ self.frame[:2, :2].T + self.frame[:2, 3]


def join_wings(
    size: tuple[float, float], count: int, angle_deg: float, first: np.ndarray, gap: float = GAP_M
) -> tuple[list[np.ndarray], list[Joint]]:
    """Frames of wings of one size, each joined by its west end to the east end of the one before.

    Args:
        size: length along x and width along y of a wing [m]; its south-west corner is its origin.
        count: wings, 1 to 12.
        angle_deg: by which each is turned counter-clockwise relative to the one before, -120 to 120.
        first: frame of the first wing, shape (4, 4).
        gap: between two wings where they are nearest [m].

    Raises:
        InputError: a number is out of range, or two wings would overlap.
    """
    if not 1 <= count <= MOST_WINGS:
        raise InputError(f"wings: expected 1 to {MOST_WINGS}, found {count}")
    if not abs(angle_deg) <= STEEPEST_DEG:
        raise InputError(f"wing_angle_deg: expected -{STEEPEST_DEG:g} to {STEEPEST_DEG:g}, found {angle_deg:g}")
    length, width = size
    half, left = np.radians(angle_deg) / 2, angle_deg >= 0
    hinge = width if left else 0.0
    slope, depth = abs(np.tan(half)), width * np.cos(half)
    across = np.eye(4)
    across[:2, 3] = gap, 0.0
    frames, joints = [first], []
    for _ in range(count - 1):
        corner = frames[-1] @ turned(np.array([length, hinge, 0.0]), half)
        joints.append(Joint(corner, gap, depth, slope, left))
        back = np.eye(4)
        back[1, 3] = -hinge
        frames.append(corner @ across @ turned(np.zeros(3), half) @ back)
    _check_clear(size, frames, joints, angle_deg)
    return frames, joints


def _check_clear(size: tuple[float, float], frames: list[np.ndarray], joints: list[Joint], angle_deg: float) -> None:
    """Raise InputError if two wings, or a wing and a foyer that does not end there, have ground in common."""
    corners = np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) * size
    ground = {f"wing {LETTERS[n]}": corners @ f[:2, :2].T + f[:2, 3] for n, f in enumerate(frames)}
    beside = {tuple(LETTERS[n : n + 2]): f"foyer {LETTERS[n]}-{LETTERS[n + 1]}" for n in range(len(joints))}
    ground |= {name: joint.corners() for name, joint in zip(beside.values(), joints, strict=True)}
    shapes = {name: shapely.Polygon(points) for name, points in ground.items()}
    touch = {frozenset((f"wing {wing}", name)) for wings, name in beside.items() for wing in wings}
    for one, other in combinations(shapes, 2):
        if frozenset((one, other)) not in touch and shapes[one].intersects(shapes[other]):
            raise InputError(
                f"wings: expected wings that stand clear of each other, found {one} and {other} in one place "
                f"with {len(frames)} wings at {angle_deg:g} degrees"
            )


def build_foyer(works: Works, joint: Joint, name: str, levels: list[tuple[float, float]], wall: float) -> None:
    """Walls, slabs, roof, window and room of the foyers between two wings.

    Args:
        works: what they are added to.
        joint: where.
        name: of the foyer.
        levels: floor and ceiling of each storey [m]; between two storeys lies a slab.
        wall: thickness of the walls, and of slab and roof if there is one storey [m].
    """
    slab = levels[1][0] - levels[0][1] if len(levels) > 1 else wall
    whole, outer = (0.0, joint.depth), (joint.depth - wall, joint.depth)
    # At the far corners nothing may reach beyond the wings' faces.
    embed = (EMBED * wall, 0.0)
    for number, (floor, ceiling) in enumerate(levels, start=1):
        here = f"{name} {number}"
        works.put("IfcSlab", f"slab {here}", joint.strip(whole, (floor - slab, floor), embed), joint.frame)
        inner = joint.strip((0.0, wall), (floor, ceiling), (embed[0], embed[0]))
        works.put("IfcWall", f"inner wall of {here}", inner, joint.frame)
        holes = _windows(joint, outer, floor)
        works.put("IfcWall", f"outer wall of {here}", joint.strip(outer, (floor, ceiling), embed, holes), joint.frame)
        for hole in holes:
            pane = hole.copy()
            pane[:, 1] = hole[:, 1].mean() + np.array([-0.5, 0.5]) / 32
            works.open(hole, joint.frame)
            works.put("IfcWindow", f"window of {here}", pierced_block(*pane, []), joint.frame, Role.TRANSPARENT)
        works.room(here, joint.strip((wall, joint.depth - wall), (floor, ceiling)), joint.frame)
    top = levels[-1][1]
    works.put("IfcRoof", f"roof of {name}", joint.strip(whole, (top, top + slab), embed), joint.frame)


def _windows(joint: Joint, depths: tuple[float, float], floor: float) -> list[np.ndarray]:
    """A window in the middle of the outer wall, if that is long enough; shape (2, 3) [m]."""
    if joint.gap + 2 * depths[0] * joint.slope < WINDOW_M + 2 * WINDOW_MARGIN_M:
        return []
    ends = sorted(-depth if joint.left else depth for depth in depths)
    middle = joint.gap / 2
    box = [[middle - WINDOW_M / 2, ends[0], floor + 1.0], [middle + WINDOW_M / 2, ends[1], floor + 68 / 32]]
    return [np.array(box)]
