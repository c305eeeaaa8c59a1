"""Frames of their own for view cells at an angle: what hides around them along the axes of their own walls.

From a room of a turned wing its walls are curtains, whose ways past are relaxed and many. In the frame of the wing they
are axial rectangles, which the line search decides exactly and fast. A linear map of space takes lines to lines, so
what no line reaches there is hidden here too, if boxes are rounded outwards on the grid of the frame, and every
rectangle lies in a solid of the model as it is snapped: sections of closed elements are found in the frame, and kept
where no triangle of their element comes near. Levels stay levels: slabs hide in the frame as they are.

What is left is for the search in the model's own frame, where faces and joints are exact. Source of the idea, a frame
for each part of a semi-axial model: Lei and Ouhyoung, "Carving", section 2.
"""

from dataclasses import dataclass

import numpy as np

from .blockers import Blockers
from .curtains import LEAST_M2, NEAR_DEG, THIN_M, cuts_inside, face_normals, inside, lots_of
from .frame import LEAST_DEG
from .graph import flat_boxes
from .occludees import Occludees, turned_occludees
from .plans import Plans, box_corners, plan_bounds, turned_plan
from .scene import GRID_LIMIT, OPAQUE, Scene, turned
from .sections import Cut, largest_sections, over, reaching
from .solids import winding_numbers

# The box around a cell's plan in its frame is wider than the plan by no more than this on every side [grid steps].
FIT_STEPS = 3.0
# Walls within so many steps of the direction of a plan, over its length, say what the direction is; walls within
# TOGETHER_DEG of the most of them are averaged.
ALIKE_STEPS, TOGETHER_DEG = 2.0, 0.02
# Rounding in a turned frame moves a surface by less than one step; sections end so far inside their element, are cut so
# far inside its faces, and no triangle of it comes so near [grid steps].
ENDS, RECESS, CLEAR_STEPS = 1, 2, 0.25
# What floating point may be off by [grid steps].
DOUBT = 1e-3


@dataclass(frozen=True)
class OwnFrame:
    """A frame that the model is turned back into, and what is needed to hide in it [grid steps].

    Attributes:
        yaw_deg: how the frame stands in the model's own, counter-clockwise about the origin.
        cells: view cells that are searched in it, shape (n,), int64.
        boxes: around them in the frame, shape (n, 2, 3), int32.
        walls: axial rectangles of the frame inside closed elements.
        occludees: all objects in boxes of the frame, rounded outwards.
    """

    yaw_deg: float
    cells: np.ndarray
    boxes: np.ndarray
    walls: Blockers
    occludees: Occludees


def find_own_frames(scene: Scene, closed: list[np.ndarray], cells: np.ndarray, plans: Plans) -> list[OwnFrame]:
    """Frames for view cells with a plan; cells whose plan is no rectangle, or stands along the axes, get none.

    Args:
        scene: the model.
        closed: triangles of closed opaque elements that may hide, (m, 3, 3) int32 of each.
        cells: all view cells [grid steps], shape (m, 2, 3), int32.
        plans: of some of them.
    """
    found = []
    for yaw, rows, boxes in _groups(scene, plans):
        boxes = np.concatenate([boxes, cells[plans.rows[rows]][:, :, 2:]], axis=2).astype(np.int32)
        # Corners of the model may lie off the grid in the frame.
        if np.abs(turned_plan(box_corners(scene.bounds()).astype(float), -yaw)).max() < GRID_LIMIT - 1:
            walls = _walls(closed, yaw, scene.grid_m)
            found.append(OwnFrame(yaw, plans.rows[rows], boxes, walls, turned_occludees(scene, yaw)))
    return found


