"""Which cells does a ray pass through before it is stopped? Of those that it must not see, one, if there is any."""

import numpy as np
import warp as wp

wp.set_module_options({"enable_backward": False})

# A crossing ends this far short of the hit, as a share of the way: float32 hits are good to about 1e-6.
BEFORE_HIT = wp.constant(1.0 - 1.0e-5)


@wp.func
def inverse(value: float) -> float:
    """1 / value; a number that is as good as infinite for 0, which times 0 is still 0."""
    return wp.where(wp.abs(value) > 1.0e-30, 1.0 / value, 1.0e30)


@wp.kernel
def find_crossed(
    tree: wp.uint64,
    origins: wp.array[wp.vec3],
    directions: wp.array[wp.vec3],
    reach: wp.array[float],
    rows: wp.array[int],
    boxes: wp.array2d[wp.vec3],
    wanted: wp.array2d[wp.bool],
    crossed_out: wp.array[int],
):
    """The wanted cell of its row that each ray is in for longest before it is stopped; -1 for none."""
    ray = wp.tid()
    row = rows[ray]
    o, d, end = origins[ray], directions[ray], reach[ray] * float(BEFORE_HIT)
    pace = wp.vec3(inverse(d[0]), inverse(d[1]), inverse(d[2]))
    longest = float(0.0)
    crossed_out[ray] = -1
    cell = int(0)
    query = wp.bvh_query_ray(tree, o, d)
    while wp.bvh_query_next(query, cell):
        if wanted[row, cell]:
            one = wp.cw_mul(boxes[cell, 0] - o, pace)
            two = wp.cw_mul(boxes[cell, 1] - o, pace)
            near, far = wp.min(one, two), wp.max(one, two)
            enter = wp.max(wp.max(near[0], near[1]), near[2])
            leave = wp.min(wp.min(far[0], far[1]), wp.min(far[2], end))
            if leave - enter > longest:
                longest = leave - enter
                crossed_out[ray] = cell


class Crossings:
    """Cells that rays may pass through."""

    def __init__(self, boxes: np.ndarray):
        """Take the boxes [grid steps], shape (cells, 2, 3), float32."""
        self._boxes = wp.array(np.ascontiguousarray(boxes, np.float32), dtype=wp.vec3, device="cpu")
        ends = [wp.array(np.ascontiguousarray(boxes[:, side]), dtype=wp.vec3, device="cpu") for side in (0, 1)]
        self._tree = wp.Bvh(*ends) if len(boxes) else None

    def crossed(
        self, origins: np.ndarray, directions: np.ndarray, reach: np.ndarray, rows: np.ndarray, wanted: np.ndarray
    ) -> np.ndarray:
        """A cell that each ray passes through, of those that are wanted for its row; float32, so a suspicion only.

        Args:
            origins: [grid steps], shape (n, 3), float32.
            directions: shape (n, 3), float32.
            reach: parameter of the first opaque hit, inf if none, shape (n,), float32.
            rows: view cell of each, shape (n,), int.
            wanted: shape (rows, cells), bool.

        Returns:
            Shape (n,), int32; -1 for none.
        """
        found = np.full(len(origins), -1, np.int32)
        if self._tree is None or not len(origins):
            return found
        points = [wp.array(np.ascontiguousarray(a), dtype=wp.vec3, device="cpu") for a in (origins, directions)]
        numbers = [wp.array(np.ascontiguousarray(reach, np.float32), device="cpu")]
        numbers.append(wp.array(np.ascontiguousarray(rows, np.int32), device="cpu"))
        allowed = wp.array(np.ascontiguousarray(wanted), dtype=wp.bool, device="cpu")
        inputs = [self._tree.id, *points, *numbers, self._boxes, allowed]
        out = wp.array(found, device="cpu", copy=False)
        wp.launch(find_crossed, len(origins), inputs=inputs, outputs=[out], device="cpu")
        return found
