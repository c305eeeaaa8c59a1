"""Curtains at any angle between two ends that are boxes or prisms, at random; and what segments and lines show."""

import itertools
from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np
from viewcell.data.blockers import Blockers
from viewcell.data.curtains import FALLING, RISING
from viewcell.data.plans import Plans
from viewcell.data.verdict import Verdict
from viewcell.kernels.blockers import blocker_tree
from viewcell.kernels.line_tree import launch_line_trees
from viewcell.kernels.target import TargetAnswers, launch_target_search
from viewcell.verify.proofs.line_tree import hides
from viewcell.verify.proofs.ways import Blocker, End

LIMIT = 2**24
NEAR = 1e-9


@dataclass(frozen=True)
class Oblique:
    """A search of lines.

    Attributes:
        boxes: source and target, shape (2, 2, 3), int64.
        plans: of each the corners of its plan, counter-clockwise, shape (4, 2); None for all of the box.
        quads: curtains (A, B) x (x, y, z), A with the least x and the lower height, shape (n, 2, 3), int64.
        strict: whether the target is a surface.
    """

    boxes: np.ndarray
    plans: tuple
    quads: np.ndarray
    strict: bool

    def blockers(self) -> Blockers:
        boxes = np.sort(self.quads, axis=1).astype(np.int32)
        return Blockers(boxes, np.array([kind_of(quad) for quad in self.quads], np.int32))

    def known(self) -> dict[int, Blocker]:
        """The same for the checker."""
        return {n: Blocker(kind_of(quad), np.sort(quad, axis=0).tolist()) for n, quad in enumerate(self.quads)}

    def ends(self) -> list[End]:
        plans = [None if plan is None else plan.tolist() for plan in self.plans]
        return [End(box.tolist(), plan) for box, plan in zip(self.boxes, plans, strict=True)]

    def planned(self) -> Plans:
        rows = [n for n, plan in enumerate(self.plans) if plan is not None]
        corners = np.array([self.plans[n] for n in rows], np.int32).reshape(-1, 4, 2)
        return Plans(np.array(rows, np.int64), corners)

    def moved(self, change) -> "Oblique":
        """After a change of points, shape (n, 3), that maps axial planes to axial planes and keeps z or turns it."""

        def plan_of(plan):
            if plan is None:
                return None
            corners = change(np.column_stack([plan, np.zeros(4, np.int64)]))[:, :2]
            return corners if area(corners) > 0 else corners[::-1]

        boxes = np.sort(np.stack([change(box) for box in self.boxes]), axis=1)
        quads = [ordered(change(quad)) for quad in self.quads]
        return replace(self, boxes=boxes, plans=tuple(map(plan_of, self.plans)), quads=np.array(quads))


def kind_of(quad: np.ndarray) -> int:
    """As of `Blockers.axis`: a curtain along an axis is a plain rectangle."""
    x, y, _ = quad[1] - quad[0]
    return 0 if x == 0 else 1 if y == 0 else RISING if x * y > 0 else FALLING


def ordered(quad: np.ndarray) -> np.ndarray:
    """With the least x, then y, first, and the lower height there."""
    a, b = sorted([tuple(quad[0, :2].tolist()), tuple(quad[1, :2].tolist())])
    return np.array([[*a, quad[:, 2].min()], [*b, quad[:, 2].max()]], np.int64)


def area(plan: np.ndarray) -> int:
    """Twice the signed area."""
    following = np.roll(plan, -1, axis=0)
    return int((plan[:, 0] * following[:, 1] - plan[:, 1] * following[:, 0]).sum())


def convex(plan: np.ndarray) -> bool:
    along = np.roll(plan, -1, axis=0) - plan
    bend = np.roll(along, -1, axis=0)
    return bool((along[:, 0] * bend[:, 1] - along[:, 1] * bend[:, 0] > 0).all())


def around(plan: np.ndarray, heights) -> np.ndarray:
    return np.array([[*plan.min(axis=0), heights[0]], [*plan.max(axis=0), heights[1]]], np.int64)


def corners_of(box: np.ndarray, plan) -> np.ndarray:
    """Corners of an end's plan."""
    (x, y, _), (u, v, _) = box
    return np.array([[x, y], [u, y], [u, v], [x, v]]) if plan is None else plan