def _groups(scene: Scene, plans: Plans) -> list[tuple[float, np.ndarray, np.ndarray]]:
    """Yaw of each frame [degrees], the plans that fit it, and the rectangles around them, shape (n, 2, 2), int64."""
    if not len(plans.rows):
        # Directions of all walls of a model take seconds.
        return []
    corners = plans.corners.astype(float)
    sides = np.roll(corners, -1, axis=1) - corners
    length = np.hypot(sides[:, :, 0], sides[:, :, 1])
    longest = sides[np.arange(len(sides)), length.argmax(axis=1)]
    length = length.max(axis=1, initial=0.0)
    yaw = np.degrees(np.arctan2(longest[:, 1], longest[:, 0])) % 90.0
    walls = _wall_directions(scene)
    left, groups = np.ones(len(corners), bool), []
    while left.any():
        # Rounding turns the longest plan the least.
        pick = np.flatnonzero(left)[length[left].argmax()]
        left[pick] = False
        own = yaw[pick] + _mean_turn(*walls, yaw[pick], np.degrees(ALIKE_STEPS / length[pick]))
        rows = np.append(pick, np.flatnonzero(left))
        level = turned_plan(corners[rows].reshape(-1, 2), -own).reshape(-1, 4, 2)
        around = plan_bounds(level)
        # The area between a plan and the rectangle around it, over its outline.
        wide = np.prod(around[:, 1] - around[:, 0], axis=1) - _area(level)
        fits = wide <= FIT_STEPS * 2 * (around[:, 1] - around[:, 0]).sum(axis=1)
        if not fits[0]:
            continue
        left[rows[fits]] = False
        # Along the axes the model's own frame is as good.
        if LEAST_DEG < own % 90.0 < 90.0 - LEAST_DEG:
            boxes = np.stack([np.floor(around[:, 0] - DOUBT), np.ceil(around[:, 1] + DOUBT)], axis=1)
            groups.append((float(own), rows[fits], boxes[fits].astype(np.int64)))
    return groups


def _area(corners: np.ndarray) -> np.ndarray:
    """Areas of plans, shape (n, 4, 2)."""
    across, other = corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1]
    return np.abs(across[:, 0] * other[:, 1] - across[:, 1] * other[:, 0]) / 2


def _wall_directions(scene: Scene) -> tuple[np.ndarray, np.ndarray]:
    """Direction of each upright opaque triangle, from 0 to 90 degrees, and its weight: long walls say it best."""
    triangles, _ = scene.triangles(*OPAQUE)
    normals, size, upright = face_normals(triangles)
    extent = np.ptp(triangles[upright][:, :, :2], axis=1).astype(float)
    yaw = np.degrees(np.arctan2(normals[upright, 1], normals[upright, 0])) % 90.0
    return yaw, size[upright] * np.hypot(extent[:, 0], extent[:, 1])


def _mean_turn(yaw: np.ndarray, weight: np.ndarray, near: float, within: float) -> float:
    """How far from a direction most of the walls within some angle of it stand [degrees]."""
    off = (yaw - near + 45.0) % 90.0 - 45.0
    order = np.argsort(off)
    order = order[np.abs(off[order]) <= within]
    if not len(order):
        return 0.0
    off, weight = off[order], weight[order]
    total = np.concatenate([[0.0], np.cumsum(weight)])
    last = np.searchsorted(off, off + TOGETHER_DEG, side="right")
    first = int((total[last] - total[:-1]).argmax())
    return float(np.average(off[first : last[first]], weights=weight[first : last[first]]))


