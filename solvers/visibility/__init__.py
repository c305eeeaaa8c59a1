"""The search over a model: what each view cell sees, what is proved hidden from it, and with which witnesses."""