def random_plan(random: np.random.Generator, place: np.ndarray) -> np.ndarray:
    """A rectangle at an angle, or now and then any convex four corners, about a place."""
    while True:
        angle, (w, h) = random.uniform(0, np.pi / 2), random.uniform(3, 25, 2)
        u = np.array([np.cos(angle), np.sin(angle)])
        v = np.array([-u[1], u[0]])
        plan = np.array([place, place + w * u, place + w * u + h * v, place + h * v])
        plan = np.round(plan + (random.random() < 0.3) * random.uniform(-4, 4, (4, 2))).astype(np.int64)
        if convex(plan):
            return plan


def apart(boxes: np.ndarray, plans: tuple) -> bool:
    """Whether heights or an edge of a plan part the two ends."""
    if (boxes[0, 1] <= boxes[1, 0]).any() or (boxes[1, 1] <= boxes[0, 0]).any():
        return True
    everything, rows = Oblique(boxes, plans, np.zeros((0, 2, 3)), True), np.array([0])
    return bool(everything.planned().part(2, rows, rows + 1, boxes)[0])


def random_ends(random: np.random.Generator) -> tuple[np.ndarray, tuple, bool]:
    """Boxes and plans of two ends that are apart, many with axial boxes that are not; and whether strict."""
    while True:
        away = random.choice([20.0, 60.0, 120.0])
        strict, boxes, plans = bool(random.integers(2)), [], []
        for end in (0, 1):
            plan = random_plan(random, random.uniform(-away, away, 2))
            oblique = random.random() < 0.6
            if random.random() < 0.2 and end:
                # Along a side of the source.
                other, k = corners_of(boxes[0], plans[0]), int(random.integers(4))
                side = other[(k + 1) % 4] - other[k]
                out = np.array([side[1], -side[0]])
                plan = np.array([other[(k + 1) % 4], other[k], other[k] + out, other[(k + 1) % 4] + out])
                plan, oblique = plan + random.integers(0, 3) * np.sign(out), True
            z = np.sort(random.integers(0, 40, 2))
            z[1] += z[0] == z[1]
            box = around(plan, z)
            if not oblique and end and strict and random.random() < 0.3:
                axis = random.integers(3)
                box[1, axis] = box[0, axis]
            boxes.append(box)
            plans.append(plan if oblique and convex(plan) else None)
        boxes = np.array(boxes)
        if apart(boxes, tuple(plans)) and ((boxes[0, 1] - boxes[0, 0]) > 0).all():
            return boxes, tuple(plans), strict


def random_chain(random: np.random.Generator, boxes: np.ndarray, plans: tuple) -> list[np.ndarray]:
    """Plan points of a chain of curtains between the ends: at any yaw, nearly axial, or along a side of an end."""
    middles = [corners_of(box, plan).mean(axis=0) for box, plan in zip(boxes, plans, strict=True)]
    way = middles[1] - middles[0]
    point = middles[0] + random.uniform(0.1, 0.9) * way
    kind, length = random.random(), random.uniform(4, 220)
    angle = random.uniform(0, 2 * np.pi) if kind < 0.5 else np.arctan2(way[0], -way[1]) + random.normal(0, 0.3)
    step = length * np.array([np.cos(angle), np.sin(angle)])
    if 0.7 < kind < 0.8:
        step[int(random.integers(2))] = random.integers(-1, 2)
    if kind > 0.8:
        which = int(random.integers(2))
        plan, k = corners_of(boxes[which], plans[which]), int(random.integers(4))
        step = (plan[(k + 1) % 4] - plan[k]) * float(random.choice([1.0, 2.0, 5.0]))
        if random.random() < 0.6:
            point = plan[k] + 0.5 * (plan[(k + 1) % 4] - plan[k]) + random.integers(-1, 2, 2)
    points = [point - step / 2, point + step / 2]
    while len(points) < 4 and random.random() < 0.4:
        points.append(points[-1] + random.uniform(-80, 80, 2))
    return [np.round(p).astype(np.int64) for p in points]


def scene(seed: int, curtains: int = 6) -> Oblique:
    """A random scene of 1 to so many curtains."""
    random = np.random.default_rng(seed)
    boxes, plans, strict = random_ends(random)
    quads, wanted = [], int(random.integers(1, curtains + 1))
    while len(quads) < wanted:
        points = random_chain(random, boxes, plans)
        for a, b in itertools.pairwise(points):
            z = np.array([-60, 120]) if random.random() < 0.6 else np.sort(random.integers(-20, 70, 2))
            if (a != b).any() and z[0] < z[1] and len(quads) < wanted:
                quads.append(ordered(np.array([[*a, z[0]], [*b, z[1]]])))
    return Oblique(boxes, plans, np.array(quads), strict)


