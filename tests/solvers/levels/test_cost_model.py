import numpy as np
import pytest
from viewcell.data.errors import InputError
from viewcell.solvers.levels.cost_model import COVERED, fit_cost_model, read_samples

TRUTH = (50e-9, 4e-9, 6e-6, 1e-3)


def drawn(count=60, seed=0, noise=0.0):
    """Frames of a renderer that is as the model says, up to noise."""
    rng = np.random.default_rng(seed)
    work = rng.integers([100, 1000, 1], [60_000, 2_000_000, 400], (count, 3)).astype(float)
    seconds = work @ TRUTH[:3] + TRUTH[3]
    columns = dict(zip(("primitives", "pixels", "objects"), work.T, strict=True))
    return columns | {"seconds": seconds * (1 + noise * rng.uniform(-1, 1, count))}


def test_finds_the_coefficients_of_a_linear_renderer():
    found = fit_cost_model(**drawn(), renderer="exact")
    assert (found.primitive_s, found.pixel_s, found.object_s, found.frame_s) == pytest.approx(TRUTH, rel=1e-6)
    assert found.relative_rms < 1e-9 and found.worst < 1e-8 and found.r2 > 1 - 1e-9
    assert found.margin < 1e-8
    assert (found.samples, found.renderer) == (60, "exact")


def test_residuals_are_those_of_the_samples():
    samples = drawn(200, seed=1, noise=0.2)
    # One frame took far longer than the others tell.
    samples["seconds"][7] *= 2
    found = fit_cost_model(**samples, renderer="noisy")
    modelled = found.seconds(samples["primitives"], samples["pixels"], samples["objects"])
    off = modelled / samples["seconds"] - 1
    assert found.relative_rms == pytest.approx(np.sqrt((off**2).mean()))
    assert found.worst == pytest.approx(-off.min()) and found.worst > off.max()
    spread = ((samples["seconds"] - samples["seconds"].mean()) ** 2).sum()
    assert found.r2 == pytest.approx(1 - ((modelled - samples["seconds"]) ** 2).sum() / spread)
    assert 0.05 < found.relative_rms < 0.2
    # With the margin the promised share of the samples is covered, without it not.
    assert (samples["seconds"] <= modelled * (1 + found.margin) * (1 + 1e-12)).mean() >= COVERED
    assert (samples["seconds"] <= modelled).mean() < COVERED


def test_no_coefficient_is_negative():
    samples = drawn(40)
    samples["seconds"] = 5e-3 + 1e-9 * samples["pixels"] - 2e-8 * samples["primitives"]
    found = fit_cost_model(**samples, renderer="odd")
    assert min(found.primitive_s, found.pixel_s, found.object_s, found.frame_s) >= 0
    assert found.primitive_s == 0 < found.pixel_s


def test_costs_are_whole_and_cover_the_modelled_time():
    found = fit_cost_model(**drawn(100, noise=0.1), renderer="noisy")
    primitives, pixels = np.array([0, 1, 500, 90_000]), np.array([0.0, 1.5, 300.25, 1e6])
    cost = found.object_ns(primitives, pixels)
    assert cost.dtype == np.int64 and cost[0] == 0
    one = found.seconds(primitives, pixels, 1) - found.frame_s
    assert (cost[1:] >= one[1:] * (1 + found.margin) * 1e9 * (1 - 1e-12)).all()
    assert (cost[1:] <= one[1:] * (1 + found.margin) * 1e9 + 1).all()
    assert (found.object_ns(primitives, pixels, 2.0)[2:] > cost[2:]).all()
    # A frame that spends its whole budget takes no longer than asked for.
    assert found.budget_ns(10.0) / 1e6 + found.frame_s * (1 + found.margin) * 1e3 <= 10.0


@pytest.mark.parametrize("target", [0, -1, float("nan"), float("inf"), 1e-3])
def test_refuses_budgets_that_leave_nothing(target):
    with pytest.raises(InputError, match="budget: expected"):
        fit_cost_model(**drawn(), renderer="exact").budget_ns(target)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"seconds": lambda s: s * 0}, "expected seconds above 0"),
        ({"seconds": lambda s: -s}, "expected seconds above 0"),
        ({"pixels": lambda p: p - 1e7}, "expected pixels from 0"),
        ({"primitives": lambda p: p * np.nan}, "expected primitives from 0"),
        ({"seconds": lambda s: s[:-1]}, "columns of one length"),
        (
            dict.fromkeys(("primitives", "pixels", "objects", "seconds"), lambda x: x[:11]),
            "at least 12 frames, found 11",
        ),
        ({"seconds": lambda s: s * 0 + 1e-3}, "grow with primitives"),
    ],
)
def test_refuses_samples_that_fit_nothing(change, said):
    samples = drawn()
    samples |= {name: alter(samples[name]) for name, alter in change.items()}
    with pytest.raises(InputError, match=said):
        fit_cost_model(**samples, renderer="bad")


def test_reads_a_table_and_names_it_in_errors(tmp_path):
    samples = drawn()
    names = ("primitives", "pixels", "seconds", "objects")

    def write(name, columns):
        rows = np.column_stack([samples[c] for c in columns])
        path = tmp_path / name
        np.savetxt(path, rows, delimiter=",", header=",".join(columns), comments="", fmt="%.17g")
        return path

    found = read_samples(write("mine.csv", names))
    assert found.renderer == "mine.csv" and found.object_s == pytest.approx(TRUTH[2], rel=1e-6)
    assert read_samples(write("few.csv", names[:3])).object_s == 0
    with pytest.raises(InputError, match=r"less\.csv: expected the column 'seconds', found primitives, pixels"):
        read_samples(write("less.csv", names[:2]))
    samples["seconds"] = -samples["seconds"]
    with pytest.raises(InputError, match=r"late\.csv: samples: expected seconds above 0"):
        read_samples(write("late.csv", names))
    (tmp_path / "none.csv").write_text("primitives,pixels,seconds\n")
    with pytest.raises(InputError, match=r"none\.csv: expected at least 12 frames"):
        read_samples(tmp_path / "none.csv")
    (tmp_path / "words.csv").write_text("primitives,pixels,seconds\n" + "a,b,c\n" * 20)
    with pytest.raises(InputError, match=r"words\.csv: expected numbers"):
        read_samples(tmp_path / "words.csv")
    with pytest.raises(InputError, match=r"absent\.csv"):
        read_samples(tmp_path / "absent.csv")
