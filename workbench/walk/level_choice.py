"""How levels of detail are chosen on a walk: costs, benefit, coherence; the usual ones, or those of `viewcell tune`."""

import json
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from ...data.camera import Screen
from ...data.errors import InputError
from ...solvers.levels.benefit import Algorithm, BenefitSettings
from ...solvers.levels.cost_model import CostModel
from ...solvers.levels.select_frames import Chooser, Coherence, best_of_all
from ..tune.lod import CHOOSERS, COHERENCE, HIGHS, KERNEL

# Measured by `viewcell tune lod` on the office like Soda Hall, 640 x 480 pixels; kept, so that a walk is the same
# everywhere.
USUAL_COST = CostModel(
    primitive_s=60e-9,
    pixel_s=4.5e-9,
    object_s=3.4e-6,
    frame_s=1.0e-3,
    renderer="the software renderer, as measured once (z-buffer, one CPU thread)",
    samples=192,
    relative_rms=0.11,
    worst=0.76,
    r2=0.985,
    margin=0.24,
)


@dataclass(frozen=True)
class LevelChoice:
    """How levels are chosen.

    Attributes:
        cost: of drawing.
        benefit: of what is drawn; None for the usual, in which every object must be drawn as long as it fits.
        method: of `viewcell tune lod`.
        coherence: how much levels resist change.
        screen: that the file was tuned for; None where nothing is said.
    """

    cost: CostModel = USUAL_COST
    benefit: BenefitSettings | None = None
    method: str = KERNEL
    coherence: Coherence = field(default_factory=lambda: COHERENCE)
    screen: Screen | None = None

    @property
    def choose(self) -> Chooser:
        """Solves one frame; where the time suffices for the best of everything there is nothing to solve."""
        solve = CHOOSERS[self.method]

        def choose(b: np.ndarray, c: np.ndarray, s: np.ndarray, budget: int, before: np.ndarray) -> np.ndarray:
            best = best_of_all(b[0], c, s, budget)
            return solve(b, c, s, budget, before) if best is None else best

        return choose

    def benefit_of(self, kinds: set[str]) -> BenefitSettings:
        """The benefit for a model of these kinds."""
        return self.benefit or BenefitSettings(always=tuple(sorted(kinds)))


def read_level_choice(path: str | Path) -> LevelChoice:
    """What `viewcell tune lod` recommends, from its tune-lod.json.

    Raises:
        InputError: the file is unreadable or none of `viewcell tune lod`.
    """
    try:
        found = json.loads(Path(path).read_text(encoding="utf-8"))
        told = found["lod"]
        benefit, cost, screen = dict(told["benefit"]), dict(told["cost"]), told["screen"]
        cost["r2"] = float("nan") if cost["r2"] is None else cost["r2"]
        benefit["algorithms"] = tuple(Algorithm(**one) for one in benefit["algorithms"])
        benefit["always"] = tuple(benefit["always"])
        method = told["method"]
        if method not in CHOOSERS or method == HIGHS:
            raise InputError(f"{path}: expected a method of viewcell tune lod, found {method!r}")
        return LevelChoice(
            CostModel(**cost),
            BenefitSettings(**benefit),
            method,
            replace(COHERENCE, hysteresis=told["hysteresis"], slack=told["slack"]),
            Screen(**screen),
        )
    except InputError as error:
        # A ValueError, too.
        raise InputError(f"{path}: {str(error).removeprefix(f'{path}: ')}") from None
    except OSError as error:
        raise InputError(f"{path}: expected a file of viewcell tune lod, found {error.strerror}") from None
    except (ValueError, TypeError, KeyError, AttributeError):
        raise InputError(f"{path}: expected a tune-lod.json of viewcell tune lod, found something else") from None
