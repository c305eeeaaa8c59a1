"""What a level of detail adds to a frame: the benefit of tuples (object, level, rendering algorithm).

    benefit = size x accuracy x importance x focus x motion x hysteresis

Source: Funkhouser and Sequin 1993, "Adaptive display algorithm for interactive frame rates", section 4; the 1996
description of the Berkeley walkthrough (section 4.2.2) names the same factors. Where the papers give a direction only
("inversely related to"), the formula is stated here. All factors but the size lie in [0, 1] (importance: >= 0), so no
benefit is negative, and the level "no polygons at all" has benefit 0.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from ...data.camera import NEAR_M, CameraPath, Screen, covered_pixels, on_screen, project_boxes
from ...data.errors import InputError
from ...data.scene import Scene

# The level at which nothing is drawn.
NOTHING = -1


@dataclass(frozen=True)
class Algorithm:
    """A rendering algorithm.

    Attributes:
        name: for example "flat" or "gouraud".
        cost_factor: of what primitives and pixels cost, > 0.
        accuracy_factor: of the accuracy, in (0, 1].
        exponent: m of `accuracy_by_samples`: 1 for flat shading, 2 for Gouraud.
    """

    name: str
    cost_factor: float = 1.0
    accuracy_factor: float = 1.0
    exponent: float = 1.0


@dataclass(frozen=True)
class BenefitSettings:
    """How the factors are weighted.

    Attributes:
        accuracy: "error" (projected error_m of the level) or "samples" (number of primitives alone).
        base_error: of `accuracy_by_samples`.
        edge_focus: focus factor at the corner of the screen, in [0, 1]; 1 turns it off.
        motion: weight of apparent speed, >= 0; 0 turns it off.
        importance: factor by kind, such as IfcDoor; 1 by default.
        algorithms: rendering algorithms to choose from.
        always: kinds that are drawn in any case: they have no level "nothing".
    """

    accuracy: str = "error"
    base_error: float = 0.5
    edge_focus: float = 0.5
    motion: float = 1.0
    importance: Mapping[str, float] = field(default_factory=dict)
    algorithms: Sequence[Algorithm] = (Algorithm("flat"),)
    always: Sequence[str] = ()

    def __post_init__(self) -> None:
        if self.accuracy not in ("error", "samples"):
            raise InputError(f"accuracy: expected error or samples, found {self.accuracy!r}")
        for name, least, most in (("base_error", 0, 1), ("edge_focus", 0, 1), ("motion", 0, np.inf)):
            if not least <= getattr(self, name) <= most:
                raise InputError(f"{name}: expected a number from {least} to {most}, found {getattr(self, name)}")
        for kind, factor in self.importance.items():
            if not (np.isfinite(factor) and factor >= 0):
                raise InputError(f"importance of {kind}: expected a finite number from 0, found {factor}")
        if not self.algorithms:
            raise InputError("algorithms: expected at least one, found none")
        for one in self.algorithms:
            good = np.isfinite(one.cost_factor) and one.cost_factor > 0 and 0 < one.accuracy_factor <= 1
            if not (good and np.isfinite(one.exponent) and one.exponent > 0):
                raise InputError(f"algorithm {one.name}: expected factors and exponent above 0, accuracy at most 1")


@dataclass(frozen=True)
class Tuples:
    """Tuples (object, level, algorithm) of a scene, object by object, finest first, "nothing" last.

    Attributes:
        starts: tuples of object g are starts[g] : starts[g + 1], shape (objects + 1,), int64.
        owner: shape (tuples,), int64.
        lod: NOTHING, or the level, shape (tuples,), int64.
        algorithm: place in the settings, shape (tuples,), int64; 0 for "nothing".
        primitives: triangles, shape (tuples,), int64.
        error_m: of the level [m], shape (tuples,), float64.
        faceless: objects without a triangle: they have the level "nothing" only.
        left_out: levels of definitions that cost no less than a finer one, or are empty: in no tuple.
    """

    starts: np.ndarray
    owner: np.ndarray
    lod: np.ndarray
    algorithm: np.ndarray
    primitives: np.ndarray
    error_m: np.ndarray
    faceless: int
    left_out: int


def find_tuples(scene: Scene, settings: BenefitSettings) -> Tuples:
    """What may be chosen for each object of a scene.

    Levels whose cost does not fall from the last kept one, and levels without faces, are left out and counted.
    """
    levels = [[(len(mesh.faces), mesh.error_m) for mesh in shape.lods] for shape in scene.definitions]
    objects = [(placed.definition_id, placed.kind) for placed in scene.objects]
    return tuples_of(levels, objects, settings)


def tuples_of(
    levels: Sequence[Sequence[tuple[int, float]]], objects: Sequence[tuple[int, str]], settings: BenefitSettings
) -> Tuples:
    """As `find_tuples`, of faces and deviations [m] of the levels of each shape, and shape and kind of each object."""
    shapes, left_out = [], 0
    for own in levels:
        kept: list[tuple[int, int, float]] = []
        for lod, (faces, error_m) in enumerate(own):
            if faces and (not kept or faces < kept[-1][1]):
                kept.append((lod, faces, error_m))
        left_out += len(own) - len(kept)
        shapes.append([(lod, a, n, error) for lod, n, error in kept for a in range(len(settings.algorithms))])
    rows, starts, faceless = [], [0], 0
    for object_id, (shape, kind) in enumerate(objects):
        own = shapes[shape]
        faceless += not own
        rows += [(object_id, *row) for row in own]
        if not own or kind not in settings.always:
            rows.append((object_id, NOTHING, 0, 0, 0.0))
        starts.append(len(rows))
    table = np.array(rows, np.float64).reshape(-1, 5)
    owner, lod, algorithm, primitives = table[:, :4].astype(np.int64).T
    return Tuples(np.array(starts), owner, lod, algorithm, primitives, table[:, 4], faceless, left_out)


@dataclass(frozen=True)
class Sightings:
    """Objects in the frames' sets, frame by frame; n in all.

    Attributes:
        starts: those of frame f are starts[f] : starts[f + 1], shape (frames + 1,), int64.
        object_id: ascending in a frame, shape (n,), int64.
        pixels: that the object's box covers on the screen, about, shape (n,), float64; at least 1.
        off_middle: distance of the rectangle from the screen's middle, as part of that of a corner, shape (n,).
        speed: pixels that the box's middle has moved since the frame before, shape (n,); 0 in the first frame.
        distance_m: from the eye to the nearest point of the box, shape (n,), float64.
    """

    starts: np.ndarray
    object_id: np.ndarray
    pixels: np.ndarray
    off_middle: np.ndarray
    speed: np.ndarray
    distance_m: np.ndarray


def find_sightings(scene: Scene, path: CameraPath, screen: Screen, sets: np.ndarray) -> Sightings:
    """Objects of each frame's set whose box is not outside the view frustum.

    Args:
        scene: the model.
        path: the frames.
        screen: gives the frustum.
        sets: what may be seen, shape (frames, objects), bool.
    """
    boxes = scene.object_bounds() * scene.grid_m
    solid = (boxes[:, 0] <= boxes[:, 1]).all(axis=1)
    return sightings_of(boxes, path, screen, *np.nonzero(sets & solid))


def sightings_of(
    boxes: np.ndarray, path: CameraPath, screen: Screen, frame: np.ndarray, object_id: np.ndarray
) -> Sightings:
    """As `find_sightings`, of pairs of frame and object, ascending by both.

    Args:
        boxes: of all objects [m], shape (objects, 2, 3), float64.
        path: the frames.
        screen: gives the frustum.
        frame: place in the path, shape (n,), int.
        object_id: whose box is somewhere, shape (n,), int.
    """
    axes = path.axes()
    rectangles, inside = on_screen(screen, project_boxes(screen, path.eyes[frame], axes[frame], boxes[object_id]))
    frame, object_id, rectangles = frame[inside], object_id[inside], rectangles[inside]
    box = boxes[object_id]
    gap = np.maximum(np.maximum(box[:, 0] - path.eyes[frame], path.eyes[frame] - box[:, 1]), 0)
    half = np.array([screen.width, screen.height]) / 2
    away = np.maximum(np.maximum(rectangles[:, 0], -rectangles[:, 1]), 0)
    now, before = (_middles(screen, path, axes, at, box.mean(axis=1)) for at in (frame, np.maximum(frame - 1, 0)))
    moved = np.linalg.norm(now - before, axis=1)
    return Sightings(
        starts=np.searchsorted(frame, np.arange(len(path) + 1)),
        object_id=object_id,
        pixels=covered_pixels(screen, path.eyes[frame], axes[frame], box, rectangles),
        off_middle=np.linalg.norm(away, axis=1) / np.linalg.norm(half),
        # What was behind the eye has come from beyond the screen.
        speed=np.where(np.isfinite(moved), moved, np.linalg.norm(2 * half)),
        distance_m=np.linalg.norm(gap, axis=1),
    )


def _middles(screen: Screen, path: CameraPath, axes: np.ndarray, frame: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Points on the screen [pixels], shape (n, 2); NaN behind the eye."""
    local = np.einsum("nij,nj->ni", axes[frame], points - path.eyes[frame])
    depth = np.where(local[:, 2] > 0, local[:, 2], np.nan)
    return screen.focal * local[:, :2] / depth[:, None]


