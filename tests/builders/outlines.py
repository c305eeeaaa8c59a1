"""Outlines of occluders: discs of triangles, convex polygons of lattice planes, and view cells that they may shade."""

import numpy as np
from viewcell.data.patches import Patches, find_patches
from viewcell.verify.exact.umbra import occluder

LIMIT = 2**24


def surface(columns, rows, position):
    """Triangles of a snapped grid of quadrilaterals, position(u, v) in grid steps."""
    u, v = np.meshgrid(np.arange(columns + 1.0), np.arange(rows + 1.0), indexing="ij")
    p = np.round(np.stack(np.broadcast_arrays(*position(u, v)), axis=-1)).astype(np.int32)
    a, b, c, d = p[:-1, :-1], p[1:, :-1], p[1:, 1:], p[:-1, 1:]
    return np.concatenate([np.stack(t, axis=2).reshape(-1, 3, 3) for t in ((a, b, c), (a, c, d))])


def random_disc(rng):
    """A bent, snapped or bulging surface that is one patch."""
    bend, size = rng.choice([0, 0.02, 0.3]), int(rng.choice([6, 40, 900]))
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]

    def position(u, v):
        flat = np.stack([u * size, v * size, bend * size * (u - 1.3) * (v - 0.8)], axis=-1)
        return np.moveaxis(flat @ turn, -1, 0)

    return surface(int(rng.integers(1, 4)), int(rng.integers(1, 3)), position), size


def outline_table(outlines):
    """Planar outlines as patches, fan-triangulated."""
    found = []
    for corners in outlines:
        corners = np.asarray(corners, np.int32)
        fan = np.stack([np.repeat(corners[:1], len(corners) - 2, axis=0), corners[1:-1], corners[2:]], axis=1)
        patches = find_patches(fan, np.zeros(len(fan)), least_area=0.0, most_corners=99, cos_limit=0.5, axial=True)
        assert len(patches.area) == 1
        found.append(patches)
    return Patches(
        np.concatenate([p.corners for p in found]),
        np.concatenate([[0], np.cumsum([len(p.corners) for p in found])]),
        *(np.concatenate([getattr(p, name) for p in found]) for name in ("boxes", "normal", "depth", "owner", "area")),
    )


def random_outline(rng):
    """Convex polygon of a lattice plane: planar and exact, axial now and then."""
    size = int(rng.choice([2, 9, 60]))
    f, g = rng.integers(-size, size + 1, (2, 3))
    if rng.random() < 0.3:
        f, g = size * np.eye(3, dtype=int)[rng.permutation(3)[:2]]
    if not np.cross(f, g).any():
        return random_outline(rng)
    angle = np.sort(rng.uniform(0, 2 * np.pi, rng.integers(3, 7)))
    flat = np.unique(np.round(np.stack([np.cos(angle), np.sin(angle)], axis=1) * 12).astype(int), axis=0)
    centre = flat.mean(axis=0)
    flat = flat[np.argsort(np.arctan2(*(flat - centre).T[::-1]))]
    turns = np.cross(
        np.append(flat - np.roll(flat, 1, axis=0), np.zeros((len(flat), 1)), axis=1),
        np.append(np.roll(flat, -1, axis=0) - flat, np.zeros((len(flat), 1)), axis=1),
    )[:, 2]
    if len(flat) < 3 or (turns <= 0).any():
        return random_outline(rng)
    return rng.integers(-50, 50, 3) + flat[:, :1] * f + flat[:, 1:] * g


def random_scene(rng):
    """A cell and an outline it does not straddle, touching now and then; and the exact occluder."""
    while True:
        outline = random_outline(rng)
        spread = int(np.ptp(outline, axis=0).max())
        low = outline[0] + rng.integers(-3 * spread, 3 * spread + 1, 3)
        cell = np.stack([low, low + rng.integers(1, 2 + spread // int(rng.choice([1, 4])), 3)])
        exact = occluder(cell.tolist(), outline.tolist())
        if not exact.straddles:
            return cell, outline, exact


def area_of(corners):
    corners = np.asarray(corners, float)
    return np.linalg.norm(np.cross(corners - corners[0], np.roll(corners, -1, axis=0) - corners[0]).sum(axis=0)) / 2


def bent_quadrilateral(height):
    triangles = surface(1, 1, lambda u, v: (u * 100, v * 100, height * u * v))
    return find_patches(triangles, np.zeros(2), least_area=1.0, cos_limit=0.2, axial=True)


def at_the_border(rng, cell, outline):
    """A scene as large as the grid, or as it is and at the grid's border; with its exact occluder."""
    low, high = (f(np.concatenate([cell, outline]), axis=0) for f in (np.min, np.max))
    if rng.random() < 0.6:
        cell, outline = ((LIMIT - 1) // max(-low.min(), high.max()) * part for part in (cell, outline))
    else:
        away = np.where(rng.random(3) < 0.5, LIMIT - 1 - high, 1 - LIMIT - low)
        cell, outline = cell + away, outline + away
    return cell, outline, occluder(cell.tolist(), outline.tolist())


def bent_scenes():
    """Bent outlines and cells; in the last ones, which are mirror images, the separating planes bind."""
    bent = bent_quadrilateral(60)
    for side in (-1, 1):
        middle = np.round(bent.boxes[0].mean(axis=0) + side * bent.normal[0] * 90).astype(int)
        yield bent, np.stack([middle - 12, middle + 12])
    for signs in ([1, 1, 1], [-1, 1, 1], [1, -1, 1], [1, 1, -1], [-1, -1, -1]):
        a, b, c, d = np.array([[-38, 86, 35], [97, 23, -74], [30, 39, 60], [-78, 63, 72]]) * signs
        steep = find_patches(np.array([[a, b, c], [a, c, d]]), np.zeros(2), least_area=1.0, cos_limit=0.05, axial=True)
        yield steep, np.sort(np.array([[14, 88, -1], [19, 91, 6]]) * signs, axis=0)
