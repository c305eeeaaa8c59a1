"""Hard cases through every kernel, and kernels as numbers get hard."""