def _walls(elements: list[np.ndarray], yaw: float, grid_m: float) -> Blockers:
    """Axial rectangles of a turned frame inside closed elements whose faces stand along it."""
    least, thin = LEAST_M2 / grid_m**2, THIN_M / grid_m
    boxes, axes = [np.zeros((0, 2, 3), np.int64)], [np.zeros(0, np.int64)]
    for lot in lots_of(elements):
        along: list[list[Cut]] = [[], []]
        owners: list[list[int]] = [[], []]
        levels: list[Cut] = []
        flats: list[np.ndarray] = []
        for number, triangles in enumerate(lot):
            flat = turned(triangles.astype(float), -yaw)
            faces = _faces_along(flat, least)
            if not any(len(part) for part in faces):
                continue
            level = np.round(flat).astype(np.int64)
            for axis in range(2):
                low, high = int(level[:, :, axis].min()), int(level[:, :, axis].max())
                depths = flat[faces[axis]][:, :, axis].mean(axis=1)
                for k in cuts_inside(depths, low, high, thin, RECESS) if len(depths) else ():
                    along[axis].append(over(level, axis, k))
                    owners[axis].append(number)
            own = _levels(flat, level)
            levels += own
            flats += [flat] * len(own)
        for axis in range(2):
            cut, found = largest_sections(along[axis], np.tile([ENDS, 0], (len(along[axis]), 1)), least)
            plane = np.array([section.plane for section in along[axis]], np.int64)[cut]
            found = flat_boxes(found, axis, plane)
            owner = np.array(owners[axis], np.int64)[cut]
            boxes.append(found[inside(turned(found.astype(float), yaw), owner, lot, CLEAR_STEPS)])
            axes.append(np.full(len(boxes[-1]), axis))
        boxes.append(_level_boxes(levels, flats, least))
        axes.append(np.full(len(boxes[-1]), 2))
    joined = np.concatenate(boxes).astype(np.int32)
    return Blockers(joined, np.concatenate(axes).astype(np.int32))


def _faces_along(flat: np.ndarray, least: float) -> list[np.ndarray]:
    """Triangles of an element that are upright faces across the x axis of a frame, and across y, if they are enough."""
    normals, size, upright = face_normals(flat)
    found = []
    for axis in (0, 1):
        off = np.abs(normals[:, 1 - axis]) <= np.sin(np.radians(NEAR_DEG)) * size
        rows = np.flatnonzero(upright & off)
        found.append(rows if size[rows].sum() / 2 >= least else rows[:0])
    return found


def _levels(flat: np.ndarray, level: np.ndarray) -> list[Cut]:
    """Sections of an element just below its tops and just above its bottoms, where its sides are upright.

    Args:
        flat: triangles of the closed element in the frame, unrounded but for their heights, shape (m, 3, 3), float64.
        level: the same, rounded, int64.
    """
    low, high = level[:, :, 2].min(axis=1), level[:, :, 2].max(axis=1)
    _, _, upright = face_normals(flat)
    found = []
    for below, heights in ((True, high), (False, low)):
        for k in np.unique(heights[low == high]).tolist():
            cut = reaching(level, 2, k, below=below)
            if upright[cut].all():
                found.append(Cut(level[cut], 2, k, below))
    return found


def _level_boxes(cuts: list[Cut], flats: list[np.ndarray], least: float) -> np.ndarray:
    """Flat boxes inside sections of `_levels`, shape (n, 2, 3), int64.

    Args:
        cuts: sections.
        flats: unrounded triangles of the element of each.
        least: smaller rectangles are left out [squared grid steps].
    """
    cut, rectangles = largest_sections(cuts, np.full((len(cuts), 2), ENDS), least)
    found = [np.zeros((0, 2, 3), np.int64)]
    for number in np.unique(cut).tolist():
        section, flat = cuts[number], flats[number]
        mine, below = rectangles[cut == number], section.below
        # The sides stand over plan boxes; none comes near the inside of a rectangle.
        k = section.plane
        sides = flat[reaching(flat, 2, k, below=below)][:, :, :2]
        sides = np.stack([sides.min(axis=1), sides.max(axis=1)], axis=1)
        near = (sides[None, :, 0] < mine[:, None, 1] + CLEAR_STEPS) & (
            sides[None, :, 1] > mine[:, None, 0] - CLEAR_STEPS
        )
        mine = mine[~near.all(axis=2).any(axis=1)]
        middles = np.column_stack([mine.mean(axis=1), np.full(len(mine), k - 0.5 if below else k + 0.5)])
        mine = mine[np.abs(winding_numbers(middles, flat)) > 0.5]
        found.append(flat_boxes(mine, 2, np.full(len(mine), k)))
    return np.concatenate(found)