def accuracy_by_samples(samples: np.ndarray, exponent: np.ndarray | float, base_error: float = 0.5) -> np.ndarray:
    """1 - base_error / samples ** exponent (Funkhouser and Sequin 1993, section 4; base error 0.5, exponent 1 or 2).

    Args:
        samples: primitives (flat shading) or vertices (Gouraud), >= 1.
        exponent: of the rendering algorithm.
        base_error: error of one sample, in [0, 1].
    """
    return 1 - base_error / np.asarray(samples, np.float64) ** exponent


def accuracy_by_error(error_m: np.ndarray, distance_m: np.ndarray, focal: float) -> np.ndarray:
    """1 / (1 + e), e the pixels that the level's deviation covers seen face on at the object's nearest point.

    In (0, 1]; half at one pixel, the error at which the papers call a level good enough (Chhugani et al. 2005).

    Args:
        error_m: deviation from the finest level [m], >= 0.
        distance_m: to the box [m]; at least that of the near plane is taken.
        focal: [pixels].
    """
    return 1 / (1 + focal * error_m / np.maximum(distance_m, NEAR_M))


def focus_factor(off_middle: np.ndarray, edge_focus: float) -> np.ndarray:
    """1 in the middle of the screen, falling evenly to `edge_focus` at its corners.

    The papers give less to objects the farther they are from the middle, where the user is taken to look.
    """
    return 1 - (1 - edge_focus) * np.clip(off_middle, 0, 1)


