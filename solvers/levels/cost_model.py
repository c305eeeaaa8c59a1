"""Time to draw a frame, as a linear model fitted to measured frames, and in whole nanoseconds for the selection.

    seconds = a primitives + b pixels + c objects + d

Source: Funkhouser and Sequin 1993, "Adaptive display algorithm for interactive frame rates", section 3 (cost from
primitives and pixels, with constants measured on the machine). There a pipeline's slower half counts; the sum is never
less than either half, so it errs on the slow side for such a renderer.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.optimize import nnls

from ...data.errors import InputError
from ...data.store.graph_folder import numbers
from ...data.store.view_cells import read_rows

COLUMNS = ("primitives", "pixels", "seconds")
# Four unknowns: fewer rows would fit anything.
LEAST_ROWS = 12
# Times that grow by less than this part of an empty frame's do not tell what drawing costs.
LEAST_GROWTH = 1.0e-3
# Costs are raised until this share of the samples took no longer than modelled.
COVERED = 0.99


@dataclass(frozen=True)
class CostModel:
    """What drawing costs; no coefficient is negative.

    Attributes:
        primitive_s: of a triangle [s].
        pixel_s: of a pixel that an object's box covers on the screen [s].
        object_s: of an object that is drawn [s].
        frame_s: of a frame in which nothing is drawn [s].
        renderer: what was measured.
        samples: frames measured.
        relative_rms: root mean square of (model - measured) / measured.
        worst: largest |model - measured| / measured.
        r2: share of the variance of the seconds that the model explains; NaN if they do not vary.
        margin: modelled times are raised by this part; so many frames as COVERED then took no longer.
    """

    primitive_s: float
    pixel_s: float
    object_s: float
    frame_s: float
    renderer: str
    samples: int
    relative_rms: float
    worst: float
    r2: float
    margin: float

    def seconds(self, primitives: np.ndarray, pixels: np.ndarray, objects: np.ndarray | float = 0.0) -> np.ndarray:
        """Modelled time of frames [s], without the margin; all arguments of one shape."""
        return self.primitive_s * primitives + self.pixel_s * pixels + self.object_s * objects + self.frame_s

    def object_ns(self, primitives: np.ndarray, pixels: np.ndarray, factors: np.ndarray | float = 1.0) -> np.ndarray:
        """Cost of drawing one object, with the margin, rounded up to whole nanoseconds; 0 for no primitives.

        Args:
            primitives: shape (n,).
            pixels: that the object's box covers, shape (n,).
            factors: of rendering algorithms, shape (n,).

        Returns:
            Shape (n,), int64.
        """
        whole = self.primitive_s * primitives * factors + self.pixel_s * pixels * factors + self.object_s
        return np.where(np.asarray(primitives) > 0, np.ceil(whole * (1 + self.margin) * 1e9), 0).astype(np.int64)

    def budget_ns(self, target_ms: float) -> int:
        """What a frame time leaves for objects, beside the frame's own cost [whole nanoseconds].

        Raises:
            InputError: the target is not a number above 0, or leaves nothing.
        """
        if not (np.isfinite(target_ms) and target_ms > 0):
            raise InputError(f"budget: expected milliseconds above 0, found {target_ms}")
        left = target_ms * 1e6 - self.frame_s * (1 + self.margin) * 1e9
        if left < 1:
            least = self.frame_s * (1 + self.margin) * 1e3
            raise InputError(
                f"budget: expected more than {least:.3g} ms, which an empty frame takes; found {target_ms}"
            )
        return int(left)

    def line(self) -> str:
        """The fit in a sentence."""
        return (
            f"cost model: {self.primitive_s * 1e9:.3g} ns a triangle, {self.pixel_s * 1e9:.3g} ns a pixel, "
            f"{self.object_s * 1e6:.3g} us per object, {self.frame_s * 1e3:.3g} ms per frame, fitted to {self.samples} "
            f"frames of {self.renderer}; relative RMS {100 * self.relative_rms:.1f} %, worst {100 * self.worst:.0f} %, "
            f"R2 {self.r2:.3f}, margin {100 * self.margin:.0f} %"
        )


def fit_cost_model(
    primitives: np.ndarray,
    pixels: np.ndarray,
    seconds: np.ndarray,
    objects: np.ndarray | None = None,
    *,
    renderer: str,
) -> CostModel:
    """The model with coefficients >= 0 whose relative errors have the least sum of squares.

    Args:
        primitives: triangles drawn in each frame, shape (n,), >= 0.
        pixels: that the boxes of the drawn objects cover, each by itself, summed up, shape (n,), >= 0.
        seconds: measured, shape (n,), > 0.
        objects: drawn, shape (n,), >= 0; without them an object costs nothing beside its primitives and pixels.
        renderer: its name.

    Raises:
        InputError: fewer than LEAST_ROWS frames, a number out of its range or not finite, or times that grow with
            neither primitives, pixels nor objects.
    """
    columns = {"primitives": primitives, "pixels": pixels, "seconds": seconds}
    columns |= {} if objects is None else {"objects": objects}
    values = {name: np.asarray(column, np.float64) for name, column in columns.items()}
    count = len(values["seconds"])
    if any(column.shape != (count,) for column in values.values()):
        raise InputError(f"samples: expected columns of one length; found {[v.shape for v in values.values()]}")
    if count < LEAST_ROWS:
        raise InputError(f"samples: expected at least {LEAST_ROWS} frames, found {count}")
    for name, column in values.items():
        bad = ~np.isfinite(column) | (column < 0) | ((name == "seconds") & (column == 0))
        if bad.any():
            least = "above 0" if name == "seconds" else "from 0"
            raise InputError(f"samples: expected {name} {least}; found {column[bad][0]} in row {int(np.argmax(bad))}")
    measured = values["seconds"]
    terms = [values["primitives"], values["pixels"], values.get("objects", np.zeros(count)), np.ones(count)]
    relative = np.stack(terms, axis=1) / measured[:, None]
    # Columns differ by many powers of ten.
    scale = np.linalg.norm(relative, axis=0)
    scale[scale == 0] = 1.0
    found = nnls(relative / scale, np.ones(count))[0] / scale
    modelled = np.stack(terms, axis=1) @ found
    if (modelled - found[3]).max() < LEAST_GROWTH * found[3]:
        raise InputError("samples: expected seconds that grow with primitives, pixels or objects, found none that do")
    off = modelled / measured - 1
    spread = ((measured - measured.mean()) ** 2).sum()
    return CostModel(
        *found.tolist(),
        renderer=renderer,
        samples=count,
        relative_rms=float(np.sqrt((off**2).mean())),
        worst=float(np.abs(off).max()),
        r2=float(1 - ((modelled - measured) ** 2).sum() / spread) if spread > 0 else float("nan"),
        margin=max(0.0, float(np.quantile(measured / modelled, COVERED, method="higher")) - 1),
    )


def read_samples(path: str | Path) -> CostModel:
    """The model of a user's renderer: a CSV or Parquet table of primitives, pixels, seconds and, if wanted, objects.

    Raises:
        InputError: it is unreadable, a column is missing, or as `fit_cost_model`.
    """
    table = read_rows(path)
    missing = [name for name in COLUMNS if name not in table.column_names]
    if missing:
        raise InputError(f"{path}: expected the column {missing[0]!r}, found {', '.join(table.column_names)}")
    names = (*COLUMNS, "objects") if "objects" in table.column_names else COLUMNS
    if not table.num_rows:
        raise InputError(f"{path}: expected at least {LEAST_ROWS} frames, found an empty table")
    columns = dict(zip(names, numbers(table, names, Path(path)).T, strict=True))
    try:
        return fit_cost_model(**columns, renderer=Path(path).name)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
