"""Front door: the command line and the phases in order; orchestration only, no geometry."""
