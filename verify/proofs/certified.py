"""What a check of certificates found."""

from collections.abc import Iterable
from dataclasses import dataclass, field

# Refuted claims of one kind that are told one by one.
EXAMPLES = 5


@dataclass
class Certified:
    """What a check of certificates found.

    Attributes:
        proofs: claims that a box is hidden from a cell.
        failed_proofs: those that do not hold.
        leaves: contradictions of line trees, and pieces of shafts.
        failed_occluders: blockers and occluders that the model does not have; proofs with them fail.
        covered: hidden pairs whose target lies in boxes of proofs that hold.
        uncovered: hidden pairs of which a part has no proof.
        bytes: of the certificate tables.
        made_s: seconds that the baker took to write the certificates down, beyond finding what is hidden.
        checked_s: seconds of this check.
        examples: some of what failed, one line each.
    """

    proofs: int = 0
    failed_proofs: int = 0
    leaves: int = 0
    failed_occluders: int = 0
    covered: int = 0
    uncovered: int = 0
    bytes: int = 0
    made_s: float = 0.0
    checked_s: float = 0.0
    examples: list[str] = field(default_factory=list)

    @property
    def failed(self) -> int:
        """Claims that do not hold."""
        return self.failed_proofs + self.failed_occluders + self.uncovered

    def line(self) -> str:
        """The outcome in one line."""
        each = max(self.proofs, 1)
        unreal = f", {self.failed_occluders:,} occluders are not real" if self.failed_occluders else ""
        return (
            f"{self.proofs - self.failed_proofs:,} proofs hold ({self.leaves:,} leaves), {self.failed_proofs:,} fail"
            f"{unreal}; {self.covered:,} hidden pairs covered, {self.uncovered:,} not; a proof takes "
            f"{self.bytes / each:,.0f} bytes, {1e6 * self.made_s / each:,.0f} us to write down and "
            f"{1e6 * self.checked_s / each:,.0f} us to check"
        )

    def tell(self, lines: Iterable[str]) -> None:
        """Keep some examples of one kind."""
        self.examples += [line for line, _ in zip(lines, range(EXAMPLES), strict=False)]
