"""Every kernel, solver and method of baking, and the hard cases that it is asked."""

from collections.abc import Callable

from ...kernels.launch import Device
from ...verify.cases.hard_cases import HardCases
from . import bakes, looks, meshes, orders, searches, shadows
from .outcomes import Outcomes

KERNELS: dict[str, Callable[[HardCases, Device], Outcomes]] = {
    "launch_stab": searches.stab,
    "launch_flood": searches.flood,
    "launch_target_search": searches.target_search,
    "launch_line_trees": searches.line_trees,
    "launch_trace": searches.trace,
    "launch_eye": looks.eye,
    "launch_confirm": searches.confirm,
    "launch_aim": searches.aim,
    "launch_shaft": shadows.shaft,
    "launch_umbra": shadows.umbra,
    "launch_shrink": shadows.shrink,
    "launch_coverage": shadows.coverage,
    "launch_occludees": shadows.occludees,
    "launch_backface": meshes.backface,
    "launch_clip": meshes.clip,
    "launch_select": meshes.select,
    "launch_deviation": meshes.deviation,
    "launch_raster": meshes.raster,
    "launch_near_columns": orders.near_columns,
    "launch_tour": orders.tour,
    "vlod_hidden": shadows.vlod,
    "solve_points": shadows.points,
    "bake portals": bakes.bakes_by("portals"),
    "bake occluders": bakes.bakes_by("occluders"),
    "bake both": bakes.bakes_by("both"),
    "bake vlod": bakes.bakes_by("vlod"),
}
