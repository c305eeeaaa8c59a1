"""Whether a model is fit to bake: what was read, what is wrong with it, what a bake would cost."""
