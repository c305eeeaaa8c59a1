"""Truth: exact twins, sampled rays, certificates, report."""
