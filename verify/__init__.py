"""Truth: exact twins, certificates and their checkers, sampling, hard cases. Nothing here uses what it checks."""
