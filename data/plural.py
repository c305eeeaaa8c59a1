"""Numbers of things in words."""


def counted(count: int, what: str, plural: str = "") -> str:
    """A number of things: `1 cell`, `2 cells`, `1,000 boxes`.

    Args:
        count: how many.
        what: one of them.
        plural: several of them; with an s at the end by default.
    """
    return f"{count:,} {what if count == 1 else plural or what + 's'}"
