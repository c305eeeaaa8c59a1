"""Programmes of projection points, and the exact optimum of a small one."""

from fractions import Fraction
from itertools import combinations

import numpy as np
from viewcell.kernels.umbra import launch_umbra
from viewcell.solvers.projection_point import cluster_problems
from viewcell.verify.arithmetic import dot

from builders.outlines import outline_table, random_outline


def rectangle(axis, plane, low_u, high_u, low_v, high_v):
    corners = np.zeros((4, 3), int)
    corners[:, axis] = plane
    corners[:, axis - 2] = low_u, high_u, high_u, low_u
    corners[:, axis - 1] = low_v, low_v, high_v, high_v
    return corners


def random_umbras(rng, cells, outlines):
    """Boxes, and all their umbras with outlines of all sizes around them."""
    low = rng.integers(-3000, 3000, (cells, 3))
    boxes = np.stack([low, low + rng.integers(40, 700, (cells, 3))], axis=1)
    shapes = [rng.choice([9, 60]) * random_outline(rng) for _ in range(outlines)]
    table = outline_table([rng.integers(-4000, 4000, 3) + shape - shape[0] for shape in shapes])
    pairs = np.stack(np.meshgrid(np.arange(cells), np.arange(outlines), indexing="ij"), axis=-1).reshape(-1, 2)
    return boxes, launch_umbra(boxes, table, pairs), pairs


def random_problems(seed, cells, outlines, clusters, **options):
    rng = np.random.default_rng(seed)
    boxes, umbras, pairs = random_umbras(rng, cells, outlines)
    cluster = rng.integers(0, clusters, len(pairs))
    return cluster_problems(umbras, boxes, pairs[:, 0], cluster, clusters, **options)


def one_problem(outlines, **options):
    box = np.array([[[0, 0, 0], [1000, 1000, 1000]]])
    pairs = np.stack([np.zeros(len(outlines), int), np.arange(len(outlines))], axis=1)
    umbras = launch_umbra(box, outline_table(outlines), pairs)
    return umbras, cluster_problems(umbras, box, pairs[:, 0], pairs[:, 0], 1, **options)[0]


def eliminate(matrix, right):
    """Solution of a rational system, None if it is singular."""
    rows = [[*row, value] for row, value in zip(matrix, right, strict=True)]
    for i in range(len(rows)):
        pivot = next((r for r in range(i, len(rows)) if rows[r][i] != 0), None)
        if pivot is None:
            return None
        rows[i], rows[pivot] = rows[pivot], rows[i]
        rows[i] = [x / rows[i][i] for x in rows[i]]
        for r in range(len(rows)):
            if r != i and rows[r][i] != 0:
                rows[r] = [x - rows[r][i] * y for x, y in zip(rows[r], rows[i], strict=True)]
    return [row[-1] for row in rows]


def exact_optimum(problem):
    """Minimum of a strictly convex quadratic programme by trying all active sets, in rationals."""
    normals, rows = ([[Fraction(float(x)) for x in row] for row in table] for table in (problem.normals, problem.rows))
    targets, bounds = ([Fraction(float(x)) for x in table] for table in (problem.targets, problem.bounds))
    hessian = [[2 * sum(n[i] * n[j] for n in normals) for j in range(3)] for i in range(3)]
    linear = [2 * sum(n[i] * t for n, t in zip(normals, targets, strict=True)) for i in range(3)]
    for size in range(4):
        for active in combinations(range(len(rows)), size):
            matrix = [hessian[i] + [-rows[k][i] for k in active] for i in range(3)]
            matrix += [rows[k] + [Fraction(0)] * size for k in active]
            answer = eliminate(matrix, linear + [bounds[k] for k in active])
            if answer is None or any(w < 0 for w in answer[3:]):
                continue
            if all(dot(row, answer[:3]) >= bound for row, bound in zip(rows, bounds, strict=True)):
                return sum((dot(n, answer[:3]) - t) ** 2 for n, t in zip(normals, targets, strict=True)), size
    raise AssertionError("no optimum")
