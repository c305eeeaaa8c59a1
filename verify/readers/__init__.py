"""Second readers: slow, plain, and without a line of code or a loader in common with the first."""
