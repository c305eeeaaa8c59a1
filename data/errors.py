"""Errors that are the user's to mend."""


class InputError(ValueError):
    """The input or the arguments are unusable.

    The message is one line: what was expected, what was found, and where. The command line prints it and exits 2.
    """
