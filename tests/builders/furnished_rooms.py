"""Five rooms in a row with doorways that are not in line, and furniture: a model that is baked in no time."""

from builders.random_buildings import box_triangles as box
from builders.random_buildings import scene_of

METRE = 1024
ROOMS, SIDE, WALL = 5, 2 * METRE, 100


def furnished_rooms():
    """The scene; its spaces are the rooms, and a doorway is 200 grid steps wide."""
    length, m = ROOMS * (SIDE + WALL), METRE
    parts = [
        box((-WALL, -WALL, -WALL), (length, SIDE + WALL, 0)),
        box((-WALL, -WALL, SIDE), (length, SIDE + WALL, SIDE + WALL)),
        box((-WALL, -WALL, 0), (length, 0, SIDE)),
        box((-WALL, SIDE, 0), (length, SIDE + WALL, SIDE)),
        box((-WALL, 0, 0), (0, SIDE, SIDE)),
    ]
    furniture, spaces = [], []
    for room in range(ROOMS):
        low, high = room * (SIDE + WALL), room * (SIDE + WALL) + SIDE
        spaces.append(((low, 0, 0), (high, SIDE, SIDE)))
        door = 300 + 700 * (room % 3)
        if room < ROOMS - 1:
            parts += [
                box((high, 0, 0), (high + WALL, door, SIDE)),
                box((high, door + 200, 0), (high + WALL, SIDE, SIDE)),
            ]
        else:
            parts.append(box((high, 0, 0), (high + WALL, SIDE, SIDE)))
        for n in range(4):
            corner = low + 150 + 430 * n, 100 + 550 * (n % 3), 40 + 300 * (n % 2)
            furniture.append(box(corner, tuple(c + m // 8 for c in corner)))
    return scene_of([(part, "occluder") for part in parts] + [(part, "detail") for part in furniture], spaces)