def halved(made: Oblique, depth: int = 3) -> Oblique:
    """The scene with each curtain as halves of halves where these end on the grid."""
    quads = []
    for quad in made.quads:
        parts = [quad]
        for _ in range(depth + 1):
            even = all(((part[1, :2] - part[0, :2]) % 2 == 0).all() for part in parts)
            quads += parts
            if not even:
                break
            middles = [(part[0] + part[1]) // 2 for part in parts]
            halves = zip(parts, middles, strict=True)
            parts = [
                ordered(np.array([[*a[:2], part[0, 2]], [*b[:2], part[1, 2]]]))
                for part, m in halves
                for a, b in ((part[0], m), (m, part[1]))
            ]
    return replace(made, quads=np.array(quads))


def span(box: np.ndarray, plan, origins: np.ndarray, way: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """When lines enter an end and leave it, in float64; enter > leave for those that miss it."""
    enter, leave = np.full(len(origins), -np.inf), np.full(len(origins), np.inf)
    rows = [(np.eye(3)[i] * sign, sign * box[side, i]) for i in range(3) for side, sign in ((0, 1), (1, -1))]
    if plan is not None:
        for a, b in zip(plan, np.roll(plan, -1, axis=0), strict=True):
            inward = np.array([a[1] - b[1], b[0] - a[0], 0])
            rows.append((inward, inward[:2] @ a))
    for inward, level in rows:
        # Inside is where start + rate * time is not negative.
        start, rate = origins @ inward - level, way @ inward
        with np.errstate(all="ignore"):
            time = -start / rate
        enter = np.where(rate > 0, np.maximum(enter, time), enter)
        leave = np.where(rate < 0, np.minimum(leave, time), leave)
        leave = np.where((rate == 0) & (start < 0), -np.inf, leave)
    return enter, leave


def clear(made: Oblique, origins: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """Segments that cross no curtain between leaving the source and entering the target; what is near crosses."""
    way = ends - origins
    begin = span(made.boxes[0], made.plans[0], origins, way)[1]
    end = span(made.boxes[1], made.plans[1], origins, way)[0]
    good = np.ones(len(origins), bool)
    for (ax, ay, low), (bx, by, high) in made.quads:
        x, y = float(bx - ax), float(by - ay)
        first, second = (x * (p[:, 1] - ay) - y * (p[:, 0] - ax) for p in (origins, ends))
        with np.errstate(all="ignore"):
            time = first / (first - second)
            point = origins + time[:, None] * way
            along = ((point[:, 0] - ax) * x + (point[:, 1] - ay) * y) / (x * x + y * y)
        hit = (time > begin - NEAR) & (time < end + (-NEAR if made.strict else NEAR))
        hit &= (along > -NEAR) & (along < 1 + NEAR) & (point[:, 2] > low - NEAR) & (point[:, 2] < high + NEAR)
        good &= ~hit
    return good


def inside(random: np.random.Generator, box: np.ndarray, plan, count: int) -> np.ndarray:
    """Points in an end, shape (at most count, 3)."""
    points = random.uniform(box[0], box[1], (count, 3))
    if plan is None:
        return points
    for a, b in zip(plan, np.roll(plan, -1, axis=0), strict=True):
        points = points[(b[0] - a[0]) * (points[:, 1] - a[1]) - (b[1] - a[1]) * (points[:, 0] - a[0]) > 0]
    return points


def segments(made: Oblique, seed: int, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Origins in the source and ends in the target: some between random points, some close past edges of curtains."""
    random = np.random.default_rng(seed)
    origins, ends = (inside(random, *end, count) for end in zip(made.boxes, made.plans, strict=True))
    n = min(len(origins), len(ends))
    origins, ends = origins[:n], ends[:n]
    near = made.quads[random.integers(0, len(made.quads), n)].astype(float)
    share = np.where(random.random((n, 2)) < 0.5, random.integers(0, 2, (n, 2)), random.random((n, 2)))
    share = np.concatenate([share[:, :1], share], axis=1)[:, [0, 1, 2]]
    point = near[:, 0] + share * (near[:, 1] - near[:, 0]) + random.normal(0, 1, (n, 3)) * random.choice([0.1, 1, 5])
    way = point - origins
    enter, leave = span(made.boxes[1], made.plans[1], origins, way)
    hit = (enter < leave) & (enter > 0)
    aimed = origins[hit] + (0.5 * (enter + leave))[hit, None] * way[hit]
    return np.concatenate([origins, origins[hit]]), np.concatenate([ends, aimed])


def shown(made: Oblique, seed: int, count: int) -> bool:
    """Whether a random segment is clear."""
    origins, ends = segments(made, seed, count)
    return bool(len(origins) and clear(made, origins, ends).any())


def search(made: Oblique, cap: int = 5000) -> TargetAnswers:
    tree, rows = blocker_tree(made.blockers()), np.array([[0, 1, int(made.strict)]])
    return launch_target_search(tree, made.boxes.astype(np.int32), rows, plans=made.planned(), cap=cap)


def words_of(made: Oblique, answers: TargetAnswers) -> list[int]:
    """The line tree of a hidden scene; empty if it could not be told."""
    tree, rows = blocker_tree(made.blockers()), np.array([[0, 1, int(made.strict)]])
    boxes = made.boxes.astype(np.int32)
    return launch_line_trees(tree, boxes, rows, answers.nodes, plans=made.planned()).words.tolist()


def proved(made: Oblique, words: list[int]) -> bool:
    """Whether the checker accepts a tree."""
    return hides(*made.ends(), made.strict, words, made.known())


def exact_span(end: End, point: list[Fraction], way: list[Fraction]) -> tuple[Fraction, Fraction]:
    """As `span`, of one line in rationals; all components of its direction are positive."""
    bounds = [((end.box[side][i] - point[i]) / way[i], side) for i in range(3) for side in (0, 1)]
    if end.plan is not None:
        turned = area(np.array(end.plan)) < 0
        for a, b in zip(end.plan, end.plan[1:] + end.plan[:1], strict=True):
            x, y = a[1] - b[1], b[0] - a[0]
            if turned:
                x, y = -x, -y
            start, rate = x * (point[0] - a[0]) + y * (point[1] - a[1]), x * way[0] + y * way[1]
            if rate == 0:
                bounds += [] if start > 0 else [(Fraction(1), 0), (Fraction(0), 1)]
            else:
                bounds.append((-start / rate, 0 if rate > 0 else 1))
    return max(t for t, side in bounds if side == 0), min(t for t, side in bounds if side == 1)


def line_holds(made: Oblique, answers: TargetAnswers) -> bool:
    """Whether a visible answer's line passes the insides of both ends and the inside of no curtain between, exactly."""
    octant = int(answers.octant[0])
    w, xi = ([Fraction(float(c)) for c in column[0]] for column in (answers.line, answers.offset))
    point, way = [x / a for a, x in zip(w, xi, strict=True)], [1 / a for a in w]
    source, target = (end.mirrored(octant) for end in made.ends())
    enter, begin = exact_span(source, point, way)
    end, leave = exact_span(target, point, way)
    flat = any(c == d for c, d in zip(*target.box, strict=True))
    if enter >= begin or end > leave or (end == leave and not flat):
        return False
    signs = [-1 if octant >> i & 1 else 1 for i in range(3)]
    for quad in made.quads.tolist():
        a, b = ([c * s for c, s in zip(p, signs, strict=True)] for p in quad)
        x, y = b[0] - a[0], b[1] - a[1]
        start = x * (point[1] - a[1]) - y * (point[0] - a[0])
        rate = x * way[1] - y * way[0]
        if rate == 0:
            continue
        time = -start / rate
        p = [c + time * d for c, d in zip(point, way, strict=True)]
        along = (p[0] - a[0]) * x + (p[1] - a[1]) * y
        within = 0 < along < x * x + y * y and min(a[2], b[2]) < p[2] < max(a[2], b[2])
        if within and begin < time < end:
            return False
    return True


def judge(made: Oblique, cap: int = 5000) -> Verdict:
    """The verdict, after its line was checked in rationals or its proof in whole numbers."""
    answers = search(made, cap)
    verdict = Verdict(int(answers.verdict[0]))
    if verdict == Verdict.VISIBLE:
        assert line_holds(made, answers), "wrong-visible"
    if verdict == Verdict.HIDDEN:
        words = words_of(made, answers)
        assert words == [] or proved(made, words), "a proof that does not hold"
        assert words or not leads(made), "no proof"
    return verdict


def leads(made: Oblique) -> bool:
    """Whether a line can lead from the source to the target in some octant: else a tree has no words."""
    s, t = made.boxes
    return any(
        all((t[1, i] > s[0, i]) if not octant >> i & 1 else (-t[0, i] > -s[1, i]) for i in range(3))
        for octant in range(8)
    )