def motion_factor(speed: np.ndarray, pixels: np.ndarray, primitives: np.ndarray, weight: float) -> np.ndarray:
    """1 / (1 + weight r), r the pixels moved in a frame over the width of an average polygon on the screen.

    Moving objects look blurred, fine ones sooner: the papers take the ratio of apparent speed to polygon size.
    """
    width = np.sqrt(pixels / np.maximum(primitives, 1))
    return 1 / (1 + weight * speed / width)


def hysteresis_factor(ranks: np.ndarray, previous: np.ndarray, counts: np.ndarray, strength: float) -> np.ndarray:
    """1 - strength x (change of rank since the last frame) / (largest possible change); 1 for what was not in it.

    In [1 - strength, 1]. So whatever is best under hysteresis is worth at least 1 - strength of what is best without:
    its plain benefit is no less than its lowered one, that no less than the lowered one of the plain best.

    Args:
        ranks: place of the tuple among its object's, shape (n,).
        previous: that of the last frame's choice, -1 for none, shape (n,).
        counts: tuples of the object, shape (n,).
        strength: in [0, 1).
    """
    change = np.abs(ranks - previous) / np.maximum(counts - 1, 1)
    return 1 - strength * np.where(previous >= 0, change, 0)


@dataclass(frozen=True)
class Candidates:
    """Tuples of all sightings, in their order; k in all.

    Attributes:
        starts: tuples of sighting s are starts[s] : starts[s + 1], shape (n + 1,), int64.
        tuple_id: shape (k,), int64.
        rank: place among the object's tuples, shape (k,), int64.
        benefit: without hysteresis, shape (k,), float64, finite, >= 0; 0 for "nothing".
        pixels: of the sighting, shape (k,), float64; 0 for "nothing".
    """

    starts: np.ndarray
    tuple_id: np.ndarray
    rank: np.ndarray
    benefit: np.ndarray
    pixels: np.ndarray


def find_candidates(
    scene: Scene, tuples: Tuples, sightings: Sightings, screen: Screen, settings: BenefitSettings
) -> Candidates:
    """Benefit of every tuple of every sighting."""
    return candidates_of(importance_of([o.kind for o in scene.objects], settings), tuples, sightings, screen, settings)


def importance_of(kinds: Sequence[str], settings: BenefitSettings) -> np.ndarray:
    """Factor of each object by its kind, float64."""
    return np.array([settings.importance.get(kind, 1.0) for kind in kinds])


def candidates_of(
    importance: np.ndarray, tuples: Tuples, sightings: Sightings, screen: Screen, settings: BenefitSettings
) -> Candidates:
    """As `find_candidates`, of the importance of each object, shape (objects,), float64."""
    count = np.diff(tuples.starts)[sightings.object_id]
    starts = np.append(0, np.cumsum(count))
    sighting = np.repeat(np.arange(len(count)), count)
    rank = np.arange(starts[-1]) - starts[sighting]
    chosen = tuples.starts[sightings.object_id[sighting]] + rank
    primitives, drawn = tuples.primitives[chosen], tuples.lod[chosen] != NOTHING
    exponent, factor = (
        np.array([getattr(a, name) for a in settings.algorithms])[tuples.algorithm[chosen]]
        for name in ("exponent", "accuracy_factor")
    )
    if settings.accuracy == "samples":
        accuracy = accuracy_by_samples(np.maximum(primitives, 1), exponent, settings.base_error)
    else:
        accuracy = accuracy_by_error(tuples.error_m[chosen], sightings.distance_m[sighting], screen.focal)
    pixels = sightings.pixels[sighting]
    benefit = pixels * accuracy * factor * importance[sightings.object_id[sighting]]
    benefit *= focus_factor(sightings.off_middle, settings.edge_focus)[sighting]
    benefit *= motion_factor(sightings.speed[sighting], pixels, primitives, settings.motion)
    return Candidates(starts, chosen, rank, np.where(drawn, benefit, 0.0), np.where(drawn, pixels, 0.0))
