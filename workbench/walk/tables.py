"""A walk as the papers tell one: Tables 3 to 6 of Funkhouser et al. 1996, and the policies side by side."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ...data.plural import counted
from ..summary import table
from .tally import PolicyFrames, Walked

NONE = "\N{EN DASH}"
MB = 1e6


@dataclass(frozen=True)
class Table:
    """A table.

    Attributes:
        title: of it.
        head: of its columns.
        rows: cells in words.
    """

    title: str
    head: tuple[str, ...]
    rows: list[tuple[str, ...]]

    def text(self) -> str:
        """For a terminal."""
        return f"{self.title}\n{table(self.head, self.rows)}"


def tables(walked: Walked) -> list[Table]:
    """All of them; times that were not measured are dashes, as on a simulated clock all but modelled ones."""
    found = [
        times(walked),
        counts(walked),
        *reductions(walked),
        *(memory_times(walked, one) for one in walked.policies),
    ]
    found += [sets(walked, one) for one in walked.policies]
    return [*found, policies(walked)]


def mean_most(values: np.ndarray, digits: int = 0) -> tuple[str, str]:
    """Mean, and the most, of a column."""
    return f"{values.mean():,.{max(digits, 1)}f}", f"{values.max():,.{digits}f}"


def _ms(values: np.ndarray | None) -> tuple[str, str]:
    """Mean and most of seconds in milliseconds; dashes for what was not measured."""
    return (NONE, NONE) if values is None else mean_most(1e3 * values, 2)


def _compute(walked: Walked, memory: np.ndarray | None = None) -> np.ndarray | None:
    """Seconds of computing; None on a simulated clock, on which a walk is the same every time."""
    if not walked.settings.real_time:
        return None
    return walked.shown["eye_s"] + walked.shown["levels_s"] + (0.0 if memory is None else memory)


def _frame(compute: np.ndarray | None, render: np.ndarray) -> np.ndarray:
    """Frames of a pipeline: the slower of computing and rendering."""
    return render if compute is None else np.maximum(compute, render)


TIME_HEAD = ("compute ms, mean", "most", "render ms, mean", "most", "frame ms, mean", "most")


def times(walked: Walked) -> Table:
    """Table 3: display management alone."""
    shown, whole = walked.shown, np.array([walked.model.render_s])
    compute = _compute(walked)
    seen = None if compute is None else shown["eye_s"]
    finest, chosen = shown["finest_ms"] / 1e3, shown["chosen_ms"] / 1e3
    rows = [
        ("entire model", NONE, NONE, *_ms(whole), *_ms(whole)),
        ("visibility", *_ms(seen), *_ms(finest), *_ms(_frame(seen, finest))),
        ("detail elision", *_ms(compute), *_ms(chosen), *_ms(_frame(compute, chosen))),
    ]
    return Table("Table 3: times of display management (rendering modelled)", ("cull method", *TIME_HEAD), rows)


def counts(walked: Walked) -> Table:
    """Table 4: what display management leaves."""
    shown, model = walked.shown, walked.model

    def share(polygons: np.ndarray) -> tuple[str, str]:
        return mean_most(100 * polygons / max(1, model.polygons), 2)

    whole = f"{model.cells:,}", "", f"{model.objects:,}", "", f"{model.polygons:,}", "", "100", ""
    cells = mean_most(shown["cells"])
    rows = [("entire model", *whole)]
    for name, objects, polygons in (
        ("visibility", "objects", "polygons"),
        ("detail elision", "chosen_objects", "chosen_polygons"),
    ):
        polygon_counts = shown[polygons]
        rows.append((name, *cells, *mean_most(shown[objects]), *mean_most(polygon_counts), *share(polygon_counts)))
    head = ("cells, mean", "most", "objects, mean", "most", "polygons, mean", "most", "% of model, mean", "most")
    return Table("Table 4: cells, objects and polygons rendered", ("cull method", *head), rows)


def reductions(walked: Walked) -> list[Table]:
    """Table 1 of Aliaga et al. 1999, if depth meshes are drawn: what each technique takes from what was left before."""
    shown = walked.shown
    if not shown["mesh_polygons"].any():
        return []
    meshes = shown["mesh_polygons"]
    steps = [
        ("entire model", np.full(len(meshes), walked.model.polygons)),
        ("from-region set", shown["set_polygons"]),
        ("textured depth meshes", shown["near_polygons"]),
        ("view frustum", shown["polygons"] - meshes),
        ("level of detail", shown["chosen_polygons"] - meshes),
    ]
    rows = [("entire model", *mean_most(steps[0][1]), "")]
    for (_, before), (name, after) in pairwise(steps):
        rows.append((name, *mean_most(after), f"{100 * (1 - after / np.maximum(1, before)).mean():.0f}"))
    rows.append(("depth meshes' own", *mean_most(meshes), ""))
    rows.append(("drawn in all", *mean_most(shown["chosen_polygons"]), ""))
    head = "technique", "polygons left, mean", "most", "% removed, mean"
    return [Table("Aliaga et al. 1999, Table 1: reduction of polygons", head, rows)]


def memory_times(walked: Walked, one: PolicyFrames) -> Table:
    """Table 5: without and with memory management."""
    chosen, columns = walked.shown["chosen_ms"] / 1e3, one.columns
    plain, compute = _compute(walked), _compute(walked, columns["memory_s"])
    render = columns["render_s"] if walked.settings.real_time else chosen
    rows = [
        ("no", *_ms(plain), *_ms(chosen), NONE, NONE, *_ms(_frame(plain, chosen))),
        ("yes", *_ms(compute), *_ms(render), *_ms(columns["swap_s"]), *_ms(_frame(compute, render))),
    ]
    head = ("memory management", *TIME_HEAD[:4], "swap ms, mean", "most", *TIME_HEAD[4:])
    return Table(f"Table 5: times with memory management, {one.name}", head, rows)


def sets(walked: Walked, one: PolicyFrames) -> Table:
    """Table 6: sets of objects."""
    model, columns = walked.model, one.columns
    rows = [
        ("entire model", f"{model.objects:,}", "", f"{model.polygons:,}", "", f"{model.bytes / MB:.3f}", "", "100", "")
    ]
    for name, of in (("resident", "resident"), ("lookahead", "ahead"), ("rendered", "drawn"), ("read", "read")):
        size = columns[f"{of}_bytes"]
        rows.append(
            (
                name,
                *mean_most(columns[f"{of}_objects"]),
                *mean_most(columns[f"{of}_polygons"]),
                *mean_most(size / MB, 3),
                *mean_most(100 * size / max(1, model.bytes), 2),
            )
        )
    head = ("objects, mean", "most", "polygons, mean", "most", "MB, mean", "most", "% of model, mean", "most")
    return Table(f"Table 6: sets of objects, {one.name}", ("object set", *head), rows)


def policies(walked: Walked) -> Table:
    """All policies on the same path."""
    rows = []
    for one in walked.policies:
        columns = one.columns
        rows.append(
            (
                one.name,
                *mean_most(columns["claimed"] / MB, 2),
                f"{columns['read_bytes'].sum() / MB:,.1f}",
                f"{columns['reads'].sum():,}",
                f"{columns['skipped'].mean():,.2f}",
                f"{columns['skipped'].max():,}",
                f"{100 * (columns['missing'] > 0).mean():.2f}",
                f"{100 * (columns['missing'] + columns['skipped'] > 0).mean():.2f}",
                f"{columns['failed'].sum():,}",
            )
        )
    head = (
        *("policy", "claimed MB, mean", "most", "MB read", "reads", "levels skipped, mean", "most"),
        *("% frames with something missing", "% frames not as chosen", "reads failed"),
    )
    return Table(f"Policies, cache of {walked.settings.cache_bytes / MB:g} MB", head, rows)


def notes(walked: Walked) -> list[str]:
    """What should be known of the numbers."""
    settings, path = walked.settings, walked.path
    seconds = path.t[-1] - path.t[0]
    found = [
        f"{walked.place}: {counted(len(path), 'frame')} in {seconds:,.1f} s, index of {walked.index_bytes:,} bytes",
        f"levels chosen for {settings.target_ms:g} ms; {walked.model.cost}",
    ]
    if walked.shown["mesh_polygons"].any():
        found.append(f"depth meshes of {walked.model.depth_bytes:,} bytes beside {walked.model.bytes:,} of all levels")
    dropped = int(walked.shown["dropped"].sum())
    if dropped:
        found.append(f"{dropped:,} times an object was left out because the frame's time did not suffice")
    if not settings.real_time:
        found.append("simulated clock: the same path gives the same tables; --real-time measures")
    for one in walked.policies:
        late = int((one.columns["late_s"] > np.append(np.diff(path.t), np.inf)).sum())
        if late:
            found.append(f"{one.name}: {counted(late, 'frame')} ended after the next one's time")
        found += [f"{one.name}: {counted(n, 'read')} failed: {why}" for why, n in sorted(one.failures.items())]
        if one.given_up:
            found.append(f"{one.name}: nothing was asked for any more after reads that failed in a row")
    return found


def truth_table(walked: Walked) -> Table:
    """What checks of sampled frames found."""
    rows = []
    for truth in walked.truths:
        frames = truth.frames
        total = [
            sum(len(one.dropped) + len(one.undrawn) for one in frames),
            *(sum(getattr(one, name) for one in frames) for name in ("missing", "left_out")),
        ]
        mean = [np.mean([getattr(one, name) for one in frames] or [0]) for name in ("seen", "unseen")]
        pixels = [sum(getattr(one, name) for one in frames) for name in ("differing", "wrong", "other", "pixels")]
        other = f"{100 * pixels[2] / max(1, pixels[3]):.3f}"
        row = truth.policy, len(frames), f"{mean[0]:.1f}", *total, f"{mean[1]:.1f}", *pixels[:2], other
        rows.append(tuple(f"{cell:,}" if isinstance(cell, int) else cell for cell in row))
    head = (
        *("policy", "frames", "seen, mean", "seen, there, not drawn", "seen, not there", "seen, no time for"),
        *("drawn, not seen, mean", "pixels that differ", "of them wrong", "% pixels of other levels"),
    )
    return Table("Truth: sampled frames against rays and pictures of the whole model", head, rows)


def arrival_table(walked: Walked) -> Table:
    """From nothing to what the eye sees."""
    rows = []
    for one in walked.arrivals:
        # Ratios of never are never.
        ratios, never = one.ratios, np.isinf(one.asked).any(axis=1)
        cells = [one.policy]
        for column in range(2):
            asked, read, ratio = one.asked[:, column] / 1e3, one.read[:, column] / 1e3, ratios[:, column]
            told = (asked, 0.5, 1), (ratio, 0.5, 2), (ratio, 0.9, 2), (read, 0.5, 1)
            cells += [_quantile(*what) for what in told]
        rows.append((*cells, f"{never.sum():,}"))
    head = (
        *("policy", "kB to 99 %, median", "x oracle, median", "90 %", "with gaps, kB"),
        *("kB to 100 %, median", "x oracle, median", "90 %", "with gaps, kB", "eyes that never"),
    )
    return Table("From nothing to what the eye sees: bytes of items", head, rows)


def _quantile(values: np.ndarray, share: float, digits: int) -> str:
    """One of the values that so many are not above; in words where it never comes."""
    found = float(np.quantile(values, share, method="higher"))
    return f"{found:,.{digits}f}" if np.isfinite(found) else "never"


def walk_text(walked: Walked) -> str:
    """Everything, for a terminal."""
    shown = [times(walked), counts(walked), *reductions(walked), *_of_each(walked)]
    if len(walked.policies) == 1:
        shown = tables(walked)
    shown += [truth_table(walked), arrival_table(walked)] if walked.truths else []
    wrong = [
        f"frame {one.frame}, {truth.policy}: objects {sorted({*one.dropped, *one.undrawn})} are seen and not drawn, "
        f"{one.wrong} pixels wrong; this is a bug"
        for truth in walked.truths
        for one in truth.frames
        if one.dropped or one.undrawn or one.wrong
    ]
    return "\n\n".join([*(one.text() for one in shown), "\n".join([*notes(walked), *wrong])])


def _of_each(walked: Walked) -> list[Table]:
    """Tables 5 and 6 of every policy, and all side by side."""
    found = []
    for one in walked.policies:
        found += [memory_times(walked, one), sets(walked, one)]
    return [*found, policies(walked)]
