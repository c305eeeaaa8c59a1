"""The viewer: a static folder in which one walks through a bake, from inside and from above."""
