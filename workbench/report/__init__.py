"""Look at a bake: plans, sets, numbers, one HTML page."""

from ...data.extras import need

need("matplotlib")
