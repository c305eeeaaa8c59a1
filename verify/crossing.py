"""Which cells does a ray pass through before it is stopped? Of those that it must not see, one, if there is any."""

import numpy as np
import warp as wp

wp.set_module_options({"enable_backward": False})

# A crossing ends this far short of the hit, as a share of the way: float32 hits are good to about 1e-6.
BEFORE_HIT = wp.constant(1.0 - 1.0e-5)


@wp.kernel
def find_crossed(
    origins: wp.array[wp.vec3], directions: wp.array[wp.vec3], reach: wp.array[float], rows: wp.array[int],
    boxes: wp.array2d[wp.vec3], wanted: wp.array2d[wp.bool], crossed_out: wp.array[int],
):  # fmt: skip
    """The wanted cell of its row that each ray is in for longest before it is stopped; -1 for none."""
    ray = wp.tid()
    row = rows[ray]
    o, d, end = origins[ray], directions[ray], reach[ray] * float(BEFORE_HIT)
    longest = float(0.0)
    crossed_out[ray] = -1
    for cell in range(boxes.shape[0]):
        if wanted[row, cell]:
            enter, leave = float(0.0), float(end)
            for axis in range(3):
                low, high = boxes[cell, 0][axis] - o[axis], boxes[cell, 1][axis] - o[axis]
                if d[axis] != 0.0:
                    enter = wp.max(enter, wp.min(low / d[axis], high / d[axis]))
                    leave = wp.min(leave, wp.max(low / d[axis], high / d[axis]))
                elif low >= 0.0 or high <= 0.0:
                    leave = float(-1.0)
            if leave - enter > longest:
                longest = leave - enter
                crossed_out[ray] = cell


def crossed_cells(
    origins: np.ndarray, directions: np.ndarray, reach: np.ndarray, rows: np.ndarray, boxes: np.ndarray,
    wanted: np.ndarray,
) -> np.ndarray:  # fmt: skip
    """A cell that each ray passes through, of those that are wanted for its row; float32, so a suspicion only.

    Args:
        origins: [grid steps], shape (n, 3), float32.
        directions: shape (n, 3), float32.
        reach: parameter of the first opaque hit, inf if none, shape (n,), float32.
        rows: view cell of each, shape (n,), int.
        boxes: of the cells [grid steps], shape (cells, 2, 3), float32.
        wanted: shape (rows, cells), bool.

    Returns:
        Shape (n,), int32; -1 for none.
    """
    found = np.full(len(origins), -1, np.int32)
    if not boxes.size or not len(origins):
        return found
    points = [wp.array(np.ascontiguousarray(a), dtype=wp.vec3, device="cpu") for a in (origins, directions, boxes)]
    numbers = [wp.array(np.ascontiguousarray(reach, np.float32), device="cpu")]
    numbers.append(wp.array(np.ascontiguousarray(rows, np.int32), device="cpu"))
    allowed = wp.array(np.ascontiguousarray(wanted), dtype=wp.bool, device="cpu", copy=False)
    out = wp.array(found, device="cpu", copy=False)
    inputs = [*points[:2], *numbers, points[2].reshape((len(boxes), 2)), allowed]
    wp.launch(find_crossed, len(origins), inputs=inputs, outputs=[out], device="cpu")
    return found
