"""Sets of rooms counted once more, from the tables of cells alone, and without arrays."""


def verdicts(table, source, target):
    """Verdict by (source, target)."""
    return {(row[source], row[target]): row["verdict"] for row in table.to_pylist()}


def better(found):
    """Of verdicts, some of which may be missing."""
    found = [one for one in found if one is not None]
    return None if not found else "visible" if "visible" in found else "unknown"


def assert_room_sets(bake):
    """Tables of rooms are the union over their cells; between rooms that both have boxes only, absent is hidden."""
    rooms = {row["room_id"]: row for row in bake.rooms.to_pylist()}
    of_objects = verdicts(bake.cell_to_object, "cell_id", "object_id")
    of_cells = verdicts(bake.cell_to_cell, "cell_id", "reached_cell_id")
    objects, reached = {}, {}
    for room, row in rooms.items():
        for target in range(bake.manifest["counts"]["objects"]):
            objects[room, target] = better([of_objects.get((cell, target)) for cell in row["cells"]])
        for other, there in rooms.items():
            found = [of_cells.get((a, b)) for a in row["cells"] for b in there["cells"]]
            if room == other and row["cells"]:
                found.append("visible")
            if any(not own or not claimed(bake, own) for own in (row["cells"], there["cells"])):
                found.append("unknown")
            reached[room, other] = better(found)
    assert verdicts(bake.room_to_object, "room_id", "object_id") == {k: v for k, v in objects.items() if v}
    assert verdicts(bake.room_to_room, "room_id", "reached_room_id") == {k: v for k, v in reached.items() if v}
    assert bake.room_to_object.num_rows and bake.room_to_room.num_rows
    said = {room: bool(row["cells"]) and claimed(bake, row["cells"]) for room, row in rooms.items()}
    assert {room: row["claims_rooms"] for room, row in rooms.items()} == said


def claimed(bake, cells):
    """Whether the bake says of all these cells what other cells they see."""
    return bake.claims_cells and not any(cell >= bake.graph.tile_count for cell in cells)
